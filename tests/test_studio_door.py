"""S1 to S3: who may come in. Everything else gets 401 or 403 before any work, and no file but the page's."""

from __future__ import annotations

import base64
import re
import sys
from pathlib import Path
from urllib.parse import quote

import pytest
from websockets.exceptions import InvalidStatus

from prelight.studio import hub, server
from prelight.studio.door import Door

from .live_studio import LiveStudio, ball_bake, running

CANARY = b"canary: no request may ever see this"
ROUTES = ["/", "/geometry.json", "/geometry/positions", "/texture/0", "/preview/stock:noon", "/sky/stock:noon",
          "/studio.js", "/socket", "/no-such-thing"]  # fmt: skip


@pytest.fixture(scope="module")
def studio(tmp_path_factory):
    folder = tmp_path_factory.mktemp("door")
    bake = ball_bake(tmp_path_factory)
    (folder / "root").mkdir()
    (folder / "root" / "index.html").write_text("<!doctype html><title>page</title>")
    (folder / "root" / "studio.js").write_text("// page")
    (folder / "root-x").mkdir()
    for place in (folder, folder / "root-x"):
        (place / "canary.txt").write_bytes(CANARY)
        (place / "canary.js").write_bytes(CANARY)
    (folder / "root" / "sub").mkdir()
    (folder / "root" / "sub" / "canary.js").write_bytes(CANARY)
    (folder / "root" / "notes.txt").write_bytes(CANARY)  # not of the page
    with running(bake, state_file=folder / "ball.studio.json", page=folder / "root") as running_studio:
        yield running_studio


# ---- S1: the link, the cookie, the address ---------------------------------------------------------------------


def test_a_link_opens_once_and_leaves_a_cookie(studio: LiveStudio) -> None:
    path = studio.link_path()
    token = path.removeprefix("/?token=")
    assert len(base64.urlsafe_b64decode(token + "==")) * 8 >= 192
    first = studio.request("GET", path, cookie=None)
    assert (first.status, first.getheader("location")) == (303, "/")
    cookie = first.getheader("set-cookie", "")
    assert cookie.endswith("; Path=/; HttpOnly; SameSite=Strict")
    assert token not in cookie
    assert studio.request("GET", path, cookie=None).status == 401  # used
    assert studio.request("GET", "/", cookie=cookie.split(";")[0]).status == 200
    again = studio.request("GET", path)  # a used link in a browser that is in: the token leaves the address
    assert (again.status, again.getheader("location")) == (303, "/")


def test_old_links_are_forgotten() -> None:
    door = Door(lambda *_: None, port=1)  # type: ignore[arg-type, return-value]
    links = [door.new_link() for _ in range(40)]
    assert len(set(links)) == 40
    assert len(door._tokens) <= 16


def test_it_listens_on_this_machine_alone(studio: LiveStudio) -> None:
    """Every listening socket of this process, as the kernel has it: 127.0.0.1 and nothing else."""
    if not Path("/proc/net/tcp").exists():
        pytest.skip("no /proc/net/tcp")
    inodes = {p.readlink().name for p in Path("/proc/self/fd").iterdir() if "socket:" in _link(p)}
    inodes = {re.sub(r"\D", "", name) for name in inodes}
    addresses = set()
    for table in ("tcp", "tcp6"):
        for line in Path(f"/proc/net/{table}").read_text().splitlines()[1:]:
            words = line.split()
            if words[3] == "0A" and words[9] in inodes:
                addresses.add(words[1])
    assert f"0100007F:{studio.port:04X}" in addresses
    assert all(address.startswith("0100007F:") for address in addresses)


def _link(path: Path) -> str:
    try:
        return str(path.readlink())
    except OSError:
        return ""


def test_nothing_is_logged(studio: LiveStudio, capfd, caplog) -> None:
    """Though the server were asked to log what it does."""
    for logger in ("uvicorn.access", "uvicorn.error", "asyncio"):
        caplog.set_level("INFO", logger=logger)
    path = studio.link_path()
    studio.request("GET", path, cookie=None)
    studio.request("GET", path, cookie=None)
    with studio.page() as page:
        page.message("Welcome")
    said = "".join(capfd.readouterr()) + caplog.text
    assert path.removeprefix("/?token=") not in said
    assert studio.cookie.split("=")[1] not in said


def test_answers_carry_their_policy(studio: LiveStudio) -> None:
    for path in ("/", "/studio.js", "/geometry.json", "/nothing"):
        answer = studio.request("GET", path)
        policy = answer.getheader("content-security-policy", "")
        assert "default-src 'none'" in policy
        assert "unsafe" not in policy
        assert "frame-ancestors 'none'" in policy
        assert answer.getheader("x-content-type-options") == "nosniff"
        assert answer.getheader("referrer-policy") == "no-referrer"
        assert answer.getheader("cross-origin-resource-policy") == "same-origin"
        assert answer.getheader("access-control-allow-origin") is None
        assert answer.getheader("server") is None


# ---- S2: the matrix of refusals --------------------------------------------------------------------------------


def strangers(studio: LiveStudio) -> dict[str, tuple[str | None, dict[str, str | None]]]:
    """Who must not come in: their cookie ("" is the right one) and headers."""
    host, port = studio.host, studio.port
    name = studio.cookie.split("=")[0]
    other = f"http://127.0.0.1:{port + 1}"
    return {
        "no cookie": (None, {}),
        "an empty cookie": (f"{name}=", {}),
        "a wrong cookie": (f"{name}={'A' * 43}", {}),
        "a cut cookie": (studio.cookie[:-1], {}),
        "a longer cookie": (studio.cookie + "A", {}),
        "a token as cookie": (f"{name}={studio.link_path().split('=')[1]}", {}),
        "the cookie of another port": (f"prelight-1={studio.cookie.split('=')[1]}", {}),
        "a huge cookie": (f"{name}={'A' * 9000}", {}),
        "a foreign origin": ("", {"Origin": "http://evil.example"}),
        "a null origin": ("", {"Origin": "null"}),
        "an empty origin": ("", {"Origin": ""}),
        "an origin with our name in it": ("", {"Origin": f"http://127.0.0.1:{port}.evil.example"}),
        "localhost.evil": ("", {"Origin": f"http://localhost.evil:{port}"}),
        "another port": ("", {"Origin": other}),
        "another scheme": ("", {"Origin": f"https://{host}"}),
        "our origin by its other name": ("", {"Origin": f"http://localhost:{port}"}),
        "an origin with a path": ("", {"Origin": f"http://{host}/"}),
        "a foreign host": ("", {"Host": "evil.example"}),
        "a rebound name": ("", {"Host": f"evil.example:{port}", "Origin": f"http://evil.example:{port}"}),
        "a host with a dot": ("", {"Host": f"127.0.0.1.:{port}", "Origin": f"http://127.0.0.1.:{port}"}),
        "localhost with a dot": ("", {"Host": f"localhost.:{port}", "Origin": f"http://localhost.:{port}"}),
        "a host without port": ("", {"Host": "127.0.0.1", "Origin": "http://127.0.0.1"}),
        "another port as host": ("", {"Host": f"127.0.0.1:{port + 1}", "Origin": other}),
        "IPv6": ("", {"Host": f"[::1]:{port}", "Origin": f"http://[::1]:{port}"}),
        "IPv4 in IPv6": (
            "",
            {"Host": f"[::ffff:127.0.0.1]:{port}", "Origin": f"http://[::ffff:127.0.0.1]:{port}"},
        ),
        "a short address": ("", {"Host": f"127.1:{port}", "Origin": f"http://127.1:{port}"}),
        "an address as a number": ("", {"Host": f"2130706433:{port}", "Origin": f"http://2130706433:{port}"}),
        "no address": ("", {"Host": f"0.0.0.0:{port}", "Origin": f"http://0.0.0.0:{port}"}),
        "a user before the host": ("", {"Host": f"a@127.0.0.1:{port}", "Origin": f"http://{host}"}),
        "a page on another port": ("", {"Sec-Fetch-Site": "same-site", "Origin": None}),
        "a page from elsewhere": ("", {"Sec-Fetch-Site": "cross-site", "Origin": None}),
    }


def test_strangers_are_refused_everywhere(studio: LiveStudio, monkeypatch) -> None:
    """S2: every route, GET and HEAD; nothing behind the door is reached."""
    reached = []
    monkeypatch.setattr(studio.studio._door, "_app", lambda *_: reached.append(1))
    tried = 0
    for who, (cookie, headers) in strangers(studio).items():
        for route in ROUTES:
            method = "HEAD" if tried % 4 == 3 else "GET"
            answer = studio.request(method, route, cookie=cookie, headers=headers)
            assert answer.status in (401, 403), (who, method, route, answer.status)
            assert CANARY not in answer.content  # type: ignore[attr-defined]
            tried += 1
    assert tried > 250
    assert not reached


def test_strangers_get_no_socket(studio: LiveStudio, monkeypatch) -> None:
    visits = []
    monkeypatch.setattr(hub.Hub, "visit", lambda *_: visits.append(1))
    for who, (cookie, headers) in strangers(studio).items():
        if who == "a huge cookie":
            continue  # more than the socket's parser reads at all
        given = studio.cookie if cookie == "" else cookie
        origin = headers.get("Origin", f"http://{studio.host}")
        extra = {k: v for k, v in headers.items() if k not in ("Origin", "Host") and v}
        if given:
            extra["Cookie"] = given
        if "Host" in headers:
            status = _handshake(studio, cookie=given or "", host=str(headers["Host"]), origin=origin)
        else:
            with (
                pytest.raises(InvalidStatus) as refused,
                studio.connect(origin=origin, additional_headers=extra),
            ):
                pass
            status = refused.value.response.status_code
        assert status in (401, 403), who
    # A cookie comes along from anywhere on this machine: no Origin, no socket.
    with pytest.raises(InvalidStatus), studio.connect(origin=None):
        pass
    assert not visits


def _handshake(studio: LiveStudio, *, cookie: str, host: str, origin: str | None) -> int:
    headers: dict[str, str | None] = {"Host": host, "Origin": origin, "Connection": "Upgrade", "Upgrade": "websocket",
               "Sec-WebSocket-Version": "13", "Sec-WebSocket-Key": "AAAAAAAAAAAAAAAAAAAAAA=="}  # fmt: skip
    return studio.request("GET", "/socket", cookie=cookie, headers=headers).status


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "PATCH", "OPTIONS", "TRACE", "PROPFIND"])
def test_other_methods_change_nothing(studio: LiveStudio, method) -> None:
    for route in ROUTES:
        assert studio.request(method, route, cookie=None).status == 403
        assert studio.request(method, route).status == 403  # no Origin
        ours = {"Origin": f"http://{studio.host}"}
        assert studio.request(method, route, headers=ours).status in (403, 404, 405)
    preflight = {"Origin": "http://evil.example", "Access-Control-Request-Method": "GET"}
    answer = studio.request("OPTIONS", "/geometry.json", headers=preflight)
    assert answer.status == 403
    assert not [name for name, _ in answer.getheaders() if name.lower().startswith("access-control")]


def test_two_hosts_and_two_cookies_are_one_too_many(studio: LiveStudio) -> None:
    assert studio.request("GET", "/", headers={"Sec-Fetch-Site": "none"}).status == 200
    assert studio.request("GET", "/", headers={"Sec-Fetch-Site": "same-origin"}).status == 200
    assert studio.request("GET", "/", headers={"cookie": studio.cookie}).status == 401


# ---- S3: no file but the page's --------------------------------------------------------------------------------

ESCAPES = [
    "../canary.txt", "..%2fcanary.txt", "%2e%2e/canary.txt", "%2e%2e%2fcanary.txt", "..%252fcanary.txt",
    "%252e%252e%252fcanary.txt", "..\\canary.txt", "..%5ccanary.txt", "%2e%2e%5ccanary.txt",
    "....//canary.txt", "..;/canary.txt", "..%00/canary.txt", "canary.txt%00.js", "../root-x/canary.js",
    "..%2froot-x%2fcanary.js", "../root/../canary.txt", "./../canary.txt", "sub/../../canary.txt",
    "sub/canary.js", "sub%2fcanary.js", "/canary.txt", "//canary.txt", "%2fcanary.txt", "%2f%2fcanary.txt",
    "\\canary.txt", "~/canary.txt", "notes.txt", "sub", "sub/", ".", "..", "../", "%c0%ae%c0%ae/canary.txt",
    "%e0%80%ae%e0%80%ae/canary.txt", "\u2024\u2024/canary.txt", "..%c0%afcanary.txt",
    "..%ef%bc%8fcanary.txt", "file:canary.txt", "file:///{folder}/canary.txt", "{folder}/canary.txt",
    "//{folder}/canary.txt", "..%2f..%2f..%2f..%2fetc%2fpasswd", "/etc/passwd", "%2fetc%2fpasswd",
    "/proc/self/environ", "../../../../../../../../etc/passwd", "index.html/../../canary.txt",
    "studio.js/../../canary.txt", "studio.js%00", "studio.js/", "STUDIO.JS", "studio.js.",
    "studio.js::$DATA", "studio.js%20", "c:/canary.txt", "\\\\host\\canary.txt", "?path=../canary.txt",
    "#/../canary.txt", "__init__.py", "../server.py", "..%2f..%2fserver.py", "web/source/messages.ts",
]  # fmt: skip


def test_no_spelling_leads_out(studio: LiveStudio, tmp_path) -> None:
    """S3: 60 spellings on every route that takes a name; not one file is opened for them."""
    assert len(ESCAPES) >= 60
    opened: list[str] = []
    listening = True

    def hook(event: str, arguments: tuple) -> None:
        if (
            listening
            and event in ("open", "os.listdir", "os.scandir")
            and isinstance(arguments[0], str | bytes)
        ):
            opened.append(str(arguments[0]))

    sys.addaudithook(hook)
    try:
        for spelling in ESCAPES:
            path = quote(spelling.replace("{folder}", str(tmp_path)), safe="%/\\?#;:~$")
            for prefix in ("/", "/geometry/", "/texture/", "/preview/", "/sky/"):
                answer = studio.request("GET", prefix + path)
                assert answer.status != 500, prefix + path
                assert CANARY not in answer.content, prefix + path  # type: ignore[attr-defined]
                assert b"root:" not in answer.content, prefix + path  # type: ignore[attr-defined]
    finally:
        listening = False
    assert not [
        name for name in opened if "canary" in name or "passwd" in name or "notes" in name or "root" in name
    ]


def test_the_page_is_what_it_was_when_the_studio_began(studio: LiveStudio) -> None:
    assert studio.get("/studio.js") == b"// page"
    assert studio.get("/") == b"<!doctype html><title>page</title>"
    assert studio.request("GET", "/notes.txt").status == 404
    assert studio.request("GET", "/index.html").status == 404
    assert b"no studio page" in server.page_files(Path(__file__).parent / "none")["/"][0]
