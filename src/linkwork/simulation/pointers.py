"""Pointers: numbers in memory as compiled code sees them, by the address of the first.

Numba counts the references to arrays, with an atomic instruction at every turn, and hands each on
in seven words. The loops take what an array holds once, by `pointer`, and pass that: `p[i]` reads,
`p[i] = value` writes, `p + i` points i numbers further on. Nobody checks bounds, and the array has
to be kept alive by name for as long as it is pointed to.
"""

import operator
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, models, register_model

from linkwork.simulation.compiled import taught
from linkwork.simulation.tableaus import LANES


class Pointer(types.Type):
    """Type of a pointer to doubles."""

    def __init__(self):
        super().__init__(name="Pointer")


SUMS = 4  # vectors whose sums are computed together

POINTER = Pointer()
_DOUBLES = ir.DoubleType().as_pointer()
_VECTOR = ir.VectorType(ir.DoubleType(), LANES)


@register_model(Pointer)
class _PointerModel(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, _DOUBLES)


@taught(operator.getitem, types.float64, POINTER, types.intp)
def _read(context, builder, signature, values):
    return builder.load(builder.gep(values[0], [values[1]]))


@taught(operator.setitem, types.void, POINTER, types.intp, types.float64)
def _write(context, builder, signature, values):
    builder.store(values[2], builder.gep(values[0], [values[1]]))
    return context.get_dummy_value()


@taught(operator.add, POINTER, POINTER, types.intp)
def _further(context, builder, signature, values):
    return builder.gep(values[0], [values[1]])


def _pointer(typing_context, array):
    """Return the pointer to an array's first number; the array is contiguous."""

    def generate(context, builder, signature, values):
        return context.make_array(signature.args[0])(context, builder, value=values[0]).data

    return POINTER(array), generate


def _uncounted(typing_context, given):
    """Return an array, or a tuple of arrays and numbers, of which Numba counts no references; the
    arrays have to be kept alive by name."""

    def generate(context, builder, signature, values):
        return _without_owner(context, builder, given, values[0])

    return given(given), generate


def _without_owner(context, builder, kind: Any, value):
    """Return a value with no owner to be told of references to arrays in it."""
    if isinstance(kind, types.Array):
        array = context.make_array(kind)(context, builder, value=value)
        array.meminfo, array.parent = (
            ir.Constant(part.type, None) for part in (array.meminfo, array.parent)
        )
        return array._getvalue()
    parts: Any = kind if isinstance(kind, types.BaseTuple) else ()
    for i, part in enumerate(parts):
        own = _without_owner(context, builder, part, builder.extract_value(value, i))
        value = builder.insert_value(value, own, i)
    return value


def _call(typing_context, address, x, out):
    """Call the C function void(const double *x, double *out) at an address."""

    def generate(context, builder, signature, values):
        kernel = ir.FunctionType(ir.VoidType(), [_DOUBLES, _DOUBLES])
        builder.call(builder.inttoptr(values[0], kernel.as_pointer()), values[1:])
        return context.get_dummy_value()

    return types.void(types.intp, POINTER, POINTER), generate


def _combine(typing_context, weights, count, h, y, k, width, n, out):
    """Compute n numbers out = y + h sum_(j < count) weights_j k_j by vectors of LANES; the rows of
    k are `width` apart.

    y and the rows of k are padded to whole vectors; out is written up to n. Up to SUMS vectors are
    added up together: one sum would wait for its own last term each time.
    """

    def generate(context, builder, signature, values):
        n, whole = values[6], ir.Constant(values[6].type, LANES * SUMS)
        with cgutils.for_range_slice(builder, ir.Constant(n.type, 0), n, whole) as (m, _):
            up = builder.add(builder.sub(n, m), ir.Constant(n.type, LANES - 1))
            done, most = builder.append_basic_block("combined"), builder.append_basic_block("most")
            choice = builder.switch(builder.sdiv(up, ir.Constant(n.type, LANES)), most)
            for abreast in range(1, SUMS + 1):
                block = (
                    most if abreast == SUMS else builder.append_basic_block(f"abreast.{abreast}")
                )
                if block is not most:
                    choice.add_case(ir.Constant(n.type, abreast), block)
                with builder.goto_block(block):
                    _add_up(builder, values, m, abreast)
                    builder.branch(done)
            builder.position_at_end(done)
        return context.get_dummy_value()

    kinds = POINTER, types.intp, types.float64, POINTER, POINTER, types.intp, types.intp, POINTER
    return types.void(*kinds), generate


def _add_up(builder, values, m, abreast):
    """Combine so many vectors from the number m on; the last one may not be full."""
    # Sums of weight * row in registers, one for each of the vectors abreast.
    weights, count, h, y, k, width, n, out = values
    places = [builder.add(m, ir.Constant(m.type, i * LANES)) for i in range(abreast)]
    totals = [cgutils.alloca_once(builder, _VECTOR) for _ in places]
    for total in totals:
        builder.store(ir.Constant(_VECTOR, [0.0] * LANES), total)
    with cgutils.for_range(builder, count) as loop:
        weight, row = (
            _spread(builder, builder.load(builder.gep(weights, [loop.index]))),
            builder.mul(loop.index, width),
        )
        for place, total in zip(places, totals, strict=True):
            product = builder.fmul(
                weight, _numbers(builder, k, builder.add(row, place)), flags=["contract"]
            )
            builder.store(builder.fadd(builder.load(total), product, flags=["contract"]), total)
    # y + h sum, by fused multiply-add as the sums.
    changes = [
        builder.fmul(_spread(builder, h), builder.load(total), flags=["contract"])
        for total in totals
    ]
    states = [
        builder.fadd(_numbers(builder, y, place), change, flags=["contract"])
        for place, change in zip(places, changes, strict=True)
    ]
    for place, state in zip(places[:-1], states[:-1], strict=True):
        builder.store(state, _place(builder, out, place), align=8)
    # The last vector may be part of one: then number by number.
    left, last = builder.sub(n, places[-1]), builder.gep(out, [places[-1]])
    with builder.if_else(
        builder.icmp_signed(">=", left, ir.Constant(n.type, LANES)), likely=True
    ) as (full, part):
        with full:
            builder.store(states[-1], builder.bitcast(last, _VECTOR.as_pointer()), align=8)
        with part:
            rest = cgutils.alloca_once(builder, _VECTOR)
            builder.store(states[-1], rest)
            with cgutils.for_range(builder, left) as loop:
                number = builder.load(builder.gep(builder.bitcast(rest, _DOUBLES), [loop.index]))
                builder.store(number, builder.gep(last, [loop.index]))


def _numbers(builder, pointer, index):
    return builder.load(_place(builder, pointer, index), align=8)


def _place(builder, pointer, index):
    return builder.bitcast(builder.gep(pointer, [index]), _VECTOR.as_pointer())


def _spread(builder, number):
    single = builder.insert_element(
        ir.Constant(_VECTOR, ir.Undefined), number, ir.Constant(ir.IntType(32), 0)
    )
    return builder.shuffle_vector(
        single, single, ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
    )


pointer: Callable[..., Any] = intrinsic(_pointer)
uncounted: Callable[..., Any] = intrinsic(_uncounted)
call: Callable[..., None] = intrinsic(_call)
combine: Callable[..., None] = intrinsic(_combine)
