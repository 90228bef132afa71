"""The evaluation of CHUNK states whose rows have no gaps: several blocks are transposed, evaluated
by one call, and transposed back, so that the processor works on one while it moves the next.

    void dense(const double** in, double* out, double* pivots)
"""

from __future__ import annotations

from itertools import accumulate

from linkwork.jax.handler import CHUNK
from linkwork.kernels import Kernel, transposed
from linkwork.kernels.lines import Lines, function_text
from linkwork.kernels.machine import Machine

GROUP = 4  # blocks of a call


def dense_text(kernel: Kernel, machine: Machine) -> str:
    """Return the LLVM function `dense` of a kernel with outputs y and, if it has one, pivot."""
    lines, sizes = Lines(machine.lanes), [size for _, size in kernel.inputs]
    V, size = lines.number, kernel.outputs[0][1]
    lines.do(f"%x = alloca [{GROUP * kernel.n_in} x {V}], align 64")
    lines.do(f"%y = alloca [{GROUP * kernel.n_out} x {V}], align 64")
    for k in range(len(sizes)):
        place = lines.let(f"getelementptr inbounds ptr, ptr %in, i64 {k}")
        lines.do(f"%in.{k} = load ptr, ptr {place}")
    lines.do("br label %group")
    lines.label("group")
    lines.do("%first = phi i64 [ 0, %entry ], [ %first.next, %moved ]")
    lines.do("br label %take")
    # Rows to vectors, block by block.
    _block(lines, "take", "group")
    for k, (own, start) in enumerate(zip(sizes, accumulate(sizes, initial=0), strict=False)):
        transposed.gather(
            lines,
            _row(lines, f"%in.{k}", own, "take"),
            own,
            _vector(lines, "%x", kernel.n_in, start, "take"),
        )
    _again(lines, "take", "taken")
    evaluate = f"inttoptr (i64 {kernel.batch_address} to ptr)"
    lines.do(f"call void {evaluate}(i64 {GROUP}, ptr %x, ptr %y)")
    lines.do("br label %give")
    # And results to rows.
    _block(lines, "give", "taken")
    found = _vector(lines, "%y", kernel.n_out, 0, "give")
    transposed.scatter(lines, found, size, _row(lines, "%out", size, "give"))
    if kernel.n_out > size:
        pivot = lines.load(_vector(lines, "%y", kernel.n_out, size, "give"), 0)
        lines.do(f"store {V} {pivot}, ptr {_row(lines, '%pivots', 1, 'give')}, align 8")
    _again(lines, "give", "moved")
    lines.do(f"%first.next = add i64 %first, {GROUP * machine.lanes}")
    more = lines.let(f"icmp slt i64 %first.next, {CHUNK}")
    lines.do(f"br i1 {more}, label %group, label %done")
    lines.label("done")
    lines.do("ret void")
    head = f"internal void @dense(ptr %in, ptr %out, ptr %pivots) noinline {machine.attributes}"
    return function_text(head, lines.text)


def _block(lines: Lines, name: str, before: str) -> None:
    """Begin the loop of a name over the blocks of a group."""
    lines.label(name)
    lines.do(f"%{name}.block = phi i64 [ 0, %{before} ], [ %{name}.next, %{name} ]")
    lines.do(f"%{name}.lanes = mul i64 %{name}.block, {lines.width}")
    lines.do(f"%{name}.state = add i64 %first, %{name}.lanes")


def _again(lines: Lines, name: str, after: str) -> None:
    lines.do(f"%{name}.next = add i64 %{name}.block, 1")
    more = lines.let(f"icmp slt i64 %{name}.next, {GROUP}")
    lines.do(f"br i1 {more}, label %{name}, label %{after}")
    lines.label(after)


def _row(lines: Lines, rows: str, size: int, loop: str) -> str:
    """Return where the first row of the loop's block begins."""
    start = lines.let(f"mul i64 %{loop}.state, {size}")
    return lines.let(f"getelementptr inbounds double, ptr {rows}, i64 {start}")


def _vector(lines: Lines, vectors: str, size: int, start: int, loop: str) -> str:
    """Return where vector number `start` of the loop's block lies."""
    before = lines.let(f"mul i64 %{loop}.block, {size}")
    return lines.at(vectors, lines.let(f"add i64 {before}, {start}"))
