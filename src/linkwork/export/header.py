"""The header of an export: what each array holds, in which order and unit, and what each function
does."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Mapping, Sequence
from importlib.metadata import version

from linkwork.export.calls import Argument, Call
from linkwork.export.layout import ArrayLayout
from linkwork.export.statements import wrapped
from linkwork.robot import Robot

WIDTH = 96

STATUS = (
    ("OK", "done"),
    (
        "SINGULAR",
        "the independent rates do not determine the motion at this configuration",
    ),
    ("NOT_FINITE", "a number that is given or found is not finite"),
    ("NOT_CLOSED", "the loops cannot be closed from here, or the way leads past a singular pose"),
    ("TOO_MANY_STEPS", "the end was not reached in LW_MOST_STEPS steps"),
    ("STEP_TOO_SHORT", "the tolerances would need steps that are too short"),
    ("OUT_OF_RANGE", "the step or a tolerance is not above zero"),
)


def comment(text: str, indent: str = "") -> str:
    """Return a comment of C, in lines that are not too long."""
    lines = [
        line
        for paragraph in safe(text).split("\n")
        for line in textwrap.wrap(paragraph, WIDTH - 6 - len(indent)) or [""]
    ]
    return (
        "\n".join(
            [f"{indent}/* {lines[0]}", *(f"{indent}   {line}".rstrip() for line in lines[1:])]
        )
        + " */"
    )


def safe(text: str) -> str:
    """Return text that neither ends a comment nor begins another."""
    for sign in ("*/", "/*", "//", "??"):
        while sign in text:
            text = text.replace(sign, f"{sign[0]} {sign[1]}")
    return text.replace("\\", "/")


def size_of(argument: Argument) -> str:
    """Return what stands in an argument's brackets."""
    return " * ".join(f"LW_{size}" for size in argument.sizes)


def declared(argument: Argument, layouts: Mapping[str, ArrayLayout]) -> str:
    """Return the declaration of an argument."""
    if argument.kind == "state":
        return f"lw_state *{argument.name}"
    constant = "const " if argument.role == "in" else ""
    if not argument.sizes:
        return f"lw_real {'' if constant else '*'}{argument.name}"
    empty = not all(len(layouts[size]) for size in argument.sizes)
    return f"{constant}lw_real {argument.name}[{'' if empty else size_of(argument)}]"


def prototype(call: Call, layouts: Mapping[str, ArrayLayout], free: bool) -> str:
    """Return the head of a function, without what ends it."""
    given = [declared(each, layouts) for each in call.arguments if each.role == "in"]
    given += ["const lw_parameters *p"] * free
    given += [declared(each, layouts) for each in call.arguments if each.role != "in"]
    return wrapped(f"lw_status lw_{call.name}(", given)


def header_text(
    robot: Robot,
    layouts: Mapping[str, ArrayLayout],
    calls: Iterable[Call],
    parameters: Mapping[str, str],
    notes: Sequence[str],
    precision: str,
) -> str:
    """Return the header, with lw for the prefix."""
    parts = [about(robot, notes), OPENING, f"typedef {precision} lw_real;\n", status_text()]
    parts += [layout_text(layout) for layout in layouts.values()]
    if parameters:
        parts.append(parameters_text(parameters))
    parts.append(
        comment("A configuration with its loops closed, in which everything is at rest.")
        + "\nextern const lw_real lw_home[LW_Q];\n"
    )
    calls = list(calls)
    if any(each.kind == "state" for call in calls for each in call.arguments):
        parts.append(STATE if "Z" in layouts else STATE.replace(DRIVE_STATES, ""))
    for call in calls:
        parts.append(call_text(call, layouts, bool(parameters)))
    return "\n".join([*parts, CLOSING])


def about(robot: Robot, notes: Sequence[str]) -> str:
    """Return the comment at the beginning of each file."""
    said = "".join(f"\n\nNote: {note}." for note in notes)
    return comment(
        f'Exact equations of motion of "{robot.mechanism.name}", written by Linkwork '
        f"{version('linkwork')}.\n\n"
        "All numbers are in SI units and radians; the mechanism's own length is "
        f"{robot.equations.tree.length:.6g} m. Functions return a status; where it is not LW_OK "
        "what they gave is of no use. They keep no state, call nothing but the mathematics of the "
        "C library, take no memory from the heap, do not call themselves, and may be called by any "
        f"number of threads. What a function takes and what it gives may not overlap.{said}"
    )


OPENING = """\
#ifndef LW_H
#define LW_H

#ifdef __cplusplus
extern "C" {
#endif
"""
CLOSING = """\
#ifdef __cplusplus
}
#endif

#endif
"""


STATE = """\
enum { LW_MOST_STEPS = 10000 };

/* The state of a motion, which may be copied, read and written. */
typedef struct lw_state {
    lw_real t; /* time [s] */
    lw_real q[LW_Q]; /* configuration */
    lw_real w[LW_W]; /* rates of the joints of the spanning tree, all of them */
    lw_real z[LW_Z]; /* states of drives */
    lw_real next; /* length of the step that lw_step tries next [s]; 0: it finds one */
    int own; /* whether the last step was made in the robot's own independent rates */
    int changes; /* how often the independent rates were changed */
} lw_state;
"""
DRIVE_STATES = "    lw_real z[LW_Z]; /* states of drives */\n"


def status_text() -> str:
    """Return the statuses."""
    *most, last = [(f"    LW_{name} = {k}", says) for k, (name, says) in enumerate(STATUS)]
    lines = [f"{line}, /* {says} */" for line, says in most] + [f"{last[0]} /* {last[1]} */"]
    return "\n".join(["typedef enum lw_status {", *lines, "} lw_status;", ""])


def layout_text(layout: ArrayLayout) -> str:
    """Return how many numbers an array has, and the place, name and unit of each."""
    head = comment(f"{layout.about[0].upper()}{layout.about[1:]}:")
    places = layout.places
    numbers = [
        (f"LW_{layout.size}_{places[name]} = {k}", name, unit)
        for k, (name, unit) in enumerate(layout.numbers)
    ]
    if not layout.shown:
        told = [f"{k}: {name} [{unit}]" for k, (_, name, unit) in enumerate(numbers)]
        head = comment("\n".join([f"{layout.about[0].upper()}{layout.about[1:]}:", *told]))
        return f"{head}\nenum {{ LW_{layout.size} = {len(layout)} }};\n"
    lines = [f"    LW_{layout.size} = {len(layout)}{',' if numbers else ''}"]
    for k, (place, name, unit) in enumerate(numbers):
        comma = "," if k + 1 < len(numbers) else ""
        lines.append(f"    {place}{comma} /* {safe(name)} [{unit}] */")
    return "\n".join([head, "enum {", *lines, "};", ""])


def parameters_text(parameters: Mapping[str, str]) -> str:
    """Return the structure of the free numbers; parameters: fields by their paths."""
    lines = [f"    lw_real {field}; /* {safe(path)} */" for path, field in parameters.items()]
    return "\n".join(
        [
            comment("The free numbers of the description, in SI units, and their own values."),
            "typedef struct lw_parameters {",
            *lines,
            "} lw_parameters;",
            "",
            "extern const lw_parameters lw_own_parameters;",
            "",
        ]
    )


def call_text(call: Call, layouts: Mapping[str, ArrayLayout], free: bool) -> str:
    """Return the declaration of a function, with what it does."""
    told = [call.says]
    for each in call.arguments:
        place = f"{each.name}[{size_of(each)}]" if each.sizes else each.name
        told.append(f"{each.role:5} {place}: {each.meaning}")
    return f"{comment(chr(10).join(told))}\n{prototype(call, layouts, free)};\n"
