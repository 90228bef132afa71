"""A program written as LLVM instructions: one function for one state, one for blocks of them (and `rows`, which uses it).

    void one(const double* in, double* out)
    void batch(int64_t blocks, const double* in, double* out)    in[block][n_in][lanes], out[block][n_out][lanes]

The first two come from one walk over the program, for double and for <lanes x double>, without a branch but one at the end:
the sine and cosine of `elementary` hold for angles up to a bound, so the squares of all angles are added up on the way, and
a lane whose sum exceeds the bound squared (or is not a number) is computed again by `exact`, the same program with the C
library's sine and cosine. Functions that are not inlined are calls of the C library, lane by lane.
"""

from collections.abc import Callable

from linkwork.kernels import elementary
from linkwork.kernels.lines import Lines, function_text
from linkwork.kernels.machine import Machine
from linkwork.kernels.program import Node, Program
from linkwork.kernels.rows import rows_text

# The C library's functions of one and of two numbers, by their names there.
LIBRARY = {
    name: arity
    for arity, names in (
        (1, "sin cos asin acos atan sinh cosh tanh asinh acosh atanh exp log log1p expm1 erf"),
        (2, "atan2 pow fmod remainder hypot"),
    )
    for name in names.split()
}

_ARITHMETIC = {"add": "fadd", "sub": "fsub", "mul": "fmul", "div": "fdiv"}
_INTRINSICS = {
    "sqrt": "sqrt",
    "fabs": "fabs",
    "floor": "floor",
    "ceil": "ceil",
    "copysign": "copysign",
    "fmin": "minnum",
    "fmax": "maxnum",
}
_COMPARISONS = {"lt": "olt", "le": "ole", "eq": "oeq", "ne": "une"}
_LOGICAL = {"and": "and", "or": "or"}


def module_text(program: Program, machine: Machine) -> str:
    """Return the LLVM module with the functions `one`, `batch` and `rows` of a program."""
    called = sorted({node.op for node in program.nodes if node.op in LIBRARY})
    parts = [f"declare double @{name}({', '.join(['double'] * LIBRARY[name])})" for name in called]
    parts += [_lane_by_lane(name, machine.lanes) for name in called if name not in ("sin", "cos")]
    parts += [_one(program, machine), _batch(program, machine), rows_text(program, machine.lanes), _COPY]
    if "sin" in called or "cos" in called:
        parts += [_exact(program), _exact_lanes(program, machine.lanes)]
    return "\n\n".join(parts) + "\n"


class _Body:
    """The instructions of one evaluation: values by position in the program, as numbers or as truths, made when needed."""

    def __init__(self, lines: Lines, load: Callable[[int], str], machine: Machine | None):
        self.lines = lines
        self.load = load
        self.machine = machine
        self.sum_of_squares: str | None = None
        self._constants: dict[int, float] = {}
        self._numbers: dict[int, str] = {}
        self._truths: dict[int, str] = {}
        self._angles: dict[int, tuple[str, str]] = {}

    def number(self, k: int) -> str:
        """Return the name of the value at position k as a number; a truth is 1 or 0."""
        if k in self._constants:
            return self.lines.constant(self._constants[k])
        if k not in self._numbers:
            self._numbers[k] = self.lines.select(self._truths[k], self.lines.constant(1.0), self.lines.constant(0.0))
        return self._numbers[k]

    def truth(self, k: int) -> str:
        """Return the name of the value at position k as a truth: whether it is not 0."""
        if k not in self._truths:
            self._truths[k] = self.lines.compare("une", self.number(k), self.lines.constant(0.0))
        return self._truths[k]

    def add(self, k: int, node: Node) -> None:
        """Append the code of the node at position k."""
        lines, op, args = self.lines, node.op, node.args
        if op == "const":
            self._constants[k] = node.value
        elif op in _COMPARISONS:
            self._truths[k] = lines.compare(_COMPARISONS[op], *map(self.number, args))
        elif op in _LOGICAL:
            self._truths[k] = lines.let(f"{op} {lines.truth} {self.truth(args[0])}, {self.truth(args[1])}")
        elif op == "not":
            self._truths[k] = lines.let(f"xor {lines.truth} {self.truth(args[0])}, {lines.always}")
        else:
            self._numbers[k] = self._number_of(node)

    def _number_of(self, node: Node) -> str:
        lines, op, args = self.lines, node.op, node.args
        if op == "input":
            return self.load(int(node.value))
        if op in _ARITHMETIC:
            return lines.op(_ARITHMETIC[op], *map(self.number, args))
        if op == "neg":
            return lines.let(f"fneg {lines.number} {self.number(args[0])}")
        if op in _INTRINSICS:
            return lines.call(_INTRINSICS[op], *map(self.number, args))
        if op == "if_else_zero":
            return lines.select(self.truth(args[0]), self.number(args[1]), lines.constant(0.0))
        if op == "select":
            return lines.select(self.truth(args[0]), self.number(args[1]), self.number(args[2]))
        if op == "sign":
            return self._sign(self.number(args[0]))
        if op in ("sin", "cos") and self.machine:
            return self._sine_and_cosine(args[0], self.machine.has_fma)[op == "cos"]
        prefix = "" if lines.width == 1 else "lanes."
        operands = ", ".join(f"{lines.number} {self.number(a)}" for a in args)
        return lines.let(f"call {lines.number} @{prefix}{op}({operands})")

    def _sign(self, x: str) -> str:
        """Append -1, 1, or x itself where it is 0 or not a number."""
        lines, zero = self.lines, self.lines.constant(0.0)
        positive = lines.select(lines.compare("ogt", x, zero), lines.constant(1.0), x)
        return lines.select(lines.compare("olt", x, zero), lines.constant(-1.0), positive)

    def _sine_and_cosine(self, k: int, has_fma: bool) -> tuple[str, str]:
        if k not in self._angles:
            x = self.number(k)
            so_far = self.sum_of_squares or self.lines.constant(0.0)
            self.sum_of_squares = self.lines.op("fadd", self.lines.op("fmul", x, x), so_far)
            self._angles[k] = elementary.sine_and_cosine(self.lines, x, has_fma)
        return self._angles[k]


def _evaluation(program: Program, width: int, machine: Machine | None) -> _Body:
    """Return the code that reads %in, evaluates the program and writes %out; entry k of a block is at k * width.

    Sines and cosines are inlined for the machine, or calls of the C library where it is None.
    """
    lines = Lines(width, f"constants.{width}" if machine and machine.has_memory_operands else None)
    size = 8 * width

    def load(k: int) -> str:
        place = lines.let(f"getelementptr inbounds double, ptr %in, i64 {k * width}")
        return lines.let(f"load {lines.number}, ptr {place}, align {size}")

    body = _Body(lines, load, machine)
    for k, node in enumerate(program.nodes):
        body.add(k, node)
    for k, result in enumerate(program.results):
        value = body.number(result)
        place = lines.let(f"getelementptr inbounds double, ptr %out, i64 {k * width}")
        lines.do(f"store {lines.number} {value}, ptr {place}, align {size}")
    return body


def _out_of_range(body: _Body, has_fma: bool) -> str | None:
    """Append and return the truth whether an angle may be too large for the inlined sine and cosine; None without angles."""
    if body.sum_of_squares is None:
        return None
    bound = elementary.LARGEST_ANGLE if has_fma else elementary.LARGEST_ANGLE_WITHOUT_FMA
    return body.lines.compare("ugt", body.sum_of_squares, body.lines.constant(bound**2))


_POINTERS = "ptr noalias nonnull readonly {0}, ptr noalias nonnull writeonly {1}"
# Let LLVM use the whole width of AVX-512, also where it would take half of it by default.
_WIDE = {2: "", 4: "", 8: '"prefer-vector-width"="512" "min-legal-vector-width"="512"'}
_UNLIKELY = '!prof !{!"branch_weights", i32 1, i32 1000000}'


def _one(program: Program, machine: Machine) -> str:
    body = _evaluation(program, 1, machine)
    far = _out_of_range(body, machine.has_fma)
    end = ["ret void"]
    if far:
        end = [
            f"br i1 {far}, label %far, label %near, {_UNLIKELY}",
            "far:",
            "call void @exact(ptr %in, ptr %out)",
            "ret void",
            "near:",
            "ret void",
        ]
    head = f"void @one({_POINTERS.format('%in', '%out')}) nounwind"
    return body.lines.table_text() + function_text(head, ["entry:", *body.lines.text, *end])


def _batch(program: Program, machine: Machine) -> str:
    lanes = machine.lanes
    body = _evaluation(program, lanes, machine)
    far = _out_of_range(body, machine.has_fma)
    text = body.lines.text
    last = "loop"
    if far:
        text += [
            f"%far.bits = bitcast {body.lines.truth} {far} to i{lanes}",
            f"%far.any = icmp ne i{lanes} %far.bits, 0",
            f"br i1 %far.any, label %far, label %next, {_UNLIKELY}",
            "far:",
            f"%far.mask = zext i{lanes} %far.bits to i64",
            "call void @exact_lanes(i64 %far.mask, ptr %in, ptr %out)",
            "br label %next",
            "next:",
        ]
        last = "next"
    loop = [
        "entry:",
        "%some = icmp sgt i64 %blocks, 0",
        "br i1 %some, label %loop, label %done",
        "loop:",
        f"%left = phi i64 [ %blocks, %entry ], [ %left.next, %{last} ]",
        f"%in = phi ptr [ %in.first, %entry ], [ %in.next, %{last} ]",
        f"%out = phi ptr [ %out.first, %entry ], [ %out.next, %{last} ]",
        *text,
        f"%in.next = getelementptr inbounds double, ptr %in, i64 {program.n_in * lanes}",
        f"%out.next = getelementptr inbounds double, ptr %out, i64 {program.n_out * lanes}",
        "%left.next = add nsw i64 %left, -1",
        "%more = icmp ne i64 %left.next, 0",
        "br i1 %more, label %loop, label %done",
        "done:",
        "ret void",
    ]
    head = f"void @batch(i64 %blocks, {_POINTERS.format('%in.first', '%out.first')}) nounwind {_WIDE[lanes]}"
    return body.lines.table_text() + function_text(head, loop)


def _exact(program: Program) -> str:
    body = _evaluation(program, 1, None)
    head = "internal void @exact(ptr noalias %in, ptr noalias %out) noinline optnone cold nounwind"
    return function_text(head, ["entry:", *body.lines.text, "ret void"])


def _exact_lanes(program: Program, lanes: int) -> str:
    """Evaluate those lanes of one block whose bit in the mask is set."""
    text = [
        "entry:",
        f"%x = alloca [{max(program.n_in, 1)} x double], align 64",
        f"%y = alloca [{max(program.n_out, 1)} x double], align 64",
        "br label %lane",
        "lane:",
        "%k = phi i64 [ 0, %entry ], [ %k.next, %skip ]",
        "%bit = shl i64 1, %k",
        "%masked = and i64 %mask, %bit",
        "%chosen = icmp ne i64 %masked, 0",
        "br i1 %chosen, label %evaluate, label %skip",
        "evaluate:",
        "%from = getelementptr inbounds double, ptr %in, i64 %k",
        f"call void @copy(i64 {program.n_in}, ptr %from, i64 {lanes}, ptr %x, i64 1)",
        "call void @exact(ptr %x, ptr %y)",
        "%to = getelementptr inbounds double, ptr %out, i64 %k",
        f"call void @copy(i64 {program.n_out}, ptr %y, i64 1, ptr %to, i64 {lanes})",
        "br label %skip",
        "skip:",
        "%k.next = add i64 %k, 1",
        f"%again = icmp ult i64 %k.next, {lanes}",
        "br i1 %again, label %lane, label %done",
        "done:",
        "ret void",
    ]
    head = "internal void @exact_lanes(i64 %mask, ptr noalias %in, ptr noalias %out) noinline cold nounwind"
    return function_text(head, text)


_COPY = """define internal void @copy(i64 %n, ptr %from, i64 %from.step, ptr %to, i64 %to.step) nounwind {
entry:
  br label %test
test:
  %k = phi i64 [ 0, %entry ], [ %k.next, %step ]
  %more = icmp slt i64 %k, %n
  br i1 %more, label %step, label %done
step:
  %i = mul i64 %k, %from.step
  %j = mul i64 %k, %to.step
  %source = getelementptr inbounds double, ptr %from, i64 %i
  %target = getelementptr inbounds double, ptr %to, i64 %j
  %x = load double, ptr %source
  store double %x, ptr %target
  %k.next = add i64 %k, 1
  br label %test
done:
  ret void
}"""


def _lane_by_lane(name: str, lanes: int) -> str:
    """Return the vector function that calls the C library's function of that name for each lane."""
    lines = Lines(lanes)
    arguments = ["%x", "%y"][: LIBRARY[name]]
    result = "poison"
    for k in range(lanes):
        entries = [lines.let(f"extractelement {lines.number} {a}, i64 {k}") for a in arguments]
        value = lines.let(f"call double @{name}({', '.join(f'double {e}' for e in entries)})")
        result = lines.let(f"insertelement {lines.number} {result}, double {value}, i64 {k}")
    parameters = ", ".join(f"{lines.number} {a}" for a in arguments)
    head = f"internal {lines.number} @lanes.{name}({parameters}) noinline nounwind {_WIDE[lanes]}"
    return function_text(head, ["entry:", *lines.text, f"ret {lines.number} {result}"])
