"""Records: the parts of what acts on a robot as frozen data; each number is described once, where
it is held.

Laws, drives, events and wrenches are such parts. Those of this package are data: what was traced
for one is taken again for equal numbers. A class of the user's own may read what changes from run
to run.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, Field, field, fields, is_dataclass
from functools import lru_cache
from typing import Any, NamedTuple

from linkwork.mechanism.record import Amount, Positive, Real

PACKAGE = __name__.partition(".")[0]
BOUNDS = ((Amount, ", not below 0"), (Positive, ", above 0"))


class Number(NamedTuple):
    """Describe a number.

    what: its symbol or meaning, where its name does not tell; unit: of it, behind the meaning or
        where {unit} stands in it
    kind: its bounds: `Real`, `Amount` or `Positive`, or what else it may be
    by: what it may be given for each of, by name, instead of one number for all
    """

    what: str
    unit: str
    kind: Any = Real
    by: str = ""

    @property
    def meaning(self) -> str:
        """Its meaning and unit."""
        what = self.what if "{unit}" in self.what else f"{self.what} {{unit}}"
        return what.format(unit=f"[{self.unit}]").lstrip()

    @property
    def said(self) -> str:
        """The description in a line."""
        told = self.meaning + "".join(said for kind, said in BOUNDS if kind is self.kind)
        return f"{told}; one number, or one by {self.by}" if self.by else told

    @property
    def expected(self) -> str:
        """What a file is to give for it."""
        if not self.by:
            return self.meaning
        return ", ".join([*filter(None, [self.what]), f"a number, or one by {self.by}"])


def number(what: str, unit: str, kind: Any = Real, default: Any = MISSING, by: str = "") -> Any:
    """Return the field of a dataclass that holds a number, described as by `Number`."""
    return field(default=default, metadata={Number: Number(what, unit, kind, by)})


@lru_cache
def described(record: type) -> Mapping[str, Number]:
    """Return the described numbers of a dataclass by name, in its own order."""
    return {f.name: f.metadata[Number] for f in fields(record) if Number in f.metadata}


class ActingPart:
    """A part of what acts; its docstring ends with the numbers that it describes."""

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        held = dict(described(cls.__base__)) if is_dataclass(cls.__base__) else {}
        own = {name: f.metadata for name, f in vars(cls).items() if isinstance(f, Field)}
        held |= {name: metadata[Number] for name, metadata in own.items() if Number in metadata}
        if held and cls.__doc__:
            lines = "".join(f"\n    {name}: {of.said}" for name, of in held.items())
            cls.__doc__ = f"{cls.__doc__.rstrip()}\n{lines}\n    "

    @property
    def settled(self) -> bool:
        """Whether it is data: whether its class is one of this package."""
        return of_package(self)


def of_package(value: Any) -> bool:
    """Tell whether a value's class is one of this package."""
    return type(value).__module__.partition(".")[0] == PACKAGE
