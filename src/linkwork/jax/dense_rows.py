"""The evaluation of CHUNK states whose rows have no gaps, by the kernel's function for such rows.

    bool chunk(const double** in, const int64_t* strides, double** out)

It tells whether all is well: rows without gaps, pivots above their bound, and finite results, of
which 0 y is summed.
"""

from __future__ import annotations

from linkwork.jax.handler import CHUNK
from linkwork.kernels import Kernel
from linkwork.kernels.lines import Lines, function_text
from linkwork.kernels.machine import Machine
from linkwork.kernels.stored_states import LONG

SHORT = 4000  # operations of kernels whose rows take a part of the time that is felt
TOGETHER, SUMS = 4, 8  # blocks that are looked at in a turn, and sums that grow side by side


def chunk_text(kernel: Kernel, weighed: bool, bound: float, machine: Machine) -> str:
    """Return the LLVM function `chunk` of a kernel with outputs y and, where it is weighed, pivot;
    none where it, or its rows, are so long that nothing is gained.

    bound: of the pivot
    """
    lines, sizes = Lines(machine.lanes), [size for _, size in kernel.inputs]
    V, size = lines.number, kernel.outputs[0][1]
    if kernel.operations > SHORT or max(*sizes, size) > LONG:
        return ""
    # Where everything lies, and whether rows have gaps; pivots are not shown to XLA.
    lines.do(f"%pivots = alloca [{CHUNK} x double], align 64")
    lines.do(f"%found = alloca [{len(kernel.outputs)} x ptr]")
    lines.do("%rows = load ptr, ptr %out")
    lines.do("store ptr %rows, ptr %found")
    if len(kernel.outputs) > 1:
        second = lines.let("getelementptr inbounds ptr, ptr %found, i64 1")
        lines.do(f"store ptr %pivots, ptr {second}")
    # Rows with gaps are left to others.
    dense = "true"
    for k, own in enumerate(sizes):
        place = lines.let(f"getelementptr inbounds i64, ptr %strides, i64 {k}")
        same = lines.let(f"icmp eq i64 {lines.let(f'load i64, ptr {place}')}, {own}")
        dense = lines.let(f"and i1 {dense}, {same}")
    lines.do(f"br i1 {dense}, label %evaluate, label %gaps")
    lines.label("gaps")
    lines.do("ret i1 false")
    lines.label("evaluate")
    evaluate = f"inttoptr (i64 {kernel.dense_address} to ptr)"
    lines.do(f"call void {evaluate}(i64 {CHUNK // machine.lanes}, ptr %in, ptr %found)")
    lines.do("br label %block")
    # Sums of 0 y, which take turns, and whether pivots are strong.
    lines.label("block")
    lines.do("%number = phi i64 [ 0, %evaluate ], [ %number.next, %block ]")
    sums = min(SUMS, TOGETHER * size)
    told = {f"sum.{k}": (V, "zeroinitializer") for k in range(sums)}
    told |= {"strong": (lines.truth, lines.always)} if weighed else {}
    for name, (kind, begin) in told.items():
        lines.do(f"%{name} = phi {kind} [ {begin}, %evaluate ], [ %{name}.next, %block ]")
    # Those of some blocks at a time.
    first = lines.let(f"mul i64 %number, {size * machine.lanes}")
    rows = lines.let(f"getelementptr inbounds double, ptr %rows, i64 {first}")
    _sum(lines, rows, TOGETHER * size, sums)
    strong = "%strong"
    for k in range(TOGETHER * weighed):
        pivot = lines.call("fabs", lines.load("%pivots", lines.let(f"add i64 %number, {k}")))
        own = lines.compare("ogt", pivot, lines.constant(bound))
        strong = lines.let(f"and {lines.truth} {strong}, {own}")
    if weighed:
        lines.do(f"%strong.next = and {lines.truth} {strong}, {lines.always}")
    lines.do(f"%number.next = add i64 %number, {TOGETHER}")
    more = lines.let(f"icmp slt i64 %number.next, {CHUNK // machine.lanes}")
    lines.do(f"br i1 {more}, label %block, label %done")
    # At the end whether all sums are zero.
    lines.label("done")
    well = "%strong.next" if weighed else lines.always
    for k in range(sums):
        finite = lines.compare("ord", f"%sum.{k}.next", f"%sum.{k}.next")
        well = lines.let(f"and {lines.truth} {well}, {finite}")
    every = f"call i1 @llvm.vector.reduce.and.v{lines.width}i1({lines.truth} {well})"
    lines.do(f"ret i1 {lines.let(every)}")
    head = "internal i1 @chunk(ptr %in, ptr %strides, ptr %out) noinline"
    return function_text(f"{head} {machine.attributes}", lines.text)


def _sum(lines: Lines, rows: str, size: int, sums: int) -> None:
    """Append the sums of 0 y with the results of as many states as there are lanes."""
    V = lines.number
    for first in range(sums):
        total, turns = f"%sum.{first}", range(first, size, sums)
        for k in turns:
            place = lines.let(f"getelementptr inbounds double, ptr {rows}, i64 {k * lines.width}")
            value = lines.let(f"load {V}, ptr {place}, align 8")
            given = f"{V} {value}, {V} zeroinitializer, {V} {total}"
            total = f"%sum.{first}.{'next' if k == turns[-1] else k}"
            lines.do(f"{total} = call {V} @llvm.fma.v{lines.width}f64({given})")
