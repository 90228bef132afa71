"""Vectors: a double for each lane, as values in compiled code; the lanes fill as many registers as
wide kernels take.

Numba sees two more types, `Vector` and `Mask` (a truth value for each lane), with + - * /, <=, >=,
& and | and the functions below. They live in registers: two independent halves, say, so that one is
computed while the other waits. In memory they are rows of a `LaneTable`, the address of an array of
which Numba counts no references and checks no indices.
"""

import operator
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, models, register_model

from linkwork.kernels.emit import ABREAST
from linkwork.kernels.machine import this_machine
from linkwork.simulation.compiled import taught

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


class LaneTable(types.Type):
    """Type of rows of LANES doubles in memory, by the address of the first: t[row, lane] reads and
    writes a number."""

    def __init__(self):
        super().__init__(name="Table")


class CountTable(types.Type):
    """Type of rows of LANES whole numbers in memory, as `LaneTable`."""

    def __init__(self):
        super().__init__(name="CountTable")


VECTOR, MASK, TABLE, COUNT_TABLE = Vector(), Mask(), LaneTable(), CountTable()
_NUMBERS, _BITS = ir.VectorType(ir.DoubleType(), LANES), ir.VectorType(ir.IntType(1), LANES)


@register_model(Vector)
class _VectorModel(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, _NUMBERS)


@register_model(Mask)
class _MaskModel(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, _BITS)


@register_model(LaneTable)
@register_model(CountTable)
class _TableModel(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, ir.IntType(64))


def _instruction(
    python: Callable,
    result: types.Type,
    instruction: str,
    *arguments: str,
    kind: types.Type = VECTOR,
) -> None:
    """Teach Numba one operator on two vectors, or two masks, by its LLVM instruction."""

    @taught(python, result, kind, kind)
    def generate(context, builder, signature, values):
        flags = {"flags": FLAGS} if kind is VECTOR else {}
        return getattr(builder, instruction)(*arguments, *values, **flags)


_instruction(operator.add, VECTOR, "fadd")
_instruction(operator.sub, VECTOR, "fsub")
_instruction(operator.mul, VECTOR, "fmul")
_instruction(operator.truediv, VECTOR, "fdiv")
_instruction(operator.le, MASK, "fcmp_ordered", "<=")
_instruction(operator.ge, MASK, "fcmp_ordered", ">=")
_instruction(operator.and_, MASK, "and_", kind=MASK)
_instruction(operator.or_, MASK, "or_", kind=MASK)


_PLACE = types.UniTuple(types.intp, 2)


@taught(operator.getitem, types.float64, TABLE, _PLACE)
@taught(operator.getitem, types.intp, COUNT_TABLE, _PLACE)
def _read(context, builder, signature, values):
    return builder.load(_number(context, builder, signature.return_type, *values))


@taught(operator.setitem, types.void, TABLE, _PLACE, types.float64)
@taught(operator.setitem, types.void, COUNT_TABLE, _PLACE, types.intp)
def _write(context, builder, signature, values):
    builder.store(values[2], _number(context, builder, signature.args[2], *values[:2]))
    return context.get_dummy_value()


def _number(context, builder, kind, table, place):
    """Return the pointer to a number, of a kind, in a table."""
    row, lane = (builder.extract_value(place, i) for i in range(2))
    index = builder.add(builder.mul(row, ir.Constant(row.type, LANES)), lane)
    number = context.get_value_type(kind)
    return builder.gep(builder.inttoptr(table, number.as_pointer()), [index])


def _row(builder, table, row):
    """Return the pointer to a vector in a table."""
    place = builder.add(table, builder.mul(row, ir.Constant(row.type, 8 * LANES)))
    return builder.inttoptr(place, _NUMBERS.as_pointer())


def _as_table(typing_context, array):
    """Return an array (rows, LANES) as a `LaneTable`, or one of whole numbers as a `CountTable`;
    the array has to be kept alive by name."""

    def generate(context, builder, signature, values):
        data = context.make_array(signature.args[0])(context, builder, value=values[0]).data
        return builder.ptrtoint(data, ir.IntType(64))

    return (COUNT_TABLE if array.dtype == types.intp else TABLE)(array), generate


def _load(typing_context, table, row):
    """Return the vector in a row of a table."""

    def generate(context, builder, signature, values):
        return builder.load(_row(builder, *values), align=8)

    return VECTOR(table, types.intp), generate


def _store(typing_context, table, row, vector):
    """Write a vector to a row of a table."""

    def generate(context, builder, signature, values):
        builder.store(values[2], _row(builder, *values[:2]), align=8)
        return context.get_dummy_value()

    return types.void(table, types.intp, VECTOR), generate


def _splat(typing_context, number):
    """Return a vector of equal numbers."""

    def generate(context, builder, signature, values):
        single = builder.insert_element(
            ir.Constant(_NUMBERS, ir.Undefined), values[0], ir.Constant(ir.IntType(32), 0)
        )
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
        return builder.icmp_unsigned(
            relation, builder.bitcast(values[0], bits), ir.Constant(bits, pattern)
        )

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
            function = cgutils.get_or_insert_function(
                builder.module, kind, f"llvm.{name}.v{LANES}f64"
            )
            return builder.call(function, values, fastmath=FLAGS)

        return VECTOR(VECTOR), generate

    return typed


def _call_wide(typing_context, function, x, out, row):
    """Call the C function void(const double *x, double *out) for all lanes, its output from row
    `row` on."""

    def generate(context, builder, signature, values):
        first = ir.Constant(values[3].type, 0)
        source, target = _row(builder, values[1], first), _row(builder, *values[2:])
        kernel = ir.FunctionType(ir.VoidType(), [source.type, target.type])
        builder.call(builder.inttoptr(values[0], kernel.as_pointer()), [source, target])
        return context.get_dummy_value()

    return types.void(types.intp, x, out, types.intp), generate


as_table: Callable[..., Any] = intrinsic(_as_table)
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
