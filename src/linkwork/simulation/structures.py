"""Structures in memory that compiled code reads and writes by the names of their fields.

A class with annotations says what the fields are: `int`, `float`, `Any` for a pointer, or a named
tuple of those, which is held as a whole. Functions hand on a structure by its address, one word,
however much it holds.
"""

from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.core.imputils import lower_getattr_generic, lower_setattr_generic
from numba.core.typing.templates import AttributeTemplate, infer_getattr
from numba.extending import intrinsic, models, register_model

from linkwork.simulation.pointers import POINTER

_KINDS = {int: types.intp, float: types.float64, Any: POINTER}


class Structure(types.Type):
    """Type of a structure, of so many `words`, with the fields that a class describes by its
    annotations."""

    def __init__(self, layout: type):
        self.fields = {name: numba_type(kind) for name, kind in layout.__annotations__.items()}
        self.words = sum(getattr(kind, "count", 1) for kind in self.fields.values())
        parts = [getattr(kind, "_fields", ()) for kind in layout.__annotations__.values()]
        super().__init__(name=f"{layout.__name__}{self.fields}{parts}")

    @property
    def mangling_args(self):
        return self.name[: self.name.index("{")], ()

    def place(self, name: str) -> int:
        """Return the number of the word at which a field begins."""
        before = list(self.fields)[: list(self.fields).index(name)]
        return sum(getattr(self.fields[each], "count", 1) for each in before)


def numba_type(kind: Any) -> Any:
    """Return Numba's type of a number, a pointer or a named tuple of them."""
    if kind in _KINDS:
        return _KINDS[kind]
    return tuple_type(kind, *[_KINDS[k] for k in kind.__annotations__.values()])


def tuple_type(kind: type, *fields: types.Type) -> Any:
    """Return Numba's type of a named tuple whose fields have these types."""
    return types.BaseTuple.from_types(fields, kind)


@register_model(Structure)
class _StructureModel(models.PrimitiveModel):
    def __init__(self, manager, kind):
        words = [manager.lookup(field).get_data_type() for field in kind.fields.values()]
        super().__init__(manager, kind, ir.LiteralStructType(words).as_pointer())


@infer_getattr
class _Fields(AttributeTemplate):
    key = Structure

    def generic_resolve(self, structure, name):
        return structure.fields.get(name)


@lower_getattr_generic(Structure)
def _read(context, builder, kind, structure, name):
    return context.unpack_value(builder, kind.fields[name], _place(builder, kind, structure, name))


@lower_setattr_generic(Structure)
def _write(context, builder, signature, values, name):
    kind = signature.args[0]
    place = _place(builder, kind, values[0], name)
    context.pack_value(builder, kind.fields[name], values[1], place)


def _place(builder, kind, structure, name):
    word, index = ir.IntType(32), list(kind.fields).index(name)
    return builder.gep(structure, [ir.Constant(word, 0), ir.Constant(word, index)])


def _memory_of(typing_context, structure):
    """Return the pointer to the memory that holds a structure."""

    def generate(context, builder, signature, values):
        return builder.bitcast(values[0], context.get_value_type(POINTER))

    return POINTER(structure), generate


memory_of: Callable[..., Any] = intrinsic(_memory_of)


def at(structure: Structure) -> Callable[..., Any]:
    """Return a function for compiled code that takes the memory at a pointer for a structure."""

    def cast(typing_context, memory):
        def generate(context, builder, signature, values):
            return builder.bitcast(values[0], context.get_value_type(structure))

        return structure(POINTER), generate

    return intrinsic(cast)
