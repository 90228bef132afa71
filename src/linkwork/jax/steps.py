"""The blocks of handlers that close loops, and that take a step, for as many states as a vector
register holds.

    q <- closure_step(q)                                     until |phi| is rounding

    k_i = f(y_i, u),  y_(i+1) = y + c_i h k_i,  y <- y + h (k_1 + 2 k_2 + 2 k_3 + k_4) / 6
    q <- closure_step(closure_step(q))

A step is refused where the weakest relative pivot is at or below its bound, or changes its sign:
there the rates cease to determine the motion on the way.
"""

from __future__ import annotations

from collections.abc import Sequence

from linkwork.autodiff.runge_kutta import CLOSURES, STAGES
from linkwork.jax.evaluation import bits, finite_text
from linkwork.jax.handler import UNDEFINED, WEAK
from linkwork.kernels import Kernel
from linkwork.kernels.lines import Lines, function_text
from linkwork.kernels.machine import Machine
from linkwork.kernels.stored_states import moves_text

HEAD = "internal i64 @block(i64 %states, ptr %in, ptr %strides, ptr %out) noinline"


def closing_text(closure: Kernel, most: int, rounding: float, machine: Machine) -> str:
    """Return `block`, and what it calls, for q[, p] -> q with its loops closed.

    closure: the kernel of q[, p] -> q after one Newton step, and the residual before it
    most: Newton steps; rounding: residual at which they end
    """
    lines, nq = Lines(machine.lanes), closure.inputs[0][1]
    sizes = [size for _, size in closure.inputs]
    _room(lines, x=closure.n_in, y=closure.n_out)
    lines.do("%last = sub i64 %states, 1")
    _gather(lines, dict(enumerate(sizes)), "%x")
    lines.do("br label %newton")
    lines.label("newton")
    lines.do("%step = phi i64 [ 0, %entry ], [ %step.next, %onward ]")
    _call(lines, closure, "%x", "%y")
    gap = lines.load("%y", nq)
    opened = bits(lines, lines.compare("ogt", gap, lines.constant(rounding)), WEAK)
    ended = lines.let(f"icmp eq i64 {opened}, 0")
    spent = lines.let(f"icmp sge i64 %step, {most}")
    lines.do(f"br i1 {lines.let(f'or i1 {ended}, {spent}')}, label %done, label %onward")
    lines.label("onward")
    lines.do(f"call void @copy(ptr %x, ptr %y, i64 {nq})")
    lines.do("%step.next = add i64 %step, 1")
    lines.do("br label %newton")
    lines.label("done")
    sound = lines.let(f"call {lines.number} @zero_if_finite(ptr %x, i64 {closure.n_in})")
    unsound = bits(lines, lines.compare("uno", gap, sound), UNDEFINED)
    _scatter(lines, [nq], "%x")
    lines.do(f"ret i64 {lines.let(f'or i64 {opened}, {unsound}')}")
    head = f"{HEAD} {machine.attributes}"
    parts = [moves_text(machine), *_sums(machine), finite_text(machine)]
    return "\n\n".join([*parts, function_text(head, lines.text)])


def passing_text(nq: int, machine: Machine) -> str:
    """Return `block`, and what it calls, for q -> q where there is nothing to close."""
    lines = Lines(machine.lanes)
    _room(lines, x=nq)
    lines.do("%last = sub i64 %states, 1")
    _gather(lines, {0: nq}, "%x")
    sound = lines.let(f"call {lines.number} @zero_if_finite(ptr %x, i64 {nq})")
    unsound = bits(lines, lines.compare("uno", sound, sound), UNDEFINED)
    _scatter(lines, [nq], "%x")
    lines.do(f"ret i64 {unsound}")
    own = function_text(f"{HEAD} {machine.attributes}", lines.text)
    return "\n\n".join([moves_text(machine), finite_text(machine), own])


def step_text(
    motion: Kernel, closure: Kernel | None, bound: float, loose: float, machine: Machine
) -> str:
    """Return `block`, and what it calls, for q, v, u, h[, p] -> q, v after a step.

    motion: the kernel of q, v, u[, p] -> q', v', pivot; closure: as for `closing_text`, None where
        there is nothing to close
    bound: of the pivot; loose: residual from which on loops count as open
    """
    lines = Lines(machine.lanes)
    nq, n, nu, *free = [size for _, size in motion.inputs]
    rows, V = nq + n, lines.number
    _room(lines, x=motion.n_in, k=motion.n_out, y=rows, sum=rows, h=1)
    lines.do("%last = sub i64 %states, 1")
    # What is given, but for h, lies in the motion's input as it is; the state is kept beside.
    places = {0: nq, 1: n, 2: nu} | ({4: free[0]} if free else {})
    _gather(lines, places, "%x")
    _gather(lines, {3: 1}, "%h")
    lines.do(f"call void @copy(ptr %y, ptr %x, i64 {rows})")
    lines.do(f"call void @copy(ptr %sum, ptr %x, i64 {rows})")
    # Stage by stage: the slope, whether its pivot is weak or has changed its sign, and the sum.
    h = lines.load("%h", 0)
    sixth = lines.op("fdiv", h, lines.constant(6.0))
    weak, first = "0", ""
    for along, weight in STAGES:
        _call(lines, motion, "%x", "%k")
        pivot = lines.load("%k", rows)
        first = first or pivot
        size = lines.call("fabs", pivot)
        little = lines.compare("ole", size, lines.constant(bound))
        other = lines.compare("olt", lines.op("fmul", pivot, first), lines.constant(0.0))
        either = lines.let(f"or {lines.truth} {little}, {other}")
        weak = lines.let(f"or i64 {weak}, {bits(lines, either, WEAK)}")
        share = lines.op("fmul", sixth, lines.constant(weight))
        lines.do(f"call void @add(ptr %sum, ptr %sum, {V} {share}, ptr %k, i64 {rows})")
        if along:
            reach = lines.op("fmul", h, lines.constant(along))
            lines.do(f"call void @add(ptr %x, ptr %y, {V} {reach}, ptr %k, i64 {rows})")
    # The loops are closed, and all is told in bits: weak, open or not finite.
    opened = _closed(lines, closure, nq, free, motion.n_in, loose) if closure else "0"
    sound = lines.let(f"call {V} @zero_if_finite(ptr %sum, i64 {rows})")
    unsound = bits(lines, lines.compare("uno", sound, sound), UNDEFINED)
    _scatter(lines, [nq, n], "%sum")
    refused = lines.let(f"or i64 {weak}, {opened}")
    lines.do(f"ret i64 {lines.let(f'or i64 {refused}, {unsound}')}")
    head = f"{HEAD} {machine.attributes}"
    parts = [moves_text(machine), *_sums(machine), finite_text(machine)]
    return "\n\n".join([*parts, function_text(head, lines.text)])


def _closed(
    lines: Lines, closure: Kernel, nq: int, free: Sequence[int], n_in: int, loose: float
) -> str:
    """Append the Newton steps on the q at the head of %sum; return the states whose loops are
    open."""
    _room(lines, c=closure.n_in, d=closure.n_out)
    lines.do(f"call void @copy(ptr %c, ptr %sum, i64 {nq})")
    if free:
        given, own = lines.at("%x", n_in - free[0]), lines.at("%c", nq)
        lines.do(f"call void @copy(ptr {own}, ptr {given}, i64 {free[0]})")
    for _ in range(CLOSURES):
        _call(lines, closure, "%c", "%d")
        lines.do(f"call void @copy(ptr %c, ptr %d, i64 {nq})")
    lines.do(f"call void @copy(ptr %sum, ptr %c, i64 {nq})")
    _call(lines, closure, "%c", "%d")
    gap = lines.load("%d", nq)
    return bits(lines, lines.compare("ogt", gap, lines.constant(loose)), WEAK)


def _room(lines: Lines, **sizes: int) -> None:
    """Append the memory of blocks, by their names."""
    for name, size in sizes.items():
        lines.do(f"%{name} = alloca [{max(size, 1)} x {lines.number}], align 64")


def _gather(lines: Lines, sizes: dict[int, int], block: str) -> None:
    """Append the moves of some inputs, by number, to a block, one after the other."""
    start = 0
    for k, size in sizes.items():
        rows = lines.let(f"load ptr, ptr {lines.let(f'getelementptr ptr, ptr %in, i64 {k}')}")
        step = lines.let(f"load i64, ptr {lines.let(f'getelementptr i64, ptr %strides, i64 {k}')}")
        _move(lines, "gather", size, rows, step, lines.at(block, start))
        start += size


def _scatter(lines: Lines, sizes: Sequence[int], block: str) -> None:
    """Append the moves of the parts of a block to the results."""
    start = 0
    for k, size in enumerate(sizes):
        rows = lines.let(f"load ptr, ptr {lines.let(f'getelementptr ptr, ptr %out, i64 {k}')}")
        _move(lines, "scatter", size, rows, str(size), lines.at(block, start))
        start += size


def _move(lines: Lines, move: str, size: int, rows: str, step: str, place: str) -> None:
    given = f"i64 {size}, ptr {rows}, i64 {step}, i64 0, i64 %last, ptr {place}"
    lines.do(f"call void @{move}({given})")


def _call(lines: Lines, kernel: Kernel, x: str, y: str) -> None:
    function = f"inttoptr (i64 {kernel.batch_address} to ptr)"
    lines.do(f"call void {function}(i64 1, ptr {x}, ptr {y})")


def _sums(machine: Machine) -> list[str]:
    """Return the functions  to = from  and  to = y + scale k  of vectors of vectors."""
    lines = Lines(machine.lanes)
    V, align = lines.number, 8 * machine.lanes
    loop = f"""entry:
  %some = icmp sgt i64 %n, 0
  br i1 %some, label %next, label %done
next:
  %i = phi i64 [ 0, %entry ], [ %i.next, %next ]
  %from = getelementptr inbounds {V}, ptr %y, i64 %i
  %value = load {V}, ptr %from, align {align}
BODY  %into = getelementptr inbounds {V}, ptr %to, i64 %i
  store {V} RESULT, ptr %into, align {align}
  %i.next = add i64 %i, 1
  %more = icmp slt i64 %i.next, %n
  br i1 %more, label %next, label %done
done:
  ret void
}}"""
    added = f"""  %change.at = getelementptr inbounds {V}, ptr %k, i64 %i
  %change = load {V}, ptr %change.at, align {align}
  %step = fmul contract {V} %scale, %change
  %moved = fadd contract {V} %value, %step
"""
    attributes = machine.attributes
    return [
        f"define internal void @copy(ptr %to, ptr %y, i64 %n) noinline {attributes} {{\n"
        + loop.replace("BODY", "").replace("RESULT", "%value"),
        f"define internal void @add(ptr %to, ptr %y, {V} %scale, ptr %k, i64 %n) noinline "
        f"{attributes} {{\n" + loop.replace("BODY", added).replace("RESULT", "%moved"),
    ]
