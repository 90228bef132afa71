"""A program written as LLVM instructions: a module for one state, one for blocks of them, and one
for states side by side.

    void one(const double* in, double* out)
    void batch(int64_t blocks, const double* in, double* out)
        in[block][n_in][lanes], out[block][n_out][lanes]
    void wide(const double* in, double* out)
        in[n_in][ABREAST * lanes], out[n_out][ABREAST * lanes]

All come from the same walk over the program's sections, for double and for <lanes x double>:
straight-line code, but for the sines and cosines at the sections' ends (`angles`). The sections of
a long program are functions of their own (`by_sections`). Functions that are not inlined are calls
of the C library, lane by lane. The first module takes its angles in vectors of 4 at most, since
longer ones would slow down the single numbers around them. The second one holds `rows` as well,
which uses `batch`; a fourth one holds these and `columns` (`unit_directions`), a fifth one a
Jacobian row by row (`unit_rows`).

`wide` does one vector of states after the other, as `batch` does: the processor begins the next one
while it waits for the last results of the one before. A loop that needs all results before it can
go on gains by that.
"""

from typing import Literal

from linkwork.kernels import angles, by_sections
from linkwork.kernels.body import LIBRARY, SectionBody
from linkwork.kernels.fixed_results import fixed_text
from linkwork.kernels.lines import INOUT, ConstantTable, Lines, function_text
from linkwork.kernels.machine import Machine
from linkwork.kernels.program import Program
from linkwork.kernels.sections import Section, SectionPlan
from linkwork.kernels.stored_states import rows_text
from linkwork.kernels.unit_directions import columns_text
from linkwork.kernels.unit_rows import ByRows, joining_text

Kind = Literal["one", "batch", "wide", "dense", "columns", "by_rows"]

ABREAST = 2  # vectors of states that `wide` evaluates
FUNCTIONS: dict[Kind, tuple[str, ...]] = {
    "one": ("one",),
    "batch": ("batch", "rows"),
    "wide": ("wide",),
    "dense": ("dense",),
}
"""The functions that the modules of every program define; "columns" and "by_rows" are for
derivatives alone."""


def module_text(program: Program, machine: Machine, kind: Kind) -> str:
    """Return the LLVM module of a program with the FUNCTIONS of its kind, or with `columns`."""
    rows, single_numbers = ByRows(program), machine.for_single_numbers
    if kind == "one" or (kind == "by_rows" and rows.rows <= single_numbers.lanes):
        machine = single_numbers
    parts = library_texts(program, machine, kind != "one")
    if kind == "one":
        parts += _one(program, machine)
    if kind == "by_rows":
        single, batch = rows.single(), rows.batch()
        parts += [
            *_one(single, machine, "single"),
            *_vectors(batch, machine, "batch", len(rows.shared)),
        ]
        parts.append(joining_text(rows, single, batch, machine))
    elif kind != "one":
        parts += _vectors(program, machine, "wide" if kind == "wide" else "batch")
    if kind in ("batch", "columns"):
        parts.append(rows_text(program, machine))
    if kind == "columns":
        parts.append(columns_text(program, machine))
    return "\n\n".join(parts) + "\n"


def library_texts(program: Program, machine: Machine, vectors: bool) -> list[str]:
    """Return the functions that are called besides: the C library's, for vectors lane by lane, and
    sines and cosines."""
    called = {node.op for node in program.nodes if node.op in LIBRARY}
    turned = called & {"sin", "cos"}
    parts = [
        f"declare double @{name}({', '.join(['double'] * LIBRARY[name])})"
        for name in sorted(called | ({"sin", "cos"} if turned else set()))
    ]
    parts += [angles.sines_and_cosines_text(machine)] if turned else []
    others = sorted(called - turned) if vectors else []
    return parts + [_lane_by_lane(name, machine) for name in others]


def _one(program: Program, machine: Machine, name: str = "one") -> list[str]:
    lines = Lines(1, ConstantTable.of(name, machine))
    parts = evaluation(name, lines, program, machine, 1)
    lines.do("ret void")
    linkage = "" if name == "one" else "internal "
    head = f"{linkage}void @{name}({INOUT.format('%in', '%out')}) {machine.attributes}"
    return [*parts, lines.table_text(), function_text(head, lines.text)]


def _vectors(program: Program, machine: Machine, kind: Kind, shared: int = 0) -> list[str]:
    """Return `batch`, whose blocks lie one after the other, or `wide`, whose rows hold the vectors
    side by side."""
    wide = kind == "wide"
    count, abreast, steps = (
        (ABREAST, ABREAST, (1, 1)) if wide else ("%blocks", 1, (program.n_in, program.n_out))
    )
    # The loop over the blocks.
    lines = Lines(machine.lanes, ConstantTable.of(kind, machine))
    lines.do(f"%some = icmp sgt i64 {count}, 0")
    lines.do("br i1 %some, label %block, label %done")
    lines.label("block")
    lines.do(f"%left = phi i64 [ {count}, %entry ], [ %left.next, %next ]")
    lines.do("%in = phi ptr [ %in.first, %entry ], [ %in.next, %next ]")
    lines.do("%out = phi ptr [ %out.first, %entry ], [ %out.next, %next ]")
    # Two blocks at a time where the sections are functions, else one.
    program, plan = by_sections.cut(program, machine, 1, not shared)
    if plan.apart:
        width = lines.width
        parts = by_sections.definitions(kind, width, program, plan, machine, abreast, shared)
        here = by_sections.carry_out_pairs(kind, lines, plan, machine, steps)
    else:
        parts = _in_place(kind, lines, program, plan, machine, abreast, shared)
        here = "1"
    # On to the next ones.
    lines.do("br label %next")
    lines.label("next")
    for place, step in zip(("in", "out"), steps, strict=True):
        lines.do(f"%{place}.step = mul nsw i64 {here}, {step}")
        own = f"{lines.number}, ptr %{place}, i64 %{place}.step"
        lines.do(f"%{place}.next = getelementptr inbounds {own}")
    lines.do(f"%left.next = sub nsw i64 %left, {here}")
    lines.do("%more = icmp ne i64 %left.next, 0")
    lines.do("br i1 %more, label %block, label %done")
    lines.label("done")
    lines.do("ret void")
    blocks = "" if wide else "i64 %blocks, "
    head = f"void @{kind}({blocks}{INOUT.format('%in.first', '%out.first')}) {machine.attributes}"
    return [*parts, lines.table_text(), function_text(head, lines.text)]


def evaluation(
    name: str, lines: Lines, program: Program, machine: Machine, abreast: int
) -> list[str]:
    """Append the evaluation of a program, from %in to %out, to a function; return the definitions
    that this needs besides.

    abreast: the vectors that lie side by side in %in and %out, of which the first is meant.
    """
    program, plan = by_sections.cut(program, machine, machine.lanes // lines.width)
    if not plan.apart:
        return _in_place(name, lines, program, plan, machine, abreast)
    by_sections.reserve(lines, plan)
    here = by_sections.BlockPlaces("%in", "%out", "%kept")
    by_sections.carry_out(name, lines, plan, machine, [here])
    return by_sections.definitions(name, lines.width, program, plan, machine, abreast, 0)


def _in_place(
    name: str,
    lines: Lines,
    program: Program,
    plan: SectionPlan,
    machine: Machine,
    abreast: int,
    shared: int = 0,
) -> list[str]:
    """Append the code of a program's sections; return the definitions that this needs besides."""
    if plan.slots:
        by_sections.reserve(lines, plan)
    written = []
    if plan.fixed:
        written.append(fixed_text(f"{name}.fixed", plan.fixed, lines.width, machine, abreast))
        lines.do(f"call void @{name}.fixed(ptr %out)")
    wide = lines
    if lines.width == 1:
        wide = lines.of_width(machine.lanes, ConstantTable.of(f"{name}.angles", machine))
    body = SectionBody(lines, program, plan, "%kept", "%kept", abreast, shared)
    for section in plan.sections:
        body.add(section)
        if section.vectors:
            turn(body, section, wide, machine)
    return written if wide is lines else [*written, wide.table_text()]


def turn(body: SectionBody, section: Section, wide: Lines, machine: Machine) -> None:
    """Append the sines and cosines of a section's few angles; for one state, several angles share a
    vector."""
    numbers = [body.number(k) for k in section.angles]
    if wide is body.lines:
        pairs = angles.in_place(wide, numbers, body.target, section.first, machine)
    else:
        vectors = [
            wide.vector(numbers[k : k + wide.width]) for k in range(0, len(numbers), wide.width)
        ]
        turned = angles.in_place(wide, vectors, body.target, section.first, machine)
        pairs = [
            pair for s, c in turned for pair in zip(wide.entries(s), wide.entries(c), strict=True)
        ]
    # The last vector may not be full.
    for k, (sine, cosine) in zip(section.angles, pairs, strict=False):
        body.turn(k, sine, cosine)


def _lane_by_lane(name: str, machine: Machine) -> str:
    """Return the vector function that calls the C library's function of that name for each lane."""
    lines = Lines(machine.lanes)
    arguments = ["%x", "%y"][: LIBRARY[name]]
    entries = zip(*(lines.entries(argument) for argument in arguments), strict=True)
    values = [
        lines.let(f"call double @{name}({', '.join(f'double {e}' for e in lane)})")
        for lane in entries
    ]
    lines.do(f"ret {lines.number} {lines.vector(values)}")
    parameters = ", ".join(f"{lines.number} {a}" for a in arguments)
    head = f"internal {lines.number} @lanes.{name}({parameters}) noinline {machine.attributes}"
    return function_text(head, lines.text)
