"""The source of an export: programs as static functions, and the functions that call them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from linkwork.export.calls import Call
from linkwork.export.header import about, prototype, size_of
from linkwork.export.layout import ArrayLayout
from linkwork.export.sines import turn_text
from linkwork.export.statements import Dialect, functions_text
from linkwork.export.templates import filled
from linkwork.kernels.program import Program
from linkwork.model.checks import PIVOT_BOUND

OWN = (
    """\
static lw_real lw_least(lw_real a, lw_real b) { return a < b || b != b ? a : b; }
""",
    """\
static lw_real lw_most(lw_real a, lw_real b) { return a > b || b != b ? a : b; }
""",
    """\
static lw_real lw_sign(lw_real a) { return a > 0 ? (lw_real)1 : a < 0 ? (lw_real)-1 : a; }
""",
)
"""Functions that the C library has in slow forms, or not at all."""


def source_text(
    title: str,
    dialect: Dialect,
    layouts: Mapping[str, ArrayLayout],
    programs: Mapping[str, tuple[Call, Program]],
    parameters: Mapping[str, tuple[str, float]],
    home: Sequence[float],
    notes: Sequence[str],
) -> str:
    """Return the source, with lw for the prefix.

    programs: of the functions, by name; parameters: fields and values of free numbers, by path
    """
    fields = [field for field, _ in parameters.values()]
    code = "\n".join(
        functions_text(program, f"lw_{name}_code", dialect, fields)
        for name, (_, program) in programs.items()
    )
    parts = [
        about(title, notes),
        '#include "LW_FILE.h"\n\n#include <math.h>\n#include <stdint.h>\n',
    ]
    parts.append(filled("arithmetic.c", dialect))
    if "lw_turn(" in code:
        parts.append(turn_text(dialect))
    parts += [text for text in OWN if text.split("(")[0].split()[-1] + "(" in code]
    parts.append(f"#define LW_PIVOT_BOUND {dialect.constant(PIVOT_BOUND)}\n")
    parts.append(filled("helpers.c", dialect))
    parts.append(f"const lw_real lw_home[LW_Q] = {listed(home, dialect)};\n")
    if parameters:
        own = listed([value for _, value in parameters.values()], dialect)
        parts.append(f"const lw_parameters lw_own_parameters = {own};\n")
    parts.append(code)
    parts += [definition(call, layouts, bool(parameters)) for call, _ in programs.values()]
    return "\n".join(parts)


def listed(values: Sequence[float], dialect: Dialect) -> str:
    """Return numbers as an initialiser."""
    return "{\n    " + ",\n    ".join(dialect.constant(float(value)) for value in values) + "\n}"


def definition(call: Call, layouts: Mapping[str, ArrayLayout], free: bool) -> str:
    """Return the function that calls a program and judges what it gave."""
    given = [each.name for each in call.arguments if each.role == "in"] + ["p"] * free
    given += [each.name for each in call.arguments if each.role == "out"]
    judged = next(each for each in call.arguments if each.name == call.finite)
    count = f"{size_of(judged) or '1'}"
    pivot = ["    lw_real pivot[1];"] if call.pivot else []
    return "\n".join(
        [
            prototype(call, layouts, free),
            "{",
            *pivot,
            f"    lw_{call.name}_code({', '.join([*given, *['pivot'] * call.pivot])});",
            f"    return lw_judged({'pivot[0]' if call.pivot else '1'}, {judged.name}, {count});",
            "}",
            "",
        ]
    )
