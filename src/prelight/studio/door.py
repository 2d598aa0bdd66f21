"""Who may come in: every request and socket passes here before anything is done for it.

The studio listens on 127.0.0.1 alone, but any page in the user's browser can send requests there, and any other
program on the machine too. So, in this order: the Host must be ours (DNS rebinding), the Origin too where the
browser sends one and always on a socket (pages of others, which bring our cookie along if they come from another
port of this machine), and the cookie must be one that we gave for a link. A link holds a token of 256 random
bits that opens once; it is told to the user and never written to a log.
"""

from __future__ import annotations

import hmac
import secrets
from collections import OrderedDict
from collections.abc import Awaitable, Callable, MutableMapping
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qsl

Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]

HOST = "127.0.0.1"
_TOKEN_BYTES = 32
_MOST_TOKENS = 16  # links not yet used; the oldest is forgotten
_SAFE_METHODS = ("GET", "HEAD")

_CLOSED_PAGE = b"""<!doctype html><html lang="en"><meta charset="utf-8"><title>Prelight</title>
<p>This link opens the studio once, and it has been used, or it is not one of this studio.</p>
<p>Press Enter in the terminal where the studio runs for a new one.</p></html>
"""


class Door:
    """The links of a studio on a port, and the check of every request.

    Parameters
    ----------
    app
        What is behind it (ASGI).
    port
        It listens on.
    """

    def __init__(self, app: App, *, port: int) -> None:
        self._app, self._port = app, port
        self._hosts = (f"{HOST}:{port}", f"localhost:{port}")
        self._key = secrets.token_urlsafe(_TOKEN_BYTES)
        self._cookie = f"prelight-{port}"  # cookies know no ports: two studios must not share one
        self._tokens: OrderedDict[str, None] = OrderedDict()

    def new_link(self) -> str:
        """A URL that opens the studio once."""
        token = secrets.token_urlsafe(_TOKEN_BYTES)
        self._tokens[token] = None
        while len(self._tokens) > _MOST_TOKENS:
            self._tokens.popitem(last=False)
        return f"http://{HOST}:{self._port}/?token={token}"

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        query, scope["query_string"] = scope["query_string"], b""  # nobody behind us logs a token
        headers: dict[bytes, list[bytes]] = {}
        for name, value in scope["headers"]:
            headers.setdefault(name.lower(), []).append(value)
        is_socket = scope["type"] == "websocket"
        send = send if is_socket else self._guarded(send)
        if not self._is_ours(headers, is_socket=is_socket, method=scope.get("method", "GET")):
            await _refuse(scope, send, 403, b"this studio answers its own page only\n")
        elif self._has_cookie(headers):
            if not is_socket and scope["path"] == "/" and query:
                await _redirect(send, [])  # a used link: no token stays in the address
            else:
                await self._app(scope, receive, send)
        elif not is_socket and scope["path"] == "/" and scope["method"] == "GET" and self._opens(query):
            value = f"{self._cookie}={self._key}; Path=/; HttpOnly; SameSite=Strict"
            await _redirect(send, [(b"set-cookie", value.encode())])
        else:
            await _refuse(scope, send, 401, _CLOSED_PAGE)

    # ---- What is looked at -------------------------------------------------------------------------------

    def _is_ours(self, headers: dict[bytes, list[bytes]], *, is_socket: bool, method: str) -> bool:
        hosts = headers.get(b"host", [])
        if len(hosts) != 1 or hosts[0].decode("latin-1") not in self._hosts:
            return False
        origins = headers.get(b"origin", [])
        if origins and origins != [b"http://" + hosts[0]]:
            return False
        if not origins and (is_socket or method not in _SAFE_METHODS):
            return False
        # Browsers say so of what they fetch without an Origin; pages on other ports are "same-site".
        return all(site in (b"same-origin", b"none") for site in headers.get(b"sec-fetch-site", []))

    def _has_cookie(self, headers: dict[bytes, list[bytes]]) -> bool:
        given = headers.get(b"cookie", [])
        if len(given) != 1 or len(given[0]) > 8192:
            return False
        try:
            morsel = SimpleCookie(given[0].decode("latin-1")).get(self._cookie)
        except CookieError:
            return False
        return morsel is not None and hmac.compare_digest(morsel.value.encode(), self._key.encode())

    def _opens(self, query: bytes) -> bool:
        """Whether the query has a token that is good; it is used up."""
        fields = parse_qsl(query.decode("latin-1"))
        if len(fields) != 1 or fields[0][0] != "token":
            return False
        given = fields[0][1].encode("utf-8", "replace")
        found = [token for token in list(self._tokens) if hmac.compare_digest(token.encode(), given)]
        for token in found:
            del self._tokens[token]
        return bool(found)

    # ---- What goes out -----------------------------------------------------------------------------------

    def _guarded(self, send: Send) -> Send:
        """Adds to every answer what keeps a browser from running or showing it elsewhere."""
        sockets = " ".join(f"ws://{host}" for host in self._hosts)
        policy = (
            "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; "
            f"connect-src 'self' {sockets}; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
        )
        extra = [
            (b"content-security-policy", policy.encode()),
            (b"x-content-type-options", b"nosniff"),
            (b"referrer-policy", b"no-referrer"),
            (b"cross-origin-opener-policy", b"same-origin"),
            (b"cross-origin-resource-policy", b"same-origin"),
            (b"cache-control", b"no-store"),
        ]

        async def guarded(message: MutableMapping[str, Any]) -> None:
            if message["type"] == "http.response.start":
                message = {**message, "headers": [*message.get("headers", []), *extra]}
            await send(message)

        return guarded


async def _redirect(send: Send, headers: list[tuple[bytes, bytes]]) -> None:
    location = [(b"location", b"/"), (b"content-length", b"0")]
    await send({"type": "http.response.start", "status": 303, "headers": [*location, *headers]})
    await send({"type": "http.response.body", "body": b""})


async def _refuse(scope: Scope, send: Send, status: int, body: bytes) -> None:
    if scope["type"] == "websocket":
        await send({"type": "websocket.close", "code": 1008})  # before it is accepted: 403
        return
    headers = [
        (b"content-type", b"text/html; charset=utf-8"),
        (b"content-length", str(len(body)).encode()),
        (b"connection", b"close"),  # what it may still send is not read
    ]
    await send({"type": "http.response.start", "status": status, "headers": headers})
    await send({"type": "http.response.body", "body": b"" if scope["method"] == "HEAD" else body})
