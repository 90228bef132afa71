"""The parts of a handler that evaluate a kernel, `block` and `chunk`, by the kernel's own function
for rows.

A state is refused where the weakest relative pivot is at or below its bound, or where a result is
not finite: 0 x is not zero there.
"""

from __future__ import annotations

from linkwork.jax.handler import UNDEFINED, WEAK
from linkwork.kernels import Kernel
from linkwork.kernels.lines import Lines, function_text
from linkwork.kernels.machine import Machine


def block_text(kernel: Kernel, weighed: bool, bound: float, machine: Machine) -> str:
    """Return the LLVM function `block` of a kernel with outputs y and, where it is weighed, pivot.

    bound: of the pivot
    """
    lines = Lines(machine.lanes)
    size = kernel.outputs[0][1]
    lines.do(f"%x = alloca [{kernel.n_in} x {lines.number}], align 64")
    lines.do(f"%y = alloca [{kernel.n_out} x {lines.number}], align 64")
    # The pivots of a block are not shown to XLA; they are looked at in y.
    lines.do(f"%pivots = alloca [{machine.lanes} x double], align 64")
    lines.do("%rows = alloca [2 x ptr]")
    lines.do(f"store ptr {lines.let('load ptr, ptr %out')}, ptr %rows")
    second = lines.let("getelementptr inbounds ptr, ptr %rows, i64 1")
    lines.do(f"store ptr %pivots, ptr {second}")
    evaluate = f"inttoptr (i64 {kernel.rows_address} to ptr)"
    given = "ptr %in, ptr %strides, ptr %rows, ptr %x, ptr %y"
    lines.do(f"call void {evaluate}(i64 %states, {given})")
    found = lines.let(f"call {lines.number} @zero_if_finite(ptr %y, i64 {size})")
    pivot = lines.call("fabs", lines.load("%y", size)) if weighed else "zeroinitializer"
    refused = bits(lines, lines.compare("uno", found, pivot), UNDEFINED)
    if weighed:
        weak = lines.compare("ole", pivot, lines.constant(bound))
        refused = lines.let(f"or i64 {refused}, {bits(lines, weak, WEAK)}")
    lines.do(f"ret i64 {refused}")
    head = "internal i64 @block(i64 %states, ptr %in, ptr %strides, ptr %out) noinline"
    own = function_text(f"{head} {machine.attributes}", lines.text)
    return f"{finite_text(machine)}\n\n{own}"


def finite_text(machine: Machine) -> str:
    """Return the function that sums 0 y over vectors y: zero of a state where all are finite, else
    NaN."""
    V, align = Lines(machine.lanes).number, 8 * machine.lanes
    return f"""define internal {V} @zero_if_finite(ptr %y, i64 %n) noinline {machine.attributes} {{
entry:
  br label %next
next:
  %i = phi i64 [ 0, %entry ], [ %i.next, %next ]
  %sum = phi {V} [ zeroinitializer, %entry ], [ %sum.next, %next ]
  %place = getelementptr inbounds {V}, ptr %y, i64 %i
  %value = load {V}, ptr %place, align {align}
  %none = fmul {V} %value, zeroinitializer
  %sum.next = fadd {V} %sum, %none
  %i.next = add i64 %i, 1
  %more = icmp slt i64 %i.next, %n
  br i1 %more, label %next, label %done
done:
  ret {V} %sum.next
}}"""


def bits(lines: Lines, truth: str, shift: int) -> str:
    """Return a truth of each state as bits of a whole number, from bit number `shift` on."""
    packed = lines.let(f"bitcast {lines.truth} {truth} to i{lines.width}")
    number = lines.let(f"zext i{lines.width} {packed} to i64")
    return lines.let(f"shl i64 {number}, {shift}")
