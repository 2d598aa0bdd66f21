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
_ROW_AHEAD = 256  # bytes: eight groups
_BYTES = {"i8": 1, "float": 4, "double": 8}


def tile_product(element: ir.Type, *, colours: int, source: ir.Type = _I8, signed: bool = False) -> Callable:
    """An intrinsic ``product(tile, index, weights, count, sums)`` of five addresses and numbers.

    Adds, for each of ``colours`` (3, or the one whose weight is first) and all 32 receivers i of the tile,
    sums[c][i] += Σ_n weights[n][c] · tile[index[n]][i], n = 0 … count − 1.
    ``tile`` is (clusters, 32 receivers) of ``source``, uint8 (int8 if ``signed``) or ``element``, ``index`` int32,
    ``weights`` (count, 3) and ``sums`` (colours, 32) of ``element``; all C-contiguous, given as addresses; ``count``
    at least 1.
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
        if source == _I8:
            T = b.sitofp(T, vector) if signed else b.uitofp(T, vector)
        first_weight = b.mul(n, ir.Constant(_I64, 3 * width))
        updated = []
        for c in range(colours):
            place = at(weights, b.add(first_weight, ir.Constant(_I64, c * width)), element)
            term = b.fmul(T, _spread(b, b.load(place, align=width), vector), flags=("contract",))
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
def column_product(typing_context, rows, shift, weights, count, sums):
    """sums[i] += Σ_n weights[3n] · row_n[i], i = 0 … 31, n = 0 … count − 1, row_n at the address rows[n] + shift.

    ``rows`` int64, ``weights`` and ``sums`` float64, the rows uint8; all given as addresses; ``count`` at least 1.
    """

    def code(context, builder, signature, arguments):
        rows, shift, weights, count, sums = arguments
        b, element = builder, ir.DoubleType()
        vector = ir.VectorType(element, GROUP)

        def at(address, kind):
            return b.inttoptr(address, kind.as_pointer())

        initial = b.load(at(sums, vector), align=8)
        before, loop, after = b.block, b.append_basic_block("cluster"), b.append_basic_block("done")
        b.branch(loop)

        b.position_at_end(loop)
        n, running = b.phi(_I64), b.phi(vector)
        row = b.add(b.load(at(b.add(rows, b.shl(n, ir.Constant(_I64, 3))), _I64), align=8), shift)
        _ask_for(b, b.add(row, ir.Constant(_I64, _ROW_AHEAD)))
        T = b.uitofp(b.load(at(row, ir.VectorType(_I8, GROUP)), align=1), vector)
        weight = b.load(at(b.add(weights, b.mul(n, ir.Constant(_I64, 24))), element), align=8)
        updated = b.fadd(
            running, b.fmul(T, _spread(b, weight, vector), flags=("contract",)), flags=("contract",)
        )
        following = b.add(n, ir.Constant(_I64, 1))
        n.add_incoming(ir.Constant(_I64, 0), before)
        n.add_incoming(following, loop)
        running.add_incoming(initial, before)
        running.add_incoming(updated, loop)
        b.cbranch(b.icmp_signed("<", following, count), loop, after)

        b.position_at_end(after)
        b.store(updated, at(sums, vector), align=8)
        return context.get_dummy_value()

    kind = types.int64
    return types.void(kind, kind, kind, kind, kind), code


@intrinsic
def copy_quad(typing_context, source, target, stride):
    """Four rows of 32 bytes at an address, written at four others; zeros where the first is 0."""

    def code(context, builder, signature, arguments):
        b, (source, target, stride) = builder, arguments
        kind = ir.VectorType(_I8, GROUP)
        is_there = b.icmp_unsigned("!=", source, ir.Constant(_I64, 0))
        places = [target]
        for _ in range(3):
            places.append(b.add(places[-1], stride))
        with b.if_else(is_there) as (there, nowhere):
            with there:
                for n, place in enumerate(places):
                    row = b.inttoptr(b.add(source, ir.Constant(_I64, n * GROUP)), kind.as_pointer())
                    b.store(b.load(row, align=1), b.inttoptr(place, kind.as_pointer()), align=1)
            with nowhere:
                for place in places:
                    b.store(ir.Constant(kind, [0] * GROUP), b.inttoptr(place, kind.as_pointer()), align=1)
        return context.get_dummy_value()

    return types.void(types.int64, types.int64, types.int64), code


def _spread(builder: ir.IRBuilder, scalar: ir.Value, vector: ir.VectorType) -> ir.Value:
    one = builder.insert_element(ir.Constant(vector, ir.Undefined), scalar, ir.Constant(_I32, 0))
    lanes = ir.Constant(ir.VectorType(_I32, vector.count), [0] * vector.count)
    return builder.shuffle_vector(one, ir.Constant(vector, ir.Undefined), lanes)


def _ask_for(builder: ir.IRBuilder, address: ir.Value) -> None:
    pointer = _I8.as_pointer()
    kind = ir.FunctionType(ir.VoidType(), [pointer, _I32, _I32, _I32])
    ask = cgutils.get_or_insert_function(builder.module, kind, "llvm.prefetch.p0")
    builder.call(ask, [builder.inttoptr(address, pointer), _I32(0), _I32(3), _I32(1)])  # read, keep, data


@intrinsic
def prefetch(typing_context, address):
    """Ask memory for the cache line at an address that is needed soon."""

    def code(context, builder, signature, arguments):
        _ask_for(builder, arguments[0])
        return context.get_dummy_value()

    return types.void(types.int64), code


@intrinsic
def count_bits(typing_context, bits):
    """How many bits of a whole number are set."""

    def code(context, builder, signature, arguments):
        return builder.ctpop(arguments[0])

    return types.int64(types.int64), code
