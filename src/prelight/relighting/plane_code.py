"""One block of byte planes times their weights, as vector instructions (for the reason, see ``vector_code.py``)."""

from __future__ import annotations

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from ..encoding.byte_planes import BLOCK

_I8, _I32, _I64, _F32 = ir.IntType(8), ir.IntType(32), ir.IntType(64), ir.FloatType()


@intrinsic
def plane_product(typing_context, block, scales, index, weights, count, sums):
    """sums[i] = Σ_n weights[n] · scales[index[n]] · block[index[n]][i] for the 64 values of a block.

    Addresses of ``block`` (planes, 64) int8, ``scales`` (planes,) and ``weights`` (count,) float32, ``index`` (count,)
    int32, ``sums`` (64,) float32; ``count`` at least 1.
    """
    signature = types.void(*[types.int64] * 6)

    def code(context, b, signature, arguments):
        block, scales, index, weights, count, sums = arguments
        floats, bytes_ = ir.VectorType(_F32, BLOCK), ir.VectorType(_I8, BLOCK)
        lanes = ir.Constant(ir.VectorType(_I32, BLOCK), [0] * BLOCK)
        nothing = ir.Constant(floats, ir.Undefined)

        def at(base, number, width, kind):
            return b.inttoptr(b.add(base, b.mul(number, ir.Constant(_I64, width))), kind.as_pointer())

        before, loop, after = b.block, b.append_basic_block("plane"), b.append_basic_block("done")
        b.branch(loop)
        b.position_at_end(loop)
        n = b.phi(_I64)
        running = b.phi(floats)
        plane = b.zext(b.load(at(index, n, 4, _I32), align=4), _I64)
        weight = b.load(at(weights, n, 4, _F32), align=4)
        weight = b.fmul(weight, b.load(at(scales, plane, 4, _F32), align=4))
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
