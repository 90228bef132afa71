"""A program as statements of C, one for each operation.

    const double v7 = v3 * v5;          v9 = FMA(v3, v4, v8), rounded as in kernels

Values are computed near their use, depth first: compilers of C keep the order that they are given,
and what waits long for its use costs a register. (LLVM orders the operations of kernels anew.)

The program is cut into sections as for kernels (`kernels.sections`): the sines and cosines of all
angles that are known at a time are computed together at a section's end, by a loop that compilers
can make vectors of. The sections of a long program are functions, which hand over values in memory
on the stack of their caller: short ones keep more in registers (the Stewart platform's `motion` by
gcc on AVX2: 0.85 us instead of 1.17).
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from linkwork.kernels.body import LIBRARY
from linkwork.kernels.by_sections import is_long, shortened
from linkwork.kernels.fused import NEGATED, fused
from linkwork.kernels.program import Program
from linkwork.kernels.sections import FETCHED, Section, SectionPlan, planned
from linkwork.kernels.simplify import chain_lengths, depth_first

Precision = Literal["double", "float"]
Sines = Literal["polynomial", "libm"]
LANES = 8  # angles that are counted as one vector, by which sections become functions
TOGETHER = 4  # angles that C may take together
SMALLEST = {"double": 2.0**-1022, "float": 2.0**-126}
LARGEST = {"double": 2.0**1023 * (2 - 2.0**-52), "float": 2.0**127 * (2 - 2.0**-23)}
_OPERATORS = {"add": "+", "sub": "-", "mul": "*", "div": "/"}
_COMPARISONS = {"lt": "<", "le": "<=", "eq": "==", "ne": "!="}
_LOGICAL = {"and": "&&", "or": "||"}
_PLAIN = ("sqrt", "fabs", "floor", "ceil", "copysign")
_OWN = {"fmin": "least", "fmax": "most", "sign": "sign"}


@dataclass(frozen=True)
class Dialect:
    """Say how C is written.

    precision: of all numbers; sines: polynomials of our own, as in kernels, or the C library's
    """

    precision: Precision = "double"
    sines: Sines = "polynomial"

    @property
    def suffix(self) -> str:
        """What ends the names of the C library's functions, and constants."""
        return "f" if self.precision == "float" else ""

    def constant(self, value: float) -> str:
        """Return a number as a literal that reads back as the same one; what is too small or too
        large for the precision becomes the nearest that is not."""
        if math.isnan(value):
            return f"({self.precision})NAN"
        if math.isinf(value):
            return f"({'-' if value < 0 else ''}({self.precision})INFINITY)"
        if self.precision == "double":
            text = repr(float(value))
        else:
            size = min(max(abs(value), SMALLEST["float"]), LARGEST["float"]) if value else 0.0
            text = str(np.float32(math.copysign(size, value)))
        text = text if any(sign in text for sign in ".en") else f"{text}.0"
        return f"({text}{self.suffix})" if text.startswith("-") else text + self.suffix


def wrapped(head: str, given: Sequence[str]) -> str:
    """Return a head and its arguments, each in a line of its own where they are several."""
    if len(given) < 2:
        return f"{head}{', '.join(given)})"
    return f"{head}\n    " + ",\n    ".join(given) + ")"


def functions_text(
    program: Program, name: str, dialect: Dialect, fields: Sequence[str] = ()
) -> str:
    """Return static C functions; the last one, of the name, evaluates the program. All names begin
    with lw.

    void name(const lw_real *in0, ..., lw_real *out0, ...)    with the names of inputs and outputs

    fields: of the structure that the input p is
    """
    program = fused(program)
    program, plan = (
        shortened(program, LANES) if is_long(program) else (program, planned(program, LANES))
    )
    body = _Body(program, plan, dialect, fields)
    inputs = [
        f"const {'lw_parameters' if each == 'p' and fields else 'lw_real'} *LW_RESTRICT {each}"
        for each, _ in program.inputs
    ]
    outputs = [f"lw_real *LW_RESTRICT {each}" for each, _ in program.outputs]
    given = [each for each, _ in (*program.inputs, *program.outputs)]
    parts, calls = [], []
    kept = [f"    lw_real kept[{plan.slots}];"] if plan.slots else []
    memory = ["lw_real *LW_RESTRICT kept"] if plan.slots else []
    fixed = [*body.fixed()]
    if not plan.apart:
        lines = [line for section in plan.sections for line in body.section(section)] + fixed
        return _function(name, [*inputs, *outputs], [*kept, *lines], given)
    for k, section in enumerate(plan.sections):
        own = f"{name}_{k}"
        body.forget()
        lines = [*body.section(section)]
        text = _function(own, [*inputs, *outputs, *memory], lines, [*given, "kept"])
        parts.append(f"LW_SEPARATE\n{text}")
        calls.append(f"    {own}({', '.join([*given, *(['kept'] if memory else [])])});")
    lines = [*kept, *calls, *fixed]
    return "\n".join([*parts, _function(name, [*inputs, *outputs], lines, given)])


def _function(name: str, parameters: Sequence[str], lines: Sequence[str], given: list[str]) -> str:
    text = "\n".join(lines)
    used = {*re.findall(r"\b\w+(?=\[|,|\)|->)", text)}
    unused = [f"    (void){each};" for each in given if each not in used]
    head = wrapped(f"static void {name}(", parameters)
    return "\n".join([head, "{", *lines, *unused, "}", ""])


class _Body:
    """The statements of sections: values by position, as numbers or as truths."""

    def __init__(
        self, program: Program, plan: SectionPlan, dialect: Dialect, fields: Sequence[str]
    ):
        self.nodes, self.plan, self.dialect = program.nodes, plan, dialect
        order = depth_first(program, chain_lengths(program.nodes))
        self.rank = {k: rank for rank, k in enumerate(order)}
        arrays = [each for each in program.inputs if each[0] != "p" or not fields]
        self.inputs = [*_places(arrays), *(f"p->{field}" for field in fields)]
        self.outputs = _places(program.outputs)
        self.made: set[int] = set()

    def forget(self) -> None:
        """Begin a function of its own: what was computed is in memory now."""
        self.made = set()

    def fixed(self) -> Iterator[str]:
        """Yield the statements of results that are constants and no section writes."""
        for place, value in self.plan.fixed.items():
            yield f"    {self.outputs[place]} = {self.dialect.constant(value)};"

    def section(self, section: Section) -> Iterator[str]:
        """Yield the statements of a section, with its sines and cosines."""
        for k in sorted(section.nodes, key=self.rank.__getitem__):
            if self.nodes[k].op not in FETCHED:
                self.made.add(k)
                kind = "int t" if self._true(k) else "lw_real v"
                yield f"    const {kind}{k} = {self._computed(k)};"
            if k in self.plan.kept:
                yield f"    kept[{self.plan.kept[k]}] = {self.number(k)};"
            for place in self.plan.places.get(k, ()):
                yield f"    {self.outputs[place]} = {self.number(k)};"
        if section.angles:
            yield from self._turned(section)

    def _turned(self, section: Section) -> Iterator[str]:
        """Yield the statements that compute the sines and cosines at a section's end.

        Angles are repeated to a multiple of TOGETHER: compilers fill vectors with values that they
        have, but not with some of these and a constant. One alone takes no vectors, for whose
        constants it would wait.
        """
        angles, first = section.angles, section.first * LANES
        own = self.dialect.sines != "libm"
        alone = own and len(angles) == 1
        repeated = -(-len(angles) // TOGETHER) * TOGETHER if own and not alone else len(angles)
        for i in range(repeated):
            yield f"    kept[{first + i}] = {self.number(angles[i % len(angles)])};"
        sines, cosines = (part[angles[0]] for part in (self.plan.sines, self.plan.cosines))
        places = ", ".join(f"kept + {place}" for place in (first, sines, cosines))
        yield f"    lw_turn_one({places});" if alone else f"    lw_turn({len(angles)}, {places});"

    def number(self, k: int) -> str:
        """Return the value at position k as a number; a truth is 1 or 0."""
        op, args, value = self.nodes[k]
        if op == "const":
            return self.dialect.constant(value)
        if op == "input":
            return self.inputs[int(value)]
        if op in ("sin", "cos"):
            return f"kept[{(self.plan.sines if op == 'sin' else self.plan.cosines)[args[0]]}]"
        if k not in self.made:
            kept = self.plan.kept.get(k)
            return self.outputs[self.plan.places[k][0]] if kept is None else f"kept[{kept}]"
        if self._true(k):
            return f"(t{k} ? {self.dialect.constant(1.0)} : {self.dialect.constant(0.0)})"
        return f"v{k}"

    def truth(self, k: int) -> str:
        """Return the value at position k as a truth: whether it is not 0."""
        if k in self.made and self._true(k):
            return f"t{k}"
        return f"({self.number(k)} != {self.dialect.constant(0.0)})"

    def _true(self, k: int) -> bool:
        return self.nodes[k].op in (*_COMPARISONS, *_LOGICAL, "not")

    def _computed(self, k: int) -> str:
        op, args, _ = self.nodes[k]
        if op in _OPERATORS:
            return f" {_OPERATORS[op]} ".join(map(self.number, args))
        if op in _COMPARISONS:
            return f" {_COMPARISONS[op]} ".join(map(self.number, args))
        if op in _LOGICAL:
            return f" {_LOGICAL[op]} ".join(map(self.truth, args))
        if op == "not":
            return f"!{self.truth(args[0])}"
        if op == "neg":
            return f"-{self.number(args[0])}"
        if op in ("if_else_zero", "select"):
            other = self.number(args[2]) if op == "select" else self.dialect.constant(0.0)
            return f"{self.truth(args[0])} ? {self.number(args[1])} : {other}"
        if op in NEGATED:
            a, b, c = (
                "-" * negated + self.number(x) for x, negated in zip(args, NEGATED[op], strict=True)
            )
            return f"LW_FMA({a}, {b}, {c})"
        given = ", ".join(map(self.number, args))
        if op in _OWN:
            return f"lw_{_OWN[op]}({given})"
        if op in _PLAIN or op in LIBRARY:
            return f"{op}{self.dialect.suffix}({given})"
        raise AssertionError(op)


def _places(parts: Sequence[tuple[str, int]]) -> list[str]:
    return [f"{name}[{k}]" for name, size in parts for k in range(size)]
