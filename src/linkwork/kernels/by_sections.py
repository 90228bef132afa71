"""Long programs as functions of their sections, in vectors two blocks of states at a time.

Straight-line code that is longer than the fastest memory of instructions (32 kB) is fetched anew
for each block. In sections, each of which is carried out for two blocks before the next one, it is
fetched once for both; and in a short section, which stands depth first, more values stay in
registers. The bits are the same. With AVX2 forward dynamics of the Stewart platform takes 168 ns a
state in batches instead of 195, in the legs' rates 260 instead of 319, and 0.82 us one by one
instead of 1.13; code of 1,200 operations gains nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from linkwork.kernels import angles, called
from linkwork.kernels.body import SectionBody
from linkwork.kernels.fixed_results import fixed_text
from linkwork.kernels.fused import fused
from linkwork.kernels.lines import INOUT, ConstantTable, Lines, function_text
from linkwork.kernels.machine import Machine
from linkwork.kernels.program import Program
from linkwork.kernels.sections import Section, SectionPlan, planned
from linkwork.kernels.simplify import LARGE, chain_lengths, depth_first, reordered

PAIR = 2  # blocks that a section is carried out for
LONG = 1700
"""Number of nodes from which on code is about as long as that memory, where an instruction takes
eight bytes, as one that reads memory does on x86."""
SHORT = 150  # operations of a section of such code


class BlockPlaces(NamedTuple):
    """Name the pointers to a block's inputs, results and slots."""

    given: str
    found: str
    kept: str


def cut(
    program: Program, machine: Machine, angles_in_vector: int, recurring: bool = True
) -> tuple[Program, SectionPlan]:
    """Return a program with its products fused, and its sections; the rest as `planned`."""
    program = fused(program, machine.has_fma)
    if not (machine.has_memory_operands and is_long(program)):
        return program, planned(program, angles_in_vector, recurring)
    return shortened(program, angles_in_vector)


def is_long(program: Program) -> bool:
    """Tell whether a program with its products fused may be cut because of how long its code is."""
    return LONG < len(program.nodes) <= LARGE


def shortened(program: Program, angles_in_vector: int) -> tuple[Program, SectionPlan]:
    """Return a program with its values near their uses, so that few are handed from section to
    section, and its short sections."""
    program = reordered(program, depth_first(program, chain_lengths(program.nodes)))
    return program, planned(program, angles_in_vector, short=SHORT)


def definitions(
    name: str,
    width: int,
    program: Program,
    plan: SectionPlan,
    machine: Machine,
    abreast: int,
    shared: int,
) -> list[str]:
    """Return the functions of a program's sections, and of parts.

    width: doubles of a number; abreast: vectors that lie side by side in %in and %out; shared:
    inputs that are single numbers for all lanes
    """
    found = [
        text
        for k, part in enumerate(plan.parts)
        for text in called.part_text(f"{name}.part.{k}", part, plan, width, machine, abreast)
    ]
    if plan.fixed:
        found.append(fixed_text(f"{name}.fixed", plan.fixed, width, machine, abreast))
    for k, section in enumerate(plan.sections):
        if section.part is not None:
            continue
        lines = Lines(width, ConstantTable.of(f"{name}.{k}", machine))
        body = SectionBody(lines, program, plan, "%source", "%target", abreast, shared)
        body.add(section)
        _keep_angles(body, section, machine)
        lines.do("ret void")
        pointers = f"{INOUT.format('%in', '%out')}, {INOUT.format('%source', '%target')}"
        head = f"internal void @{name}.{k}({pointers}) noinline {machine.attributes}"
        found += [lines.table_text(), function_text(head, lines.text)]
    return found


def _keep_angles(body: SectionBody, section: Section, machine: Machine) -> None:
    """Append the code that writes a section's angles to their slots, and zeros that fill up the
    last vector."""
    in_vector = machine.lanes // body.lines.width
    for k in range(section.vectors * in_vector):
        angle = (
            body.number(section.angles[k]) if k < len(section.angles) else body.lines.constant(0.0)
        )
        body.lines.store(angle, body.target, section.first * in_vector + k)


def carry_out(
    name: str, lines: Lines, plan: SectionPlan, machine: Machine, blocks: Sequence[BlockPlaces]
) -> None:
    """Append the calls of all sections, each for all blocks before the next one."""
    wide = lines.of_width(machine.lanes)
    for block in blocks if plan.fixed else ():
        lines.do(f"call void @{name}.fixed(ptr {block.found})")
    for k, section in enumerate(plan.sections):
        for given, found, kept in blocks:
            if section.part is not None:
                number, call = section.part
                part = f"{name}.part.{number}"
                pointers = f"ptr {given}, ptr {found}, ptr {kept}, ptr {kept}"
                lines.do(called.call_text(part, plan.parts[number], call, pointers))
                continue
            lines.do(f"call void @{name}.{k}(ptr {given}, ptr {found}, ptr {kept}, ptr {kept})")
            if section.vectors:
                angles.by_call(wide, section.vectors, kept, section.first)


def carry_out_pairs(
    name: str, lines: Lines, plan: SectionPlan, machine: Machine, steps: tuple[int, int]
) -> str:
    """Append the evaluation of the next two of %left blocks, or of one that is alone; return the
    name of how many these are. So many values of a program that is LARGE are handed over that
    those of two blocks would be too many.

    steps: numbers from one block to the next, of %in and of %out
    """
    one = BlockPlaces("%in", "%out", "%kept")
    if len(plan.nodes) > LARGE:
        reserve(lines, plan)
        carry_out(name, lines, plan, machine, [one])
        return "1"
    room = reserve(lines, plan, PAIR)
    lines.do(f"%several = icmp sge i64 %left, {PAIR}")
    lines.do(f"%here = select i1 %several, i64 {PAIR}, i64 1")
    lines.do("br i1 %several, label %pair, label %alone")
    lines.label("pair")
    other = (lines.at(first, n) for first, n in zip(one, (*steps, room), strict=True))
    carry_out(name, lines, plan, machine, [one, BlockPlaces(*other)])
    lines.do("br label %next")
    lines.label("alone")
    carry_out(name, lines, plan, machine, [one])
    return "%here"


def reserve(lines: Lines, plan: SectionPlan, blocks: int = 1) -> int:
    """Reserve the slots of so many blocks at the beginning of a function; return those of one."""
    slots = max(plan.slots, 1)
    lines.text.insert(1, f"%kept = alloca [{blocks * slots} x {lines.number}], align 64")
    return slots
