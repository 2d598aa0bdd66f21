"""One tile times its weights, as vector instructions.

Numba leaves the sums of this product in memory, at a third of the speed: written in LLVM's own vector
types they stay in registers on any processor, and the product runs as fast as memory is read.
"""

from __future__ import annotations

from collections.abc import Callable

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from ..encoding.sparse_tiles import GROUP

_I8, _I32, _I64 = ir.IntType(8), ir.IntType(32), ir.IntType(64)
_BYTES = {"i8": 1, "float": 4, "double": 8}


def tile_product(element: ir.Type, *, colours: int, source: ir.Type = _I8) -> Callable:
    """An intrinsic ``product(tile, index, weights, count, sums)`` of five addresses and numbers.

    Adds, for each of ``colours`` (3, or the one whose weight is first) and all 32 receivers i of the tile,
    sums[c][i] += Σ_n weights[n][c] · tile[index[n]][i], n = 0 … count − 1.
    ``tile`` is (clusters, 32 receivers) of ``source``, uint8 or ``element``, ``index`` int32, ``weights`` (count, 3)
    and ``sums`` (colours, 32) of ``element``; all C-contiguous, given as addresses; ``count`` at least 1.
    """

    @intrinsic
    def product(typing_context, tile, index, weights, count, sums):
        signature = types.void(types.int64, types.int64, types.int64, types.int64, types.int64)
        return signature, _code

    def _code(context, builder, signature, arguments):
        tile, index, weights, count, sums = arguments
        vector, width = ir.VectorType(element, GROUP), _BYTES[str(element)]
        row_bytes = GROUP * _BYTES.get(str(source), 1)
        b = builder

        def at(base, offset, kind):
            return b.inttoptr(b.add(base, offset), kind.as_pointer())

        def spread(scalar):
            one = b.insert_element(ir.Constant(vector, ir.Undefined), scalar, ir.Constant(_I32, 0))
            lanes = ir.Constant(ir.VectorType(_I32, GROUP), [0] * GROUP)
            return b.shuffle_vector(one, ir.Constant(vector, ir.Undefined), lanes)

        places = [at(sums, ir.Constant(_I64, c * GROUP * width), vector) for c in range(colours)]
        initial = [b.load(place, align=width) for place in places]
        before, loop, after = b.block, b.append_basic_block("cluster"), b.append_basic_block("done")
        b.branch(loop)

        b.position_at_end(loop)
        n = b.phi(_I64)
        running = [b.phi(vector) for _ in range(colours)]
        row = b.zext(b.load(at(index, b.shl(n, ir.Constant(_I64, 2)), _I32), align=4), _I64)
        row_at = at(tile, b.mul(row, ir.Constant(_I64, row_bytes)), ir.VectorType(source, GROUP))
        T = b.load(row_at, align=1)
        T = b.uitofp(T, vector) if source == _I8 else T
        first_weight = b.mul(n, ir.Constant(_I64, 3 * width))
        updated = []
        for c in range(colours):
            place = at(weights, b.add(first_weight, ir.Constant(_I64, c * width)), element)
            term = b.fmul(T, spread(b.load(place, align=width)), flags=("contract",))
            updated.append(b.fadd(running[c], term, flags=("contract",)))
        following = b.add(n, ir.Constant(_I64, 1))
        n.add_incoming(ir.Constant(_I64, 0), before)
        n.add_incoming(following, loop)
        for phi, start, value in zip(running, initial, updated, strict=True):
            phi.add_incoming(start, before)
            phi.add_incoming(value, loop)
        b.cbranch(b.icmp_signed("<", following, count), loop, after)

        b.position_at_end(after)
        for place, value in zip(places, updated, strict=True):
            b.store(value, place, align=width)
        return context.get_dummy_value()

    return product


@intrinsic
def prefetch(typing_context, address):
    """Ask memory for the cache line at an address that is needed soon."""

    def code(context, builder, signature, arguments):
        pointer = _I8.as_pointer()
        kind = ir.FunctionType(ir.VoidType(), [pointer, _I32, _I32, _I32])
        ask = cgutils.get_or_insert_function(builder.module, kind, "llvm.prefetch.p0")
        builder.call(
            ask, [builder.inttoptr(arguments[0], pointer), _I32(0), _I32(3), _I32(1)]
        )  # read, keep, data
        return context.get_dummy_value()

    return types.void(types.int64), code


@intrinsic
def count_bits(typing_context, bits):
    """How many bits of a whole number are set."""

    def code(context, builder, signature, arguments):
        return builder.ctpop(arguments[0])

    return types.int64(types.int64), code
