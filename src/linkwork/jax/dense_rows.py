"""The evaluation of CHUNK states whose rows have no gaps: several blocks are transposed, evaluated
by one call, and transposed back; what the next blocks are made of is fetched into the nearest
memory meanwhile.

    bool chunk(const double** in, const int64_t* strides, double** out)

It tells whether all is well: rows without gaps, pivots above their bound, and finite results, of
which 0 y is summed.
"""

from __future__ import annotations

from itertools import accumulate

from linkwork.jax.handler import CHUNK
from linkwork.kernels import Kernel, transposed
from linkwork.kernels.lines import Lines, function_text
from linkwork.kernels.machine import Machine
from linkwork.kernels.stored_states import LONG

GROUP = 4  # blocks of a call
FETCHED = 8  # doubles that memory moves at a time; longer rows come in time by themselves
SUMS = 3  # that the processor makes at a time


def chunk_text(kernel: Kernel, weighed: bool, bound: float, machine: Machine) -> str:
    """Return the LLVM function `chunk` of a kernel with outputs y and, where it is weighed, pivot;
    none where rows are so long that nothing is gained.

    bound: of the pivot
    """
    lines, sizes = Lines(machine.lanes), [size for _, size in kernel.inputs]
    V, size = lines.number, kernel.outputs[0][1]
    if max(*sizes, size) > LONG:
        return ""
    # Where everything lies, and whether rows have gaps.
    lines.do(f"%x = alloca [{GROUP * kernel.n_in} x {V}], align 64")
    lines.do(f"%y = alloca [{GROUP * kernel.n_out} x {V}], align 64")
    lines.do("%rows = load ptr, ptr %out")
    dense = "true"
    for k, own in enumerate(sizes):
        place = lines.let(f"getelementptr inbounds ptr, ptr %in, i64 {k}")
        lines.do(f"%in.{k} = load ptr, ptr {place}")
        place = lines.let(f"getelementptr inbounds i64, ptr %strides, i64 {k}")
        same = lines.let(f"icmp eq i64 {lines.let(f'load i64, ptr {place}')}, {own}")
        dense = lines.let(f"and i1 {dense}, {same}")
    lines.do(f"br i1 {dense}, label %group, label %gaps")
    lines.label("gaps")
    lines.do("ret i1 false")
    # What is told of all states so far: sums, and whether pivots are strong.
    lines.label("group")
    lines.do("%first = phi i64 [ 0, %entry ], [ %first.next, %moved ]")
    sums = min(SUMS, size)
    told = {f"sum.{k}": (V, "zeroinitializer") for k in range(sums)}
    told |= {"strong": (lines.truth, lines.always)} if weighed else {}
    for name, (kind, begin) in told.items():
        lines.do(f"%{name}.group = phi {kind} [ {begin}, %entry ], [ %{name}.next, %moved ]")
    lines.do("br label %take")
    # Rows to vectors, block by block.
    _block(lines, "take", "group")
    for k, (own, start) in enumerate(zip(sizes, accumulate(sizes, initial=0), strict=False)):
        rows = _row(lines, f"%in.{k}", own, "take")
        transposed.gather(lines, rows, own, _vector(lines, "%x", kernel.n_in, start, "take"))
        if own <= FETCHED:
            _fetch(lines, rows, own)
    _again(lines, "take", "taken")
    evaluate = f"inttoptr (i64 {kernel.batch_address} to ptr)"
    lines.do(f"call void {evaluate}(i64 {GROUP}, ptr %x, ptr %y)")
    lines.do("br label %give")
    # Results to rows, and what is told of them.
    _block(lines, "give", "taken")
    for name, (kind, _) in told.items():
        lines.do(f"%{name} = phi {kind} [ %{name}.group, %taken ], [ %{name}.next, %give ]")
    found = _vector(lines, "%y", kernel.n_out, 0, "give")
    transposed.scatter(lines, found, size, _row(lines, "%rows", size, "give"))
    _sum(lines, found, size, sums)
    if weighed:
        pivot = lines.call("fabs", lines.load(found, size))
        strong = lines.compare("ogt", pivot, lines.constant(bound))
        lines.do(f"%strong.next = and {lines.truth} %strong, {strong}")
    _again(lines, "give", "moved")
    # On to the next group; at the end whether all sums are zero.
    lines.do(f"%first.next = add i64 %first, {GROUP * machine.lanes}")
    more = lines.let(f"icmp slt i64 %first.next, {CHUNK}")
    lines.do(f"br i1 {more}, label %group, label %done")
    lines.label("done")
    well = "%strong.next" if weighed else lines.always
    for k in range(sums):
        finite = lines.compare("ord", f"%sum.{k}.next", f"%sum.{k}.next")
        well = lines.let(f"and {lines.truth} {well}, {finite}")
    every = f"call i1 @llvm.vector.reduce.and.v{lines.width}i1({lines.truth} {well})"
    lines.do(f"ret i1 {lines.let(every)}")
    head = "internal i1 @chunk(ptr %in, ptr %strides, ptr %out) noinline"
    return function_text(f"{head} {machine.attributes}", lines.text)


def _block(lines: Lines, name: str, before: str) -> None:
    """Begin the loop of a name over the blocks of a group."""
    lines.label(name)
    lines.do(f"%{name}.block = phi i64 [ 0, %{before} ], [ %{name}.next, %{name} ]")


def _again(lines: Lines, name: str, after: str) -> None:
    lines.do(f"%{name}.next = add i64 %{name}.block, 1")
    more = lines.let(f"icmp slt i64 %{name}.next, {GROUP}")
    lines.do(f"br i1 {more}, label %{name}, label %{after}")
    lines.label(after)


def _sum(lines: Lines, found: str, size: int, sums: int) -> None:
    """Append the sums of 0 y with a block's results, which take turns."""
    V = lines.number
    for first in range(sums):
        total, turns = f"%sum.{first}", range(first, size, sums)
        for k in turns:
            given = f"{V} {lines.load(found, k)}, {V} zeroinitializer, {V} {total}"
            total = f"%sum.{first}.{'next' if k == turns[-1] else k}"
            lines.do(f"{total} = call {V} @llvm.fma.v{lines.width}f64({given})")


def _row(lines: Lines, rows: str, size: int, loop: str) -> str:
    """Return where the first row of the loop's block begins."""
    before = lines.let(f"mul i64 %{loop}.block, {lines.width}")
    start = lines.let(f"mul i64 {lines.let(f'add i64 %first, {before}')}, {size}")
    return lines.let(f"getelementptr inbounds double, ptr {rows}, i64 {start}")


def _vector(lines: Lines, vectors: str, size: int, start: int, loop: str) -> str:
    """Return where vector number `start` of the loop's block lies."""
    before = lines.let(f"mul i64 %{loop}.block, {size}")
    return lines.at(vectors, lines.let(f"add i64 {before}, {start}"))


def _fetch(lines: Lines, rows: str, size: int) -> None:
    """Append that the same block's rows of the next group be fetched; where none are, nothing
    comes of it."""
    for start in range(0, lines.width * size, FETCHED):
        ahead = GROUP * lines.width * size + start
        place = lines.let(f"getelementptr double, ptr {rows}, i64 {ahead}")
        lines.do(f"call void @llvm.prefetch.p0(ptr {place}, i32 0, i32 3, i32 1)")
