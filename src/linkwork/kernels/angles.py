"""The sines and cosines of many angles, as many at a time as a vector register holds.

    void sines_and_cosines(int64_t vectors, const double* angles, double* sines, double* cosines)

The code of `elementary` holds for angles up to a bound, so the squares of all angles are added up
on the way; if the sum of a lane exceeds the bound squared (or is not a number) the C library
computes those beyond the bound anew. A few angles are computed in place, by the same instructions,
and only if one of them may be too large the function is called.
"""

from functools import reduce

from linkwork.kernels import elementary
from linkwork.kernels.lines import ConstantTable, Lines, function_text
from linkwork.kernels.machine import Machine

FUNCTION = "sines_and_cosines"
UNLIKELY = '!prof !{!"branch_weights", i32 1, i32 1000000}'


def in_place(
    lines: Lines, angles: list[str], memory: str, first: int, machine: Machine
) -> list[tuple[str, str]]:
    """Append the sines and cosines of a few vectors of angles and return their names.

    lines: of vectors.  memory: pointer to vectors, of which those from `first` on are for the case
    that an angle is too large: all angles, their sines and their cosines.
    """
    near = [elementary.sine_and_cosine(lines, angle, machine.has_fma) for angle in angles]
    product_plus = elementary.product_plus(machine.has_fma)
    total = reduce(
        lambda total, x: product_plus(lines, x, x, total),
        angles[1:],
        lines.op("fmul", angles[0], angles[0]),
    )
    start, mark, n = lines.block, len(lines.text), len(angles)
    lines.do(
        f"br i1 {_too_large(lines, total, machine)}, label %far.{mark}, label %near.{mark}, "
        f"{UNLIKELY}"
    )
    lines.label(f"far.{mark}")
    for k, angle in enumerate(angles):
        lines.store(angle, memory, first + k)
    by_call(lines, n, memory, first)
    far = [
        (lines.load(memory, first + n + k), lines.load(memory, first + 2 * n + k)) for k in range(n)
    ]
    lines.do(f"br label %near.{mark}")
    lines.label(f"near.{mark}")
    return [
        (
            lines.phi(sine, start, far_sine, f"far.{mark}"),
            lines.phi(cosine, start, far_cosine, f"far.{mark}"),
        )
        for (sine, cosine), (far_sine, far_cosine) in zip(near, far, strict=True)
    ]


def by_call(lines: Lines, n: int, memory: str, first: int) -> None:
    """Append the call of the function for n vectors of angles in memory, from `first` on; their
    sines and cosines follow."""
    pointers = ", ".join(f"ptr {lines.at(memory, first + k * n)}" for k in range(3))
    lines.do(f"call void @{FUNCTION}(i64 {n}, {pointers})")


def sines_and_cosines_text(machine: Machine) -> str:
    """Return the LLVM function for any number of angles."""
    lines = Lines(machine.lanes, ConstantTable.of(FUNCTION, machine))
    lines.do("br label %near")
    lines.label("near")
    lines.do("%k = phi i64 [ 0, %entry ], [ %k.next, %near ]")
    lines.do(f"%total = phi {lines.number} [ zeroinitializer, %entry ], [ %total.next, %near ]")
    angle = lines.load("%angles", "%k")
    square = lines.op("fmul", angle, angle)
    lines.do(f"%total.next = fadd {lines.number} %total, {square}")
    sine, cosine = elementary.sine_and_cosine(lines, angle, machine.has_fma)
    lines.store(sine, "%sines", "%k")
    lines.store(cosine, "%cosines", "%k")
    lines.do("%k.next = add nuw nsw i64 %k, 1")
    lines.do("%k.more = icmp ult i64 %k.next, %vectors")
    lines.do("br i1 %k.more, label %near, label %test")
    lines.label("test")
    lines.do(f"%numbers = mul i64 %vectors, {machine.lanes}")
    lines.do(
        f"br i1 {_too_large(lines, '%total.next', machine)}, label %far, label %done, {UNLIKELY}"
    )
    _again(lines.of_width(1), largest(machine))
    lines.label("done")
    lines.do("ret void")
    pointers = ", ".join(
        f"ptr noalias nonnull {name}" for name in ("%angles", "%sines", "%cosines")
    )
    head = f"internal void @{FUNCTION}(i64 %vectors, {pointers}) noinline {machine.attributes}"
    return lines.table_text() + function_text(head, lines.text)


def _again(lines: Lines, bound: float) -> None:
    """Append the loop over single angles that has the C library compute those beyond the bound."""
    lines.label("far")
    lines.do("%i = phi i64 [ 0, %test ], [ %i.next, %skip ]")
    angle = lines.load("%angles", "%i")
    lines.do(f"%small = fcmp ole double {lines.call('fabs', angle)}, {lines.constant(bound)}")
    lines.do("br i1 %small, label %skip, label %library")
    lines.label("library")
    for name, results in (("sin", "%sines"), ("cos", "%cosines")):
        lines.store(lines.let(f"call double @{name}(double {angle})"), results, "%i")
    lines.do("br label %skip")
    lines.label("skip")
    lines.do("%i.next = add nuw nsw i64 %i, 1")
    lines.do("%i.more = icmp ult i64 %i.next, %numbers")
    lines.do("br i1 %i.more, label %far, label %done")


def _too_large(lines: Lines, total: str, machine: Machine) -> str:
    """Append the test whether an angle may be beyond the bound, from the sums of squares of all
    lanes."""
    beyond = lines.compare("ugt", total, lines.constant(largest(machine) ** 2))
    mask = lines.let(f"bitcast {lines.truth} {beyond} to i{lines.width}")
    return lines.let(f"icmp ne i{lines.width} {mask}, 0")


def largest(machine: Machine) -> float:
    """Return the angle from which on the C library computes."""
    return elementary.LARGEST_ANGLE if machine.has_fma else elementary.LARGEST_ANGLE_WITHOUT_FMA
