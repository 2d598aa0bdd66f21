"""What many cells bring to eight directions by a Gaussian of their angles, as vector instructions.

Numba looks a weight up for one pair after the other; in LLVM's own vector types eight directions are found side by
side, their weights a power of a polynomial: several times as fast, each sum still in the order of the cells.
"""

from __future__ import annotations

from collections.abc import Callable

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

LANES = 8  # directions
TERMS = 8  # of the polynomial, the constant first
HALVINGS = 4  # its value is squared so often
WIDE = 2.0  # radians: of weights that reach farther
_I64, _FLOAT = ir.IntType(64), ir.FloatType()
_WIDE = ir.VectorType(_FLOAT, LANES)
_CELL = 32  # bytes
_NOTHING = ir.Constant(_WIDE, [0.0] * LANES)


def cell_sums(*, wide: bool) -> Callable:
    """An intrinsic ``add_cells(directions, cells, count, weight, sums)`` of five addresses and numbers.

    sums (4, 8) += Σ_k w(1 − cos of the angle to cell k) · cell k's last four numbers, for each of eight directions.
    ``directions`` (3, 8); ``cells`` (count, 8): unit direction, 0, and the four; ``weight``: ``TERMS`` of a polynomial
    in t, whose ``2^HALVINGS``-th power is w up to t = 1, where it ends; then a scale. All float32 and contiguous;
    ``count`` at least 1. t is scale · (1 − cos), or if ``wide`` scale · (1 − cos of half the angle): functions of the
    angle are smooth in that up to 180°, the other is less rounded where angles are small.
    """

    @intrinsic
    def add_cells(typing_context, directions, cells, count, weight, sums):
        return types.void(*[types.int64] * 5), _code

    def _code(context, builder, signature, arguments):
        directions, cells, count, weight, sums = arguments
        b = builder

        def at(base, offset, kind):
            return b.inttoptr(b.add(base, ir.Constant(_I64, offset)), kind.as_pointer())

        def spread(value):
            one = b.insert_element(ir.Constant(_WIDE, ir.Undefined), value, ir.IntType(32)(0))
            return b.shuffle_vector(one, one, ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES))

        def number(base, k):
            return spread(b.load(at(base, 4 * k, _FLOAT), align=4))

        def more(total, x, y):
            return b.fadd(total, b.fmul(x, y, flags=("contract",)), flags=("contract",))

        towards = [b.load(at(directions, 4 * LANES * k, _WIDE), align=4) for k in range(3)]
        terms, scale = [number(weight, k) for k in range(TERMS)], number(weight, TERMS)
        one = ir.Constant(_WIDE, [1.0] * LANES)
        initial = [b.load(at(sums, 4 * LANES * k, _WIDE), align=4) for k in range(4)]
        before, loop, after = b.block, b.append_basic_block("cell"), b.append_basic_block("done")
        b.branch(loop)

        b.position_at_end(loop)
        k = b.phi(_I64)
        running = [b.phi(_WIDE) for _ in range(4)]
        here = b.add(cells, b.mul(k, ir.Constant(_I64, _CELL)))
        cosine = b.fmul(towards[0], number(here, 0), flags=("contract",))
        for axis in (1, 2):
            cosine = more(cosine, towards[axis], number(here, axis))
        if wide:
            half = ir.Constant(_WIDE, [0.5] * LANES)
            square = b.fmul(b.fadd(one, cosine), half)
            square = b.select(b.fcmp_ordered(">", square, _NOTHING), square, _NOTHING)
            kind = ir.FunctionType(_WIDE, [_WIDE])
            root = cgutils.get_or_insert_function(b.module, kind, f"llvm.sqrt.v{LANES}f32")
            cosine = b.call(root, [square])
        t = b.fmul(b.fsub(one, cosine), scale)
        w = terms[-1]
        for term in terms[-2::-1]:
            w = more(term, w, t)
        for _ in range(HALVINGS):
            w = b.fmul(w, w)
        w = b.select(b.fcmp_ordered("<", t, one), w, _NOTHING)
        updated = [more(total, w, number(here, 4 + c)) for c, total in enumerate(running)]
        following = b.add(k, ir.Constant(_I64, 1))
        k.add_incoming(ir.Constant(_I64, 0), before)
        k.add_incoming(following, loop)
        for phi, start, value in zip(running, initial, updated, strict=True):
            phi.add_incoming(start, before)
            phi.add_incoming(value, loop)
        b.cbranch(b.icmp_signed("<", following, count), loop, after)

        b.position_at_end(after)
        for c, value in enumerate(updated):
            b.store(value, at(sums, 4 * LANES * c, _WIDE), align=4)
        return context.get_dummy_value()

    return add_cells
