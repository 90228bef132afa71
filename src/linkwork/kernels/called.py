"""Parts of a program that are functions, and their calls.

    void part(const double* in, double* out, const double* source, double* target,
              const int32_t* row, const double* numbers)

A call's row holds where its arguments and results are, in bytes: inputs in %in, values from
elsewhere in %source, values for elsewhere in %target, results in %out; its numbers lie at %numbers.
"""

from __future__ import annotations

import struct

from linkwork.kernels.body import PartBody
from linkwork.kernels.lines import INOUT, ConstantTable, Lines, function_text
from linkwork.kernels.machine import Machine
from linkwork.kernels.repeats import Part
from linkwork.kernels.sections import SectionPlan


def part_text(
    name: str, part: Part, plan: SectionPlan, width: int, machine: Machine, abreast: int
) -> list[str]:
    """Return the definition of a part, and the tables of its calls.

    abreast: vectors that lie side by side in %in and %out
    """
    lines = Lines(width, ConstantTable.of(name, machine))
    PartBody(lines, part).compute()
    lines.do("ret void")
    pointers = f"{INOUT.format('%in', '%out')}, {INOUT.format('%source', '%target')}"
    tables = "ptr noalias nonnull readonly %row, ptr noalias nonnull readonly %numbers"
    head = f"internal void @{name}({pointers}, {tables}) noinline {machine.attributes}"
    rows = [offsets(part, call, plan, 8 * width, abreast) for call in range(len(part.calls))]
    numbers = [number for row in part.numbers for number in row] or [0.0]
    return [
        _table(f"{name}.rows", "i32", [str(offset) for row in rows for offset in row]),
        _table(f"{name}.numbers", "double", [_exact(number) for number in numbers]),
        lines.table_text(),
        function_text(head, lines.text),
    ]


def call_text(name: str, part: Part, call: int, pointers: str) -> str:
    """Return a call of a part; pointers: to inputs, results, and values of other sections."""
    size = len(part.inputs[0]) + len(part.values[0]) + len(part.kept) + len(part.results)
    row = f"getelementptr inbounds (i32, ptr @{name}.rows, i64 {call * size})"
    first = call * len(part.numbers[0])
    numbers = f"getelementptr inbounds (double, ptr @{name}.numbers, i64 {first})"
    return f"call void @{name}({pointers}, ptr {row}, ptr {numbers})"


def offsets(part: Part, call: int, plan: SectionPlan, size: int, abreast: int) -> list[int]:
    """Return the row of a call; size: of a number in memory."""
    written = [plan.kept[part.place(call, i)] for i in part.kept]
    left = {k: iter(plan.places[k]) for i in part.results for k in [part.place(call, i)]}
    places = [next(left[part.place(call, i)]) for i in part.results]
    read = [plan.slot(k) for k in part.values[call]]
    return [
        *(place * abreast * size for place in part.inputs[call]),
        *(slot * size for slot in (*read, *written)),
        *(place * abreast * size for place in places),
    ]


def _table(name: str, kind: str, entries: list[str]) -> str:
    listed = ", ".join(f"{kind} {entry}" for entry in entries)
    return f"@{name} = internal constant [{len(entries)} x {kind}] [{listed}], align 64"


def _exact(number: float) -> str:
    return "0x" + struct.pack(">d", number).hex()
