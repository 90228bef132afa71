"""The function that evaluates states stored one a row, without gaps, in the registers: rows are
read as vectors of states, and results written as rows, while the processor evaluates, and no block
of either lies in memory.

    void dense(int64_t blocks, const double** in, double** out)

in[i] is the first row of input i, out[i] that of output i; a block are as many states as there are
lanes. The next rows are fetched into the nearest memory meanwhile.
"""

from __future__ import annotations

from itertools import accumulate

from linkwork.kernels import transposed
from linkwork.kernels.body import SectionBody
from linkwork.kernels.by_sections import cut
from linkwork.kernels.emit import Kind, evaluation, library_texts, module_text, turn
from linkwork.kernels.lines import ConstantTable, Lines, function_text
from linkwork.kernels.machine import Machine
from linkwork.kernels.program import Program
from linkwork.kernels.sections import SectionPlan

AHEAD = 4  # blocks from that which is evaluated to that which is fetched
FETCHED = 8  # doubles that memory moves at a time; longer rows come in time by themselves


class RegisterBody(SectionBody):
    """The code of sections whose inputs are the names of values, as `results` are by place."""

    def __init__(self, lines: Lines, program: Program, plan: SectionPlan, inputs: list[str]):
        super().__init__(lines, program, plan, "%kept", "%kept", 1)
        self.inputs = inputs
        self.results = {place: lines.constant(value) for place, value in plan.fixed.items()}

    def _give(self, place: int, number: str) -> None:
        self.results[place] = number

    def _fetched(self, k: int) -> str:
        op, _, value = self.nodes[k]
        return self.inputs[int(value)] if op == "input" else super()._fetched(k)


def dense_text(program: Program, machine: Machine) -> str:
    """Return the LLVM module of a program with `dense`."""
    lines = Lines(machine.lanes, ConstantTable.of("dense", machine))
    read = [size for _, size in program.inputs]
    written = [size for _, size in program.outputs]
    given, found = (
        [_entry(lines, table, k) for k in range(len(sizes))]
        for table, sizes in (("%given", read), ("%found", written))
    )
    lines.do("%some = icmp sgt i64 %blocks, 0")
    lines.do("br i1 %some, label %block, label %done")
    lines.label("block")
    lines.do("%number = phi i64 [ 0, %entry ], [ %number.next, %next ]")
    # Rows to vectors, evaluated, and back to rows.
    inputs: list[str] = []
    for first, size in zip(given, read, strict=True):
        rows = _rows(lines, first, size)
        inputs += [name for _, name in transposed.gathered(lines, rows, size, range(size))]
        if size <= FETCHED:
            _fetch(lines, rows, size)
    parts, results = _evaluated(lines, program, machine, inputs)
    starts = accumulate(written, initial=0)
    for first, size, start in zip(found, written, starts, strict=False):
        own = results[start : start + size]
        transposed.scattered(lines, own, size, _rows(lines, first, size))
    # The next block, until all are done.
    lines.do("br label %next")
    lines.label("next")
    lines.do("%number.next = add nuw nsw i64 %number, 1")
    lines.do("%more = icmp slt i64 %number.next, %blocks")
    lines.do("br i1 %more, label %block, label %done")
    lines.label("done")
    lines.do("ret void")
    head = f"void @dense(i64 %blocks, ptr %given, ptr %found) {machine.attributes}"
    own = [lines.table_text(), function_text(head, lines.text)]
    return "\n\n".join([*library_texts(program, machine, True), *parts, *own]) + "\n"


def _entry(lines: Lines, table: str, k: int) -> str:
    """Return the pointer number k of a table."""
    place = lines.let(f"getelementptr inbounds ptr, ptr {table}, i64 {k}")
    return lines.let(f"load ptr, ptr {place}")


def _rows(lines: Lines, first: str, size: int) -> str:
    """Return where the block's rows begin."""
    start = lines.let(f"mul i64 %number, {lines.width * size}")
    return lines.let(f"getelementptr inbounds double, ptr {first}, i64 {start}")


def _fetch(lines: Lines, rows: str, size: int) -> None:
    """Append that rows of a later block be fetched; where none are, nothing comes of it."""
    for start in range(0, lines.width * size, FETCHED):
        ahead = AHEAD * lines.width * size + start
        place = lines.let(f"getelementptr double, ptr {rows}, i64 {ahead}")
        lines.do(f"call void @llvm.prefetch.p0(ptr {place}, i32 0, i32 3, i32 1)")


def source_text(program: Program, machine: Machine, kind: Kind) -> str:
    """Return the LLVM module of a program of any kind."""
    if kind == "dense":
        return dense_text(program, machine)
    return module_text(program, machine, kind)


def _evaluated(
    lines: Lines, program: Program, machine: Machine, inputs: list[str]
) -> tuple[list[str], list[str]]:
    """Append the evaluation of a program; return the definitions that this needs besides, and the
    names of the results. Sections that are functions read and write blocks in memory."""
    whole = program
    program, plan = cut(program, machine, 1)
    if plan.apart:
        for name, count in (("in", program.n_in), ("out", program.n_out)):
            lines.text.insert(1, f"%{name} = alloca [{count} x {lines.number}], align 64")
        for k, value in enumerate(inputs):
            lines.store(value, "%in", k)
        parts = evaluation("dense", lines, whole, machine, 1)
        return parts, [lines.load("%out", k) for k in range(program.n_out)]
    lines.text.insert(1, f"%kept = alloca [{max(plan.slots, 1)} x {lines.number}], align 64")
    body = RegisterBody(lines, program, plan, inputs)
    for section in plan.sections:
        body.add(section)
        if section.vectors:
            turn(body, section, lines, machine)
    return [], [body.results[place] for place in range(program.n_out)]
