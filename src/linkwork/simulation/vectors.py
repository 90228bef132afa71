"""Vectors: a double for each lane, as values in compiled code; the lanes fill as many registers as wide kernels take.

Numba sees two more types, `Vector` and `Mask` (a truth value for each lane), with + - * /, <=, >=, & and | and the functions
below. They live in registers: two independent halves, say, so that one is computed while the
other waits. In memory tables hold them, a vector a row: arrays (rows, LANES), or the addresses of such,
of which Numba counts no references.
"""

import operator
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.imputils import lower_builtin
from numba.core.typing.templates import ConcreteTemplate, infer_global, signature
from numba.extending import intrinsic, models, register_model

from linkwork.kernels.emit import ABREAST
from linkwork.kernels.machine import this_machine

LANES = ABREAST * this_machine().lanes
FLAGS = ("contract",)


class Vector(types.Type):
    """Type of a double for each lane."""

    def __init__(self):
        super().__init__(name="Vector")


class Mask(types.Type):
    """Type of a truth value for each lane."""

    def __init__(self):
        super().__init__(name="Mask")


VECTOR, MASK = Vector(), Mask()
_NUMBERS, _BITS = ir.VectorType(ir.DoubleType(), LANES), ir.VectorType(ir.IntType(1), LANES)


@register_model(Vector)
class _VectorModel(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, _NUMBERS)


@register_model(Mask)
class _MaskModel(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, _BITS)


def _operator(
    python: Callable, result: types.Type, instruction: str, *arguments: str, kind: types.Type = VECTOR
) -> None:
    """Teach Numba one operator on two vectors, or two masks, by its LLVM instruction."""
    shape = signature(result, kind, kind)

    class Typing(ConcreteTemplate):
        cases = [shape]  # noqa: RUF012

    infer_global(python)(Typing)  # pyright: ignore[reportOptionalCall]

    @lower_builtin(python, kind, kind)
    def generate(context, builder, signature, values):
        flags = {"flags": FLAGS} if kind is VECTOR else {}
        return getattr(builder, instruction)(*arguments, *values, **flags)


_operator(operator.add, VECTOR, "fadd")
_operator(operator.sub, VECTOR, "fsub")
_operator(operator.mul, VECTOR, "fmul")
_operator(operator.truediv, VECTOR, "fdiv")
_operator(operator.le, MASK, "fcmp_ordered", "<=")
_operator(operator.ge, MASK, "fcmp_ordered", ">=")
_operator(operator.and_, MASK, "and_", kind=MASK)
_operator(operator.or_, MASK, "or_", kind=MASK)


def _row(context, builder, table_type, table, row):
    """Return the pointer to a vector in a table, an array (rows, LANES) or the address of one."""
    if isinstance(table_type, types.Array):
        table = _start(context, builder, table_type, table)
    place = builder.add(table, builder.mul(row, ir.Constant(row.type, 8 * LANES)))
    return builder.inttoptr(place, _NUMBERS.as_pointer())


def _start(context, builder, array_type, array):
    return builder.ptrtoint(context.make_array(array_type)(context, builder, value=array).data, ir.IntType(64))


def _address(typing_context, array):
    """Return the address of an array's first number."""

    def generate(context, builder, signature, values):
        return _start(context, builder, signature.args[0], values[0])

    return types.int64(array), generate


def _load(typing_context, table, row):
    """Return the vector in a row of a table."""

    def generate(context, builder, signature, values):
        return builder.load(_row(context, builder, signature.args[0], *values), align=8)

    return VECTOR(table, types.intp), generate


def _store(typing_context, table, row, vector):
    """Write a vector to a row of a table."""

    def generate(context, builder, signature, values):
        builder.store(values[2], _row(context, builder, signature.args[0], *values[:2]), align=8)
        return context.get_dummy_value()

    return types.void(table, types.intp, VECTOR), generate


def _splat(typing_context, number):
    """Return a vector of equal numbers."""

    def generate(context, builder, signature, values):
        single = builder.insert_element(ir.Constant(_NUMBERS, ir.Undefined), values[0], ir.Constant(ir.IntType(32), 0))
        first = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
        return builder.shuffle_vector(single, ir.Constant(_NUMBERS, ir.Undefined), first)

    return VECTOR(types.float64), generate


def _choose(typing_context, mask, where_true, where_false):
    """Return numbers of the one vector where the mask holds, else of the other."""

    def generate(context, builder, signature, values):
        return builder.select(*values)

    return VECTOR(MASK, VECTOR, VECTOR), generate


def _every(typing_context, mask):
    """Tell whether a mask holds in every lane."""
    return types.boolean(MASK), _compared("==", -1)


def _some(typing_context, mask):
    """Tell whether a mask holds in some lane."""
    return types.boolean(MASK), _compared("!=", 0)


def _compared(relation: str, pattern: int):
    def generate(context, builder, signature, values):
        bits = ir.IntType(LANES)
        return builder.icmp_unsigned(relation, builder.bitcast(values[0], bits), ir.Constant(bits, pattern))

    return generate


def _larger(typing_context, one, other):
    """Return the larger number in each lane; the other's where one of them is not a number."""

    def generate(context, builder, signature, values):
        return builder.select(builder.fcmp_ordered(">", *values), *values)

    return VECTOR(VECTOR, VECTOR), generate


def _smaller(typing_context, one, other):
    """Return the smaller number in each lane; the other's where one of them is not a number."""

    def generate(context, builder, signature, values):
        return builder.select(builder.fcmp_ordered("<", *values), *values)

    return VECTOR(VECTOR, VECTOR), generate


def _by_llvm(name: str):
    def typed(typing_context, vector):
        def generate(context, builder, signature, values):
            kind = ir.FunctionType(_NUMBERS, [_NUMBERS])
            function = cgutils.get_or_insert_function(builder.module, kind, f"llvm.{name}.v{LANES}f64")
            return builder.call(function, values, fastmath=FLAGS)

        return VECTOR(VECTOR), generate

    return typed


def _call_wide(typing_context, function, x, out, row):
    """Call the C function void(const double *x, double *out) for all lanes, its output from row `row` on."""

    def generate(context, builder, signature, values):
        first = ir.Constant(values[3].type, 0)
        source = _row(context, builder, signature.args[1], values[1], first)
        target = _row(context, builder, signature.args[2], *values[2:])
        kernel = ir.FunctionType(ir.VoidType(), [source.type, target.type])
        builder.call(builder.inttoptr(values[0], kernel.as_pointer()), [source, target])
        return context.get_dummy_value()

    return types.void(types.intp, x, out, types.intp), generate


address: Callable[..., int] = intrinsic(_address)
load: Callable[..., Any] = intrinsic(_load)
store: Callable[..., None] = intrinsic(_store)
splat: Callable[..., Any] = intrinsic(_splat)
choose: Callable[..., Any] = intrinsic(_choose)
every: Callable[..., bool] = intrinsic(_every)
some: Callable[..., bool] = intrinsic(_some)
larger: Callable[..., Any] = intrinsic(_larger)
smaller: Callable[..., Any] = intrinsic(_smaller)
absolute: Callable[..., Any] = intrinsic(_by_llvm("fabs"))
root: Callable[..., Any] = intrinsic(_by_llvm("sqrt"))
call_wide: Callable[..., None] = intrinsic(_call_wide)
