"""All bounces of light from the first: E = D + Gρ E, for any number of lights together.

Either bounce after bounce, as many as are wanted, or solved: then two to four times fewer products with the operator
give the same digits, and an albedo near 1 costs no more than any other.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..arrays import Float32, Float64
from ..errors import InputError
from .gathering import Gathering
from .krylov_kernels import ROWS, add_scaled, inner_products

TOLERANCE = 1e-3
_LONGEST = 16  # of the sequences that solutions are combined from, before it begins anew
_MOST_PRODUCTS = 64  # where nothing tells that there is an end, it is sought no longer than this
_NONE = 1e-20  # squares of light below this are darkness

Light = Float32[np.ndarray, "vertices columns channels"]
Report = Callable[[int, float], None]


@dataclass(frozen=True)
class Bounced:
    """Indirect light at vertices, irradiance / π without albedo.

    Attributes
    ----------
    indirect
        ``(V, K, C)``.
    bounces
        Products with the operator that it took: the number of bounces, where they were added one by one.
    remaining
        Bound on what is missing, RMS over the vertices as a share of the indirect light's, of the worst column.
    """

    indirect: Light
    bounces: int
    remaining: float


def bounced(
    gathering: Gathering,
    D: Light,
    *,
    tolerance: float = TOLERANCE,
    most: int | None = None,
    report: Report | None = None,
) -> Bounced:
    """Light D (V, K, C) after one and more bounces.

    Parameters
    ----------
    D
        Direct irradiance / π at vertices, without albedo; K columns of any sign, C = 1 only for grey scenes.
    tolerance
        Of ``Bounced.remaining``.
    most
        Add this many bounces and no more, fewer if the rest is below the tolerance. Otherwise all of them, by
        GMRES (Saad and Schultz 1986) on every column by itself.
    report
        Hears of each product with the operator how many there were and what remains.

    What remains is bounded by |r| · λ / (1 − λ): r what one bounce more would add, λ the largest eigenvalue of Gρ,
    itself bounded by what bounces leave of an even light (Collatz and Wielandt). If surfaces reflect all light and none
    leaves (λ = 1) there is no solution; ``remaining`` is then infinite.

    Raises InputError for shapes that do not fit, a tolerance that is not positive or less than one bounce.
    """
    if not tolerance > 0 or (most is not None and most < 1):
        raise InputError("bounces", f"tolerance {tolerance}, most {most}: expected above 0, and 1 or more")
    if D.ndim != 3:
        raise InputError("light", f"is {D.shape}, expected (vertices, columns, channels)")
    operator = _Operator(gathering, D.shape, report)
    if most is not None:
        return _added_up(operator, D, tolerance, most)
    return _solved(operator, D, tolerance)


class _Operator:
    """Gρ on columns side by side, with an even light beside them that tells how much a bounce leaves at most."""

    def __init__(self, gathering: Gathering, shape: tuple[int, ...], report: Report | None) -> None:
        self._gathering, self._shape, self._report = gathering, shape, report
        self._even = np.ones((shape[0], 1, shape[2]), np.float32)
        self._left = np.full(shape[2], np.inf)
        self.products = 0

    def __call__(self, light: Float32[np.ndarray, "vertices n"]) -> Float32[np.ndarray, "vertices n"]:
        both = np.concatenate([light.reshape(self._shape), self._even], axis=1)
        after = self._gathering.bounce(both)
        self._bound(after[:, -1])
        self.products += 1
        return np.ascontiguousarray(after[:, :-1]).reshape(len(after), -1)

    def _bound(self, after: Float32[np.ndarray, "vertices channels"]) -> None:
        """Whatever positive light is bounced: no eigenvalue is above the most that is left of it anywhere."""
        before = self._even[:, 0]
        lit = before > 0
        ratio = np.divide(after, before, out=np.zeros_like(after), where=lit)
        self._left = np.minimum(self._left, ratio.max(axis=0))
        scale = np.maximum(after.max(axis=0), np.float32(1e-30))
        self._even = np.where(after > 1e-20 * scale, after / scale, 0)[:, None].astype(np.float32)

    @property
    def tail(self) -> float:
        """λ / (1 − λ) of the worst channel."""
        left = float(self._left.max())
        return left / (1 - left) if left < 1 else np.inf

    def tell(self, remaining: float) -> None:
        if self._report is not None:
            self._report(self.products, remaining)


def _share(rest: Float64[np.ndarray, "n"], whole: Float64[np.ndarray, "n"], tail: float) -> float:
    """The largest ratio of square roots, times ``tail``; 0 of darkness."""
    lit = whole > max(_NONE, 1e-12 * float(whole.max(initial=0.0)))
    ratio = np.divide(rest, whole, out=np.zeros_like(rest), where=lit)
    worst = float(np.sqrt(ratio.max(initial=0.0)))
    return worst * tail if worst else 0.0


def _squares(light: Float32[np.ndarray, "vertices n"]) -> Float64[np.ndarray, "n"]:
    return _products(light[None], light)[0]


def _products(
    basis: Float32[np.ndarray, "m vertices n"], w: Float32[np.ndarray, "vertices n"]
) -> Float64[np.ndarray, "m n"]:
    sums = np.empty((-(-len(w) // ROWS), len(basis), w.shape[1]))
    inner_products(basis, w, sums)
    return sums.sum(axis=0)


def _added_up(operator: _Operator, D: Light, tolerance: float, most: int) -> Bounced:
    term = np.ascontiguousarray(D, np.float32).reshape(len(D), -1)
    total = np.zeros_like(term)
    remaining = np.inf
    while operator.products < most and remaining > tolerance:
        term = operator(term)
        total += term
        remaining = _share(_squares(term), _squares(total), operator.tail)
        operator.tell(remaining)
    return Bounced(total.reshape(D.shape), operator.products, remaining)


def _solved(operator: _Operator, D: Light, tolerance: float) -> Bounced:
    first = operator(np.ascontiguousarray(D, np.float32).reshape(len(D), -1))
    total, rest = np.zeros_like(first), first
    remaining = _share(_squares(rest), _squares(first), operator.tail)
    operator.tell(remaining)
    while remaining > tolerance and operator.products < _MOST_PRODUCTS:
        step, rest = _combined(operator, rest, total, tolerance)
        total += step
        remaining = _share(_squares(rest), _squares(total + rest), operator.tail)
    total += rest  # one bounce of what there is: no product, for it is known
    return Bounced(total.reshape(D.shape), operator.products, remaining)


def _combined(
    operator: _Operator, rest: np.ndarray, total: np.ndarray, tolerance: float
) -> tuple[np.ndarray, np.ndarray]:
    """x with the least |rest − (1 − Gρ) x| of each column among sums of few bounces of ``rest``, and what is then left.

    One run of GMRES; Gram–Schmidt twice, since light is kept in float32.
    """
    V, n = rest.shape
    length = np.sqrt(_squares(rest))
    basis = np.empty((_LONGEST + 1, V, n), np.float32)
    _divide(rest, length, basis[0])
    H = np.zeros((n, _LONGEST + 1, _LONGEST))
    for j in range(_LONGEST):
        w = basis[j] - operator(basis[j])
        for _ in range(2):
            h = _products(basis[: j + 1], w)
            add_scaled(-h, basis[: j + 1], w)
            H[:, : j + 1, j] += h.T
        H[:, j + 1, j] = np.sqrt(_squares(w))
        _divide(w, H[:, j + 1, j], basis[j + 1])
        part = H[:, : j + 2, : j + 1]
        y = np.linalg.pinv(part, rcond=1e-7)[:, :, 0] * length[:, None]
        left = -np.ascontiguousarray((part @ y[:, :, None])[:, :, 0].T)  # of the rest, in terms of the basis
        left[0] += length
        x = total.copy()
        add_scaled(np.ascontiguousarray(y.T), basis[: j + 1], x)
        remaining = _share((left**2).sum(axis=0), _squares(x), operator.tail)
        operator.tell(remaining)
        if remaining <= tolerance or operator.products >= _MOST_PRODUCTS:
            break
    rest = np.zeros_like(rest)
    add_scaled(left, basis[: len(left)], rest)
    return x - total, rest


def _divide(w: np.ndarray, length: Float64[np.ndarray, "n"], out: np.ndarray) -> None:
    """Columns of length 1, or dark if they are too small to have a direction."""
    inverse = np.divide(1, length, out=np.zeros_like(length), where=length > 1e-10)
    np.multiply(w, inverse.astype(np.float32), out=out)
