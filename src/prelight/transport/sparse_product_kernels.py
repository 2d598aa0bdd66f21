"""Rows of a sparse matrix times a few columns of light, with the sums of a row in registers.

Numba leaves such sums in memory, at two to four times the time: as one vector of LLVM's they are kept where they
are used, on any processor.
"""

from __future__ import annotations

from collections.abc import Callable

from llvmlite import ir
from numba import njit, prange, types
from numba.extending import intrinsic

WIDTHS = (32, 16)  # columns multiplied together: vectors of two or one cache line
_ROWS = 64  # a task
_I32, _I64, _FLOAT = ir.IntType(32), ir.IntType(64), ir.FloatType()


def _row_product(width: int) -> Callable:
    """An intrinsic ``product(columns, values, count, B, out)`` of four addresses and a number.

    out[:] = Σ_e values[e] · B[columns[e]], e = 0 … count − 1, in that order: columns int32, values float32,
    B (…, width) and out (width,) float32, all contiguous.
    """
    vector = ir.VectorType(_FLOAT, width)
    zero = ir.Constant(vector, [0.0] * width)

    @intrinsic
    def product(typing_context, columns, values, count, B, out):
        return types.void(*[types.int64] * 5), _code

    def _code(context, builder, signature, arguments):
        columns, values, count, B, out = arguments
        b = builder

        def load(base, index, kind, size):
            place = b.add(base, b.mul(index, ir.Constant(_I64, size)))
            return b.load(b.inttoptr(place, kind.as_pointer()), align=4)

        before, loop, after = b.block, b.append_basic_block("entry"), b.append_basic_block("done")
        b.cbranch(b.icmp_signed(">", count, ir.Constant(_I64, 0)), loop, after)
        b.position_at_end(loop)
        e, running = b.phi(_I64), b.phi(vector)
        row = load(B, b.zext(load(columns, e, _I32, 4), _I64), vector, 4 * width)
        one = b.insert_element(ir.Constant(vector, ir.Undefined), load(values, e, _FLOAT, 4), _I32(0))
        value = b.shuffle_vector(one, one, ir.Constant(ir.VectorType(_I32, width), [0] * width))
        term = b.fmul(value, row, flags=("contract",))
        updated = b.fadd(running, term, flags=("contract",))
        following = b.add(e, ir.Constant(_I64, 1))
        e.add_incoming(ir.Constant(_I64, 0), before)
        e.add_incoming(following, loop)
        running.add_incoming(zero, before)
        running.add_incoming(updated, loop)
        b.cbranch(b.icmp_signed("<", following, count), loop, after)

        b.position_at_end(after)
        total = b.phi(vector)
        total.add_incoming(zero, before)
        total.add_incoming(updated, loop)
        b.store(total, b.inttoptr(out, vector.as_pointer()), align=4)
        return context.get_dummy_value()

    return product


_product_of_32, _product_of_16 = (_row_product(width) for width in WIDTHS)


@njit(cache=True)
def _multiply_rows(starts, columns, values, B, out, first, last):
    width = out.shape[1]
    for row in range(first, last):
        start, count = starts[row], starts[row + 1] - starts[row]
        at, by = columns.ctypes.data + 4 * start, values.ctypes.data + 4 * start
        if width == 32:
            _product_of_32(at, by, count, B.ctypes.data, out.ctypes.data + 128 * row)
        else:
            _product_of_16(at, by, count, B.ctypes.data, out.ctypes.data + 64 * row)


@njit(
    [
        types.void(
            types.Array(types.int64, 1, "C", readonly=True),
            types.Array(types.int32, 1, "C", readonly=True),
            types.Array(types.float32, 1, "C", readonly=True),
            types.Array(types.float32, 2, "C", readonly=True),
            types.float32[:, ::1],
        )
    ],
    parallel=True,
    cache=True,
)
def multiply_block(starts, columns, values, B, out):
    """out = M B, written: rows of M begin at starts (rows + 1,) in columns and values (entries,).

    B (vertices, width) and out (rows, width), width 32 or 16. One thread sums a row, in the order of its entries.
    """
    for block in prange((len(out) + _ROWS - 1) // _ROWS):
        _multiply_rows(starts, columns, values, B, out, block * _ROWS, min(len(out), (block + 1) * _ROWS))
