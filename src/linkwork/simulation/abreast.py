"""Abreast: one source of compiled code for one state, and for states side by side in lanes.

The numbers of one state are behind a `Pointer`, those of LANES states behind `Rows`: there `p[i]`
is a `Vector`, `p + i` points i rows further on, and `p[i] = number` fills a row. The functions at
the end do in each lane what they do with a number.
"""

import math
import operator
from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic, models, overload, register_model

from linkwork.simulation.compiled import taught
from linkwork.simulation.vectors import (
    FLAGS,
    LANES,
    MASK,
    VECTOR,
    absolute,
    choose,
    smaller,
    some,
    splat,
)

ALIGNED = 64  # bytes


class RowPointer(types.Type):
    """Type of a pointer to rows of LANES doubles."""

    def __init__(self):
        super().__init__(name="Rows")


ROWS = RowPointer()
_NUMBERS = ir.VectorType(ir.DoubleType(), LANES)


@register_model(RowPointer)
class _RowsModel(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, _NUMBERS.as_pointer())


@taught(operator.getitem, VECTOR, ROWS, types.intp)
def _read(context, builder, signature, values):
    return builder.load(builder.gep(values[0], [values[1]]), align=8)


@taught(operator.setitem, types.void, ROWS, types.intp, VECTOR)
def _write(context, builder, signature, values):
    builder.store(values[2], builder.gep(values[0], [values[1]]), align=8)
    return context.get_dummy_value()


@taught(operator.setitem, types.void, ROWS, types.intp, types.float64)
def _fill(context, builder, signature, values):
    builder.store(_spread(builder, values[2]), builder.gep(values[0], [values[1]]), align=8)
    return context.get_dummy_value()


@taught(operator.add, ROWS, ROWS, types.intp)
def _further(context, builder, signature, values):
    return builder.gep(values[0], [values[1]])


@taught(operator.neg, VECTOR, VECTOR)
def _negative(context, builder, signature, values):
    return builder.fneg(values[0])


def _in_place(python: Callable, instruction: str) -> None:
    """Teach Numba an operator that stands for `x = x . y` on vectors."""

    @taught(python, VECTOR, VECTOR, VECTOR)
    def generate(context, builder, signature, values):
        return getattr(builder, instruction)(*values, flags=FLAGS)


_in_place(operator.iadd, "fadd")
_in_place(operator.isub, "fsub")
_in_place(operator.itruediv, "fdiv")


@taught(operator.truediv, VECTOR, VECTOR, types.float64)
def _over(context, builder, signature, values):
    return builder.fdiv(values[0], _spread(builder, values[1]))


@taught(operator.itruediv, VECTOR, VECTOR, types.float64)
def _over_in_place(context, builder, signature, values):
    return _over(context, builder, signature, values)


@taught(operator.mul, VECTOR, types.float64, VECTOR)
def _times(context, builder, signature, values):
    return builder.fmul(_spread(builder, values[0]), values[1], flags=FLAGS)


@taught(operator.truediv, VECTOR, types.float64, VECTOR)
def _of_number(context, builder, signature, values):
    return builder.fdiv(_spread(builder, values[0]), values[1])


def _spread(builder, number):
    undefined = ir.Constant(_NUMBERS, ir.Undefined)
    first = builder.insert_element(undefined, number, ir.Constant(ir.IntType(32), 0))
    everywhere = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
    return builder.shuffle_vector(first, undefined, everywhere)


def _differs(typing_context, vector, number):
    """Tell in which lanes a vector is not a number."""

    def generate(context, builder, signature, values):
        return builder.fcmp_unordered("!=", values[0], _spread(builder, values[1]))

    return MASK(VECTOR, types.float64), generate


def _within(typing_context, array, like):
    """Return the pointer to the first aligned number of an array, of the kind of another pointer;
    the array has to be kept alive by name."""

    def generate(context, builder, signature, values):
        data = context.make_array(signature.args[0])(context, builder, value=values[0]).data
        address = ir.IntType(64)
        up = builder.add(builder.ptrtoint(data, address), ir.Constant(address, ALIGNED - 1))
        place = builder.and_(up, ir.Constant(address, -ALIGNED))
        return builder.inttoptr(place, context.get_value_type(signature.return_type))

    return like(array, like), generate


def _beside(typing_context, numbers):
    """Return the numbers behind a `Pointer`, of which the first is aligned, as `Rows`."""

    def generate(context, builder, signature, values):
        return builder.bitcast(values[0], _NUMBERS.as_pointer())

    return ROWS(numbers), generate


def _evaluate(typing_context, address, x, out):
    """Call the C function void(const double *x, double *out) at an address, that of one state or
    that of states side by side."""

    def generate(context, builder, signature, values):
        kernel = ir.FunctionType(ir.VoidType(), [value.type for value in values[1:]])
        builder.call(builder.inttoptr(values[0], kernel.as_pointer()), values[1:])
        return context.get_dummy_value()

    return types.void(types.intp, x, out), generate


differs: Callable[..., Any] = intrinsic(_differs)
within: Callable[..., Any] = intrinsic(_within)
beside: Callable[..., Any] = intrinsic(_beside)
evaluate: Callable[..., None] = intrinsic(_evaluate)


def room(rows: int, like: Any) -> Any:
    """Return an array in which `within` finds so many numbers of the kind behind a pointer."""
    raise NotImplementedError("compiled code alone asks this")


@overload(room)
def _room(rows, like):
    width = LANES if like is ROWS else 1
    return lambda rows, like: np.empty(rows * width + ALIGNED // 8)


def zero(like: Any) -> Any:
    """Return zero, of the kind behind a pointer."""
    raise NotImplementedError("compiled code alone asks this")


@overload(zero)
def _zero(like):
    if like is ROWS:
        return lambda like: splat(0.0)
    return lambda like: 0.0


def matters(factor: Any) -> bool:
    """Tell whether a number is not zero, in any lane."""
    raise NotImplementedError("compiled code alone asks this")


@overload(matters)
def _matters(factor):
    if factor is VECTOR:
        return lambda factor: some(differs(factor, 0.0))
    return lambda factor: factor != 0


def weaker(one: Any, other: Any) -> Any:
    """Return the smaller size of two pivots, negative where one of them is."""
    raise NotImplementedError("compiled code alone asks this")


@overload(weaker)
def _weaker(one, other):
    def of_vectors(one, other):
        least = smaller(absolute(one), absolute(other))
        return choose(smaller(one, other) >= splat(0.0), least, -least)

    def of_numbers(one, other):
        return math.copysign(min(abs(one), abs(other)), min(one, other))

    return of_vectors if one is VECTOR else of_numbers


def bounded(size: Any, bound: float, x: Any) -> Any:
    """Return x where a size is below a bound, infinity elsewhere."""
    raise NotImplementedError("compiled code alone asks this")


@overload(bounded)
def _bounded(size, bound, x):
    if x is VECTOR:
        return lambda size, bound, x: choose(size <= splat(bound), x, splat(math.inf))
    return lambda size, bound, x: x if size <= bound else math.inf
