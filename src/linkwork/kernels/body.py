"""The instructions of a program's sections, for one number or for a vector of them."""

from collections.abc import Sequence

from linkwork.kernels.fused import NEGATED
from linkwork.kernels.lines import Lines
from linkwork.kernels.program import Operation, Program
from linkwork.kernels.repeats import ARGUMENTS, Part
from linkwork.kernels.sections import FETCHED, Section, SectionPlan

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


class OperationValues:
    """The values of operations by their positions, as numbers or as truths, made when needed; those
    that no operation here computes are fetched."""

    def __init__(self, lines: Lines, nodes: Sequence[Operation]):
        self.lines = lines
        self.nodes = nodes
        self._numbers: dict[int, str] = {}
        self._truths: dict[int, str] = {}

    def number(self, k: int) -> str:
        """Return the name of the value at position k as a number; a truth is 1 or 0."""
        if self.nodes[k].op == "const":
            return self.lines.constant(self.nodes[k].value)
        if k not in self._numbers:
            self._numbers[k] = self._truth_as_number(k) if k in self._truths else self._fetched(k)
        return self._numbers[k]

    def truth(self, k: int) -> str:
        """Return the name of the value at position k as a truth: whether it is not 0."""
        if k not in self._truths:
            self._truths[k] = self.lines.compare("une", self.number(k), self.lines.constant(0.0))
        return self._truths[k]

    def _truth_as_number(self, k: int) -> str:
        return self.lines.select(
            self._truths[k], self.lines.constant(1.0), self.lines.constant(0.0)
        )

    def _fetched(self, k: int) -> str:
        """Append what gives the value at position k from elsewhere."""
        raise NotImplementedError

    def _compute(self, k: int, node: Operation) -> None:
        lines, op, args = self.lines, node.op, node.args
        if op in _COMPARISONS:
            self._truths[k] = lines.compare(_COMPARISONS[op], *map(self.number, args))
        elif op in _LOGICAL:
            self._truths[k] = lines.let(
                f"{op} {lines.truth} {self.truth(args[0])}, {self.truth(args[1])}"
            )
        elif op == "not":
            self._truths[k] = lines.let(f"xor {lines.truth} {self.truth(args[0])}, {lines.always}")
        else:
            self._numbers[k] = self._computed(op, args)

    def _computed(self, op: str, args: tuple[int, ...]) -> str:
        lines = self.lines
        if op in _ARITHMETIC:
            return lines.op(_ARITHMETIC[op], *map(self.number, args))
        if op == "neg":
            return lines.negative(self.number(args[0]))
        if op in NEGATED:
            signed = zip(map(self.number, args), NEGATED[op], strict=True)
            return lines.call("fma", *(lines.negative(x) if minus else x for x, minus in signed))
        if op in _INTRINSICS:
            return lines.call(_INTRINSICS[op], *map(self.number, args))
        if op == "if_else_zero":
            return lines.select(self.truth(args[0]), self.number(args[1]), lines.constant(0.0))
        if op == "select":
            return lines.select(self.truth(args[0]), self.number(args[1]), self.number(args[2]))
        if op == "sign":
            return self._sign(self.number(args[0]))
        prefix = "" if lines.width == 1 else "lanes."
        operands = ", ".join(f"{lines.number} {self.number(a)}" for a in args)
        return lines.let(f"call {lines.number} @{prefix}{op}({operands})")

    def _sign(self, x: str) -> str:
        """Append -1, 1, or x itself where it is 0 or not a number."""
        lines, zero = self.lines, self.lines.constant(0.0)
        positive = lines.select(lines.compare("ogt", x, zero), lines.constant(1.0), x)
        return lines.select(lines.compare("olt", x, zero), lines.constant(-1.0), positive)


class SectionBody(OperationValues):
    """The code of sections, which reads %in and writes %out.

    What other sections compute is read from the slots at `source`, or where it is a result; what
    they need is written to the slots at `target`. So many vectors lie `abreast` in a row of %in and
    of %out; the first `shared` inputs are single numbers for all lanes, and whole vectors follow
    them.
    """

    def __init__(
        self,
        lines: Lines,
        program: Program,
        plan: SectionPlan,
        source: str,
        target: str,
        abreast: int,
        shared: int = 0,
    ):
        super().__init__(lines, program.nodes)
        self.plan = plan
        self.source = source
        self.target = target
        self.abreast = abreast
        self.shared = shared
        self._turned: dict[int, tuple[str, str]] = {}

    def add(self, section: Section) -> None:
        """Append the code of a section but for its sines and cosines."""
        for k in section.nodes:
            if self.nodes[k].op not in FETCHED:
                self._compute(k, self.nodes[k])
            if k in self.plan.kept:
                self.lines.store(self.number(k), self.target, self.plan.kept[k])
        results = {place: k for k in section.nodes for place in self.plan.places.get(k, ())}
        for place in sorted(results):
            self._give(place, self.number(results[place]))

    def _give(self, place: int, number: str) -> None:
        """Write a result."""
        self.lines.store(number, "%out", place * self.abreast)

    def turn(self, angle: int, sine: str, cosine: str) -> None:
        """Take the names of the sine and the cosine of the angle at that position."""
        self._turned[angle] = sine, cosine

    def _fetched(self, k: int) -> str:
        op, args, value = self.nodes[k]
        if op == "input" and value < self.shared:
            return self.lines.single("%in", int(value))
        if op == "input":
            return self.lines.load(
                "%in", vector_place(int(value), self.shared, self.lines.width) * self.abreast
            )
        if op in ("sin", "cos") and args[0] in self._turned:
            return self._turned[args[0]][op == "cos"]
        if op not in FETCHED and k not in self.plan.kept:
            return self.lines.load("%out", self.plan.places[k][0] * self.abreast)
        return self.lines.load(self.source, self.plan.slot(k))


def vector_place(k: int, shared: int, width: int) -> int:
    """Return the place in vectors of input k, behind so many single numbers."""
    return k - shared + -(-shared // width)


class PartBody(OperationValues):
    """The code of a part, which reads its arguments where the places at %row say (offsets in bytes,
    each of 32 bits), and at %numbers."""

    def __init__(self, lines: Lines, part: Part):
        super().__init__(lines, part.nodes)
        self._part = part

    def compute(self) -> None:
        """Append the code of the part."""
        part, inputs, values = self._part, len(self._part.inputs[0]), len(self._part.values[0])
        for k, node in enumerate(part.nodes):
            if node.op not in ARGUMENTS:
                self._compute(k, node)
        first = inputs + values
        for place, k in enumerate(part.kept, start=first):
            self.lines.store_at(self.number(k), self._address("%target", place))
        for place, k in enumerate(part.results, start=first + len(part.kept)):
            self.lines.store_at(self.number(k), self._address("%out", place))

    def _fetched(self, k: int) -> str:
        op, _, value = self.nodes[k]
        if op == "number":
            return self.lines.single("%numbers", int(value))
        if op == "input":
            return self.lines.load_at(self._address("%in", int(value)))
        place = len(self._part.inputs[0]) + int(value)
        return self.lines.load_at(self._address("%source", place))

    def _address(self, pointer: str, place: int) -> str:
        """Append the address that place number `place` of the row says."""
        entry = self.lines.let(f"getelementptr inbounds i32, ptr %row, i64 {place}")
        offset = self.lines.let(f"load i32, ptr {entry}, align 4")
        offset = self.lines.let(f"zext i32 {offset} to i64")
        return self.lines.let(f"getelementptr inbounds i8, ptr {pointer}, i64 {offset}")
