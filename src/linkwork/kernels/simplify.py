"""Rewrite a program into one with fewer operations and the same values.

One pass carries, for every value, the pair (sign, position): the value is sign * node. With that,

- negations travel to where they are free: (-a) b = -(a b), a + (-b) = a - b, sin(-a) = -sin a,
  cos(-a) = cos a;
- equal values are found whatever their sign and the order of commuting operands (value numbering);
- constants are folded, x + 0, x * 1, x / 1 disappear, c (d x) becomes (c d) x, and x / c becomes x
  * (1/c) where that is exact;
- (c ? x : 0) + (not c ? y : 0) becomes one choice;
- tan a = sin a / cos a, since the sine and the cosine of one angle are emitted together.

A second pass shares the reciprocals, x/d, y/d -> r = 1/d, x r, y r, and what no result needs is
dropped. Each rule keeps the value but for the sign of a zero and, for c (d x), x r and tan, one
more rounding; no product with 0 and no difference of equals is folded, since the value may not be
finite.
"""

import math
import struct
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from linkwork.kernels.program import Operation, Program

_ODD = frozenset(("sin", "asin", "atan", "sinh", "tanh", "asinh", "atanh", "erf"))
_EVEN = frozenset(("cos", "cosh", "fabs"))
_COMMUTING = frozenset(("add", "mul", "hypot", "eq", "ne", "and", "or"))
_SMALLEST_NORMAL = 2.0**-1022
STRETCH = 500
"""Number of nodes within which values are ordered by their depth."""
LARGE = 16 * STRETCH
"""Number of nodes from which on a program is cut into `sections` first."""


def simplify(program: Program) -> Program:
    """Return a program with the same inputs and results, to rounding, and fewer operations."""
    once = _ordered(_rewrite(program, shared=frozenset()))
    return _ordered(_rewrite(once, shared=_shared_denominators(once)))


def _ordered(program: Program) -> Program:
    """Drop the nodes that no result needs and put the rest in an order that is quick to execute.

    Depth first, the operand with the longest chain of operations before the others, so that a value
    is computed near its use; then, but in a LARGE program, within each stretch of STRETCH nodes by
    the length of that chain, so that operations that do not wait for each other are neighbours.
    """
    depths = chain_lengths(program.nodes)
    order = depth_first(program, depths)
    if len(order) <= LARGE:
        order = by_stretches(order, depths)
    return reordered(program, order)


def reordered(program: Program, order: Sequence[int]) -> Program:
    """Return a program whose nodes stand in another order, those alone that this has."""
    places = {k: place for place, k in enumerate(order)}
    nodes = [
        Operation(op, tuple([places[a] for a in args]), value)
        for op, args, value in map(program.nodes.__getitem__, order)
    ]
    return replace(program, nodes=tuple(nodes), results=tuple(places[r] for r in program.results))


def chain_lengths(nodes: Sequence[Operation]) -> list[int]:
    """Return the length of the longest chain of operations that ends in each node."""
    depths: list[int] = []
    for _, args, _ in nodes:
        depths.append(1 + max(map(depths.__getitem__, args), default=0))
    return depths


def depth_first(program: Program, depths: Sequence[int]) -> list[int]:
    """Return the nodes that results need, each after what it needs, of which what has the longest
    chain comes first."""
    visited: dict[int, None] = {}
    for result in program.results:
        _visit(program.nodes, result, depths, visited)
    return list(visited)


def by_stretches(order: Sequence[int], depths: Sequence[int]) -> list[int]:
    """Return nodes in an order in which those of each stretch are sorted by the length of their
    chains."""
    starts = range(0, len(order), STRETCH)
    return [k for i in starts for k in sorted(order[i : i + STRETCH], key=depths.__getitem__)]


def _visit(
    nodes: tuple[Operation, ...], root: int, depths: Sequence[int], visited: dict[int, None]
) -> None:
    """Append `root` to `visited` after all that it needs."""
    stack = [root]
    while stack:
        waiting = [a for a in nodes[stack[-1]].args if a not in visited]
        if len(waiting) == 1:
            stack += waiting
        elif waiting:
            stack += sorted(waiting, key=depths.__getitem__)
        else:
            visited.setdefault(stack.pop())


def _shared_denominators(program: Program) -> frozenset[int]:
    """Return the positions of the values that divide more than one value."""
    counts = Counter(node.args[1] for node in program.nodes if node.op == "div")
    return frozenset(d for d, n in counts.items() if n > 1)


class _Signed(NamedTuple):
    """The value sign * node, where `node` is a position and `sign` is +1 or -1."""

    sign: int
    node: int

    def times(self, sign: int) -> "_Signed":
        return _Signed(self.sign * sign, self.node)


def _rewrite(program: Program, shared: frozenset[int]) -> Program:
    """Build the program anew by the rules; values divided by one in `shared` are multiplied by its
    reciprocal."""
    builder = _Builder()
    values: list[_Signed] = []
    for node in program.nodes:
        args = [values[a] for a in node.args]
        if node.op == "div" and node.args[1] in shared:
            values.append(builder.mul(args[0], builder.div(builder.const(1.0), args[1])))
        else:
            values.append(builder.build(node, args))
    results = tuple(builder.position(values[r]) for r in program.results)
    return replace(program, nodes=tuple(builder.nodes), results=results)


class _Builder:
    """The nodes made so far, each once, and a method for each operation that has rules of its
    own."""

    def __init__(self):
        self.nodes: list[Operation] = []
        self._known: dict[Operation | bytes, int] = {}
        self._rules = {
            op: getattr(self, op) for op in ("neg", "add", "sub", "mul", "div", "sqrt", "tan")
        }

    def build(self, node: Operation, args: list[_Signed]) -> _Signed:
        op = node.op
        if op == "const":
            return self.const(node.value)
        if op in self._rules:
            return self._rules[op](*args)
        if op in _ODD:
            return _Signed(args[0].sign, self._node(op, args[0].node))
        if op in _EVEN:
            return _Signed(1, self._node(op, args[0].node))
        return _Signed(1, self._node(op, *(self.position(a) for a in args), value=node.value))

    def position(self, x: _Signed) -> int:
        """Return the position of a node whose value is x, sign and all.

        A minus sign reverses a difference and changes a constant factor; only then it costs an
        operation of its own.
        """
        if x.sign > 0:
            return x.node
        op, args, value = self.nodes[x.node]
        if op == "const":
            return self._node("const", value=-value)
        if op == "sub":
            return self._node("sub", *reversed(args))
        if op in ("mul", "div"):
            factors = [self.nodes[a] for a in args]
            for i, factor in enumerate(factors):
                if factor.op == "const":
                    opposite = self._node("const", value=-factor.value)
                    return self._node(op, *(opposite if j == i else a for j, a in enumerate(args)))
        return self._node("neg", x.node)

    def const(self, value: float) -> _Signed:
        sign = -1 if math.copysign(1.0, value) < 0 else 1
        return _Signed(sign, self._node("const", value=abs(value)))

    def neg(self, a: _Signed) -> _Signed:
        return a.times(-1)

    def add(self, a: _Signed, b: _Signed) -> _Signed:
        x, y = self._number(a), self._number(b)
        if x is not None and y is not None:
            return self.const(a.sign * x + b.sign * y)
        if x == 0:
            return b
        if y == 0:
            return a
        if a.sign == b.sign:
            return self._sum(a.node, b.node).times(a.sign)
        return self._difference(a.node, b.node).times(a.sign)

    def sub(self, a: _Signed, b: _Signed) -> _Signed:
        return self.add(a, b.times(-1))

    def _sum(self, a: int, b: int) -> _Signed:
        if a == b:
            return self.mul(_Signed(1, a), self.const(2.0))
        for one, other in ((self.nodes[a], self.nodes[b]), (self.nodes[b], self.nodes[a])):
            if one.op == other.op == "if_else_zero" and self.nodes[other.args[0]] == Operation(
                "not", one.args[:1]
            ):
                return _Signed(1, self._node("select", *one.args, other.args[1]))
        return _Signed(1, self._node("add", a, b))

    def _difference(self, a: int, b: int) -> _Signed:
        """Return a - b, as -(b - a) where that is known."""
        if a != b and (opposite := self._known.get(Operation("sub", (b, a)))) is not None:
            return _Signed(-1, opposite)
        return _Signed(1, self._node("sub", a, b))

    def mul(self, a: _Signed, b: _Signed) -> _Signed:
        if self.nodes[a.node].op == "const":
            a, b = b, a
        sign, factor = a.sign * b.sign, self._number(b)
        if factor is not None:
            number = self._number(a)
            if number is not None:
                return self.const(number * factor).times(sign)
            if factor == 1:
                return _Signed(sign, a.node)
            for inner, rest in self._factorings(a.node):
                if math.isfinite(inner * factor) and abs(inner * factor) >= _SMALLEST_NORMAL:
                    return self.mul(_Signed(sign, rest), self.const(inner * factor))
        return _Signed(sign, self._node("mul", a.node, b.node))

    def _factorings(self, x: int):
        """Yield (c, y) where node x is the product of the constant c and y."""
        node = self.nodes[x]
        if node.op == "mul":
            for c, y in (node.args, node.args[::-1]):
                if self.nodes[c].op == "const":
                    yield self.nodes[c].value, y

    def div(self, a: _Signed, b: _Signed) -> _Signed:
        sign, numerator, divisor = a.sign * b.sign, self._number(a), self._number(b)
        if divisor is not None and divisor != 0:
            if numerator is not None:
                return self.const(numerator / divisor).times(sign)
            if _has_exact_reciprocal(divisor):
                return self.mul(_Signed(sign, a.node), self.const(1 / divisor))
        return _Signed(sign, self._node("div", a.node, b.node))

    def sqrt(self, a: _Signed) -> _Signed:
        x = self._number(a)
        if x is not None and a.sign > 0:
            return self.const(math.sqrt(x))
        return _Signed(1, self._node("sqrt", self.position(a)))

    def tan(self, a: _Signed) -> _Signed:
        sine, cosine = self._node("sin", a.node), self._node("cos", a.node)
        return self.div(_Signed(a.sign, sine), _Signed(1, cosine))

    def _number(self, x: _Signed) -> float | None:
        """Return the magnitude of x where x is a constant."""
        node = self.nodes[x.node]
        return node.value if node.op == "const" else None

    def _node(self, op: str, *args: int, value: float = 0) -> int:
        """Return the position of the node, a new one only where no equal one is known."""
        if op in _COMMUTING and args[0] > args[1]:
            args = (args[1], args[0])
        node, count = Operation(op, args, value), len(self.nodes)
        place = self._known.setdefault(_key(node), count)
        if place == count:
            self.nodes.append(node)
        return place


def _key(node: Operation) -> Operation | bytes:
    """Return what two equal nodes share; constants are compared bit by bit, so that -0 is not 0 and
    NaN is NaN."""
    return struct.pack("<d", node.value) if node.op == "const" else node


def _has_exact_reciprocal(x: float) -> bool:
    """Tell whether 1/x is exact: x a power of two, neither it nor 1/x subnormal."""
    return math.frexp(x)[0] == 0.5 and _SMALLEST_NORMAL <= x <= 1 / _SMALLEST_NORMAL
