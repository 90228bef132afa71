"""The source of an export: programs as static functions, and the functions that call them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from linkwork.equations.equations import LOST
from linkwork.export.c_helpers import OWN, used
from linkwork.export.calls import Call
from linkwork.export.header import about, prototype, size_of
from linkwork.export.layout import ArrayLayout
from linkwork.export.sines import turn_texts
from linkwork.export.statements import Dialect, functions_text
from linkwork.export.templates import filled
from linkwork.kernels.program import Program
from linkwork.model.checks import PIVOT_BOUND
from linkwork.model.closing import CONTRACTS, LONGEST, SETTLING
from linkwork.model.modes import FLAT
from linkwork.robot import Robot
from linkwork.runs.next_chart import FIRM, REUSED
from linkwork.runs.passage import SOFT
from linkwork.simulation.tableaus import DORMAND_PRINCE

CLOSED = {"double": 1e-13, "float": 1e-6}
"""Largest |phi| of closed loops, over what its rounding grows with; 64 times as much is open."""
MET = {"double": 1e-6, "float": 1e-3}
SMALLEST_STEP = {"double": 16 * 2.0**-52, "float": 16 * 2.0**-23}
PARTS = 64  # of a way, at most
BEGUN = {
    "double": 2.0**-20,
    "float": 2.0**-10,
}  # part of a step at whose end what met at its beginning has met
TOUCHING = {"double": 8 * 2.0**-52, "float": 8 * 2.0**-23}
"""Distance within which surfaces touch to rounding, over the largest coordinate or own length."""
LOOKS = 8  # at what may meet in a step
HALVINGS = {"double": 53, "float": 24}  # of the part in which it does
CORRECTIONS = 3  # of a step that ends there
SHARED = ("settle.c", "charts.c", "other_charts.c", "motion_in_charts.c")
"""Pieces that others call, in the order in which they need each other."""
NEEDS = {
    "project.c": {"settle.c"},
    "kinematics.c": {"settle.c"},
    "start.c": {"settle.c"},
    "step_rk4.c": {*SHARED},
    "step.c": {*SHARED},
}


def source_text(
    robot: Robot,
    dialect: Dialect,
    layouts: Mapping[str, ArrayLayout],
    calls: Sequence[Call],
    programs: Mapping[str, Program],
    fields: Mapping[str, str],
    notes: Sequence[str],
    more: str = "",
) -> str:
    """Return the source, with lw for the prefix.

    programs: by name; fields: of the free numbers, by path; more: C that follows
    """
    # The functions, what they share, and the programs.
    states = len(layouts["Z"]) if "Z" in layouts else 0
    given = words(robot, bool(fields), states)
    wanted = {each for call in calls for each in NEEDS.get(call.body or "", ())}
    if robot.mobility == robot.equations.nv:
        wanted -= {"other_charts.c"}
    shared = [filled(name, dialect, given) for name in SHARED if name in wanted]
    defined = [definition(call, layouts, dialect, given, bool(fields)) for call in calls]
    written = [
        functions_text(program, f"lw_{name}_code", dialect, [*fields.values()])
        for name, program in programs.items()
    ]
    body = "\n".join([*written, *shared, *defined, more])
    # What they use of small functions, constants and tables.
    helpers = re.split(r"\n(?=static )", filled("helpers.c", dialect))
    small = used([*OWN, *helpers], body)
    constants = [*numbers(robot, dialect), *tables(robot, dialect, states)]
    values = [robot.parameters[path] for path in fields]
    parts = [
        about(robot, notes),
        '#include "LW_FILE.h"\n\n#include <math.h>\n',
    ]
    parts += [filled("arithmetic.c", dialect)]
    parts += turn_texts(dialect, body)
    parts += [*used(constants, "\n".join([*small, body])), *small]
    parts += [f"const lw_real lw_home[LW_Q] = {listed(robot.home.q, dialect)};\n"]
    if fields:
        parts.append(f"const lw_parameters lw_own_parameters = {listed(values, dialect)};\n")
    return "\n".join([*parts, body])


def words(robot: Robot, free: bool, states: int = 0) -> dict[str, str]:
    """Return what stands in place of words in the pieces of C; states: number of those of
    drives."""
    rows, errors = DORMAND_PRINCE.a[1:, :-1].tolist(), DORMAND_PRINCE.e.tolist()
    nothing = "(void)state; (void)least;" + " (void)p;" * free
    loops, meetings = robot.mobility < robot.equations.nv, len(robot.equations.gaps)
    return {
        "WITH_P": ", p" * free,
        "TAKING_P": ", const lw_parameters *p" * free,
        "OTHERWISE": "" if loops else "//",
        "MEETING": "" if meetings else "//",
        "COUNT_OF_MEETINGS": str(meetings),
        "WITH_SLOPES": ", slopes" * bool(meetings),
        "TAKING_SLOPES": ", lw_real slopes[2][LW_Y]" * bool(meetings),
        "NOTHING_OF_STATE": "" if loops else nothing,
        "WEIGHTS": ", ".join("{" + ", ".join(map(weight, row)) + "}" for row in rows),
        "ERRORS": ", ".join(map(weight, errors)),
    } | words_of_drives(loops, states)


def words_of_drives(loops: bool, states: int) -> dict[str, str]:
    """Return the words for states of drives, z, behind q and v."""
    rates = "lw_w_units[chart->independent[i - LW_Q]]"
    more = f"i < LW_Q + LW_V ? {rates} : lw_z_units[i - LW_Q - LW_V]" if states else rates
    some = bool(states)
    return {
        "DRIVEN": "" if some else "//",
        "UNDRIVEN": "//" if some else "",
        "OTHERDRIVEN": "" if some and loops else "//",
        "GIVEN": "given" if some else "u",
        "PLUS_Z": "+ LW_Z" * some,
        "UNIT_OF_STATE": f"i < LW_Q ? lw_q_units[i] : {more}",
        **{f"WITH_{name}": f", {name.lower()}" * some for name in ("DZ", "TDZ")},
        **{f"TAKING_{name}": f", lw_real *{name.lower()}" * some for name in ("DZ", "TDZ")},
    }


def weight(value: float) -> str:
    """Return a weight of a method as a literal of either precision."""
    return f"(lw_real){value!r}"


def numbers(robot: Robot, dialect: Dialect) -> list[str]:
    """Return the constants by name."""
    precision = dialect.precision
    closed = CLOSED[precision] * robot.size
    found = {
        "PIVOT_BOUND": PIVOT_BOUND,
        "CLOSED": closed,
        "OPEN": 64 * closed,
        "LONGEST": LONGEST,
        "CONTRACTS": CONTRACTS,
        "MET": MET[precision],
        "FLAT": FLAT,
        "WEAK": SOFT,
        "REUSED": REUSED,
        "LOST": LOST * robot.equations.smallest,
        "HARD": FIRM * robot.equations.smallest,
        "SMALLEST_STEP": SMALLEST_STEP[precision],
        "BEGUN": BEGUN[precision],
        "TOUCHING": TOUCHING[precision],
    }
    counts = {
        "MOST_CORRECTIONS": SETTLING,
        "MOST_PARTS": PARTS,
        "LOOKS": LOOKS,
        "HALVINGS": HALVINGS[precision],
        "CORRECTIONS": CORRECTIONS,
    }
    return [
        *(f"#define LW_{name} {count}\n" for name, count in counts.items()),
        *(f"#define LW_{name} {dialect.constant(value)}\n" for name, value in found.items()),
    ]


def tables(robot: Robot, dialect: Dialect, states: int = 0) -> list[str]:
    """Return the constant arrays by name; states: number of those of drives."""
    tree, (columns, rows) = robot.equations.tree, robot.equations.sizes
    places = {tree.rates[k]: place for place, k in tree.single}
    integers = {
        "a_places[LW_A]": [places.get(name, 0) for name in robot.independent],
        "v_places[LW_V]": list(robot.equations.chart.independent),
    }
    reals = {
        "row_factors[LW_PHI]": 1 / rows,
        "rate_factors[LW_W]": 1 / columns,
        "q_units[LW_Q]": tree.units,
        "w_units[LW_W]": tree.rate_units,
    }
    if states:
        reals["z_units[LW_Z]"] = np.ones(states)
    return [
        *(
            f"static const int lw_{name} = {{{', '.join(map(str, each))}}};\n"
            for name, each in integers.items()
        ),
        *(
            f"static const lw_real lw_{name} = {listed(each, dialect)};\n"
            for name, each in reals.items()
        ),
    ]


def listed(values: Iterable[float] | np.ndarray, dialect: Dialect) -> str:
    """Return numbers as an initialiser."""
    return "{\n    " + ",\n    ".join(dialect.constant(float(value)) for value in values) + "\n}"


def definition(
    call: Call,
    layouts: Mapping[str, ArrayLayout],
    dialect: Dialect,
    given: Mapping[str, str],
    free: bool,
) -> str:
    """Return a function: its piece of C, or one that calls the program of its name and judges what
    that gave."""
    opening = prototype(call, layouts, free)
    if call.body is not None:
        return filled(call.body, dialect, {**given, "PROTOTYPE": opening})
    ins, outs = (
        [each for each in call.arguments if (each.role == "in") is own] for own in (True, False)
    )
    pivot = call.name != "closure"
    names = [each.name for each in ins] + ["p"] * free + [each.name for each in outs]
    judged = outs[-1]
    return "\n".join(
        [
            opening,
            "{",
            *["    lw_real pivot[1];"] * pivot,
            f"    lw_{call.name}_code({', '.join([*names, *['pivot'] * pivot])});",
            f"    return lw_judged({'pivot[0]' if pivot else '1'}, {judged.name}, "
            f"{size_of(judged) or '1'});",
            "}",
            "",
        ]
    )
