"""Results that are constants, where a program has many of them, as the zeros of large matrices:
written by a loop over a table, for LLVM's time grows with the square of a function's length.
"""

from __future__ import annotations

import struct

from linkwork.kernels.lines import Lines, function_text
from linkwork.kernels.machine import Machine
from linkwork.kernels.program import Program

FEWEST = 1000  # constants that are worth a loop


def fixed_results(program: Program) -> dict[int, float]:
    """Return the results that are constants, by their places in the output; none where these are
    few."""
    nodes = program.nodes
    found = {
        place: nodes[k].value for place, k in enumerate(program.results) if nodes[k].op == "const"
    }
    return found if len(found) >= FEWEST else {}


def fixed_text(
    name: str, fixed: dict[int, float], width: int, machine: Machine, abreast: int
) -> str:
    """Return the LLVM function void(double* out) that writes constants to their places.

    width: doubles of a number; abreast: numbers that lie side by side in %out
    """
    size = len(fixed)
    lines = Lines(width)
    lines.do("br label %each")
    lines.label("each")
    lines.do("%k = phi i64 [ 0, %entry ], [ %k.next, %each ]")
    entry = lines.let(f"getelementptr inbounds i64, ptr @{name}.places, i64 %k")
    place = lines.let(f"load i64, ptr {entry}, align 8")
    lines.store(lines.single(f"@{name}.values", "%k"), "%out", place)
    lines.do("%k.next = add nuw nsw i64 %k, 1")
    lines.do(f"%more = icmp ult i64 %k.next, {size}")
    lines.do("br i1 %more, label %each, label %done")
    lines.label("done")
    lines.do("ret void")
    places = ", ".join(f"i64 {place * abreast}" for place in fixed)
    values = ", ".join(f"double 0x{struct.pack('>d', value).hex()}" for value in fixed.values())
    head = f"internal void @{name}(ptr noalias nonnull writeonly %out) noinline"
    return "\n\n".join(
        [
            f"@{name}.places = internal constant [{size} x i64] [{places}], align 64",
            f"@{name}.values = internal constant [{size} x double] [{values}], align 64",
            function_text(f"{head} {machine.attributes}", lines.text),
        ]
    )
