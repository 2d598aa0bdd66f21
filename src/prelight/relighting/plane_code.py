"""One block of byte planes times their weights, as vector instructions (for the reason, see ``vector_code.py``)."""

from __future__ import annotations

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from ..encoding.byte_planes import BLOCK

_I8, _I32, _I64, _F32 = ir.IntType(8), ir.IntType(32), ir.IntType(64), ir.FloatType()
_ASK = ir.FunctionType(ir.VoidType(), [_I8.as_pointer(), _I32, _I32, _I32])
_PART = 16  # pixels that are interleaved at a time


@intrinsic
def plane_product(typing_context, block, scales, index, weights, count, ahead, sums):  # noqa: PLR0913 - addresses
    """sums[i] = Σ_n weights[n] · scales[index[n]] · block[index[n]][i] for the 64 values of a block.

    Addresses of ``block`` (planes, 64) int8, ``scales`` (planes,) and ``weights`` (count,) float32, ``index`` (count,)
    int32, ``sums`` (64,) float32; ``count`` at least 1. Each plane so many bytes ``ahead`` is asked for besides: the
    processor's own guess of what is read next ends at every page of memory.
    """
    signature = types.void(*[types.int64] * 7)

    def code(context, b, signature, arguments):
        block, scales, index, weights, count, ahead, sums = arguments
        floats, bytes_ = ir.VectorType(_F32, BLOCK), ir.VectorType(_I8, BLOCK)
        lanes = ir.Constant(ir.VectorType(_I32, BLOCK), [0] * BLOCK)
        nothing = ir.Constant(floats, ir.Undefined)

        def at(base, number, width, kind):
            return b.inttoptr(b.add(base, b.mul(number, ir.Constant(_I64, width))), kind.as_pointer())

        ask = cgutils.get_or_insert_function(b.module, _ASK, "llvm.prefetch.p0")
        before, loop, after = b.block, b.append_basic_block("plane"), b.append_basic_block("done")
        b.branch(loop)
        b.position_at_end(loop)
        n = b.phi(_I64)
        running = b.phi(floats)
        plane = b.zext(b.load(at(index, n, 4, _I32), align=4), _I64)
        weight = b.load(at(weights, n, 4, _F32), align=4)
        weight = b.fmul(weight, b.load(at(scales, plane, 4, _F32), align=4))
        soon = b.add(ahead, b.mul(plane, ir.Constant(_I64, BLOCK)))
        b.call(ask, [b.inttoptr(b.add(block, soon), _I8.as_pointer()), _I32(0), _I32(3), _I32(1)])
        values = b.sitofp(b.load(at(block, plane, BLOCK, bytes_), align=1), floats)
        spread = b.shuffle_vector(b.insert_element(nothing, weight, ir.Constant(_I32, 0)), nothing, lanes)
        term = b.fmul(values, spread, flags=("contract",))
        updated = b.fadd(running, term, flags=("contract",))
        following = b.add(n, ir.Constant(_I64, 1))
        n.add_incoming(ir.Constant(_I64, 0), before)
        n.add_incoming(following, loop)
        running.add_incoming(ir.Constant(floats, [0.0] * BLOCK), before)
        running.add_incoming(updated, loop)
        b.cbranch(b.icmp_signed("<", following, count), loop, after)
        b.position_at_end(after)
        b.store(updated, b.inttoptr(sums, floats.as_pointer()), align=4)
        return context.get_dummy_value()

    return signature, code


@intrinsic
def write_block(typing_context, sums, picture, adds):
    """picture[i, c] = sums[c, i], or += where ``adds``, of a block's 64 pixels.

    Addresses of ``sums`` (3, 64) and ``picture`` (64, 3) float32. One value after the other takes as long as the sums.
    """
    signature = types.void(types.int64, types.int64, types.boolean)

    def code(context, b, signature, arguments):
        sums, picture, adds = arguments
        with b.if_else(adds) as (more, anew):
            with more:
                _interleave(b, sums, picture, adds=True)
            with anew:
                _interleave(b, sums, picture, adds=False)
        return context.get_dummy_value()

    return signature, code


def _interleave(b: ir.IRBuilder, sums: ir.Value, picture: ir.Value, *, adds: bool) -> None:
    vector = ir.VectorType(_F32, _PART)

    def at(base: ir.Value, number: int) -> ir.Value:
        return b.inttoptr(b.add(base, ir.Constant(_I64, 4 * number)), vector.as_pointer())

    def chosen(first: ir.Value, second: ir.Value, places: list[int]) -> ir.Value:
        return b.shuffle_vector(first, second, ir.Constant(ir.VectorType(_I32, _PART), places))

    for first in range(0, BLOCK, _PART):
        red, green, blue = (b.load(at(sums, c * BLOCK + first), align=4) for c in range(3))
        for third in range(3):
            of = [divmod(third * _PART + k, 3) for k in range(_PART)]  # pixel, channel
            two = chosen(red, green, [pixel + _PART * (c == 1) for pixel, c in of])
            values = chosen(two, blue, [_PART + pixel if c == 2 else k for k, (pixel, c) in enumerate(of)])
            place = at(picture, 3 * first + third * _PART)
            b.store(b.fadd(values, b.load(place, align=4)) if adds else values, place, align=4)
