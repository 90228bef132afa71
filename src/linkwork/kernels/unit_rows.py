"""The function that gives a Jacobian row by row: the gradient of weights times a value, for each
unit vector of weights in a lane of its own.

    void by_rows(const double* in, double* out)

It is made of a program with an input `weights`, whose outputs by_... are gradients. `in` holds all
inputs but the weights. In `out` each gradient became a matrix, rows x size, column by column; the
other outputs are as they were. What no weight goes into is computed once, in single numbers
(`single`), and read by all lanes of what a weight goes into (`batch`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

from linkwork.kernels.body import vector_place
from linkwork.kernels.lines import INOUT, Lines, function_text
from linkwork.kernels.machine import Machine
from linkwork.kernels.program import KernelError, Operation, Program

WEIGHTS, GRADIENT = "weights", "by_"


@dataclass(frozen=True)
class ByRows:
    """A program of gradients in two: what no weight goes into, and what one does."""

    program: Program

    @cached_property
    def rows(self) -> int:
        """How many weights there are."""
        return dict(self.program.inputs)[WEIGHTS]

    @cached_property
    def first(self) -> int:
        """Where the weights begin in the flat input."""
        names = [name for name, _ in self.program.inputs]
        if WEIGHTS not in names:
            raise KernelError(f"Function '{self.program.name}' has no input '{WEIGHTS}'.")
        return sum(size for _, size in self.program.inputs[: names.index(WEIGHTS)])

    @cached_property
    def weighted(self) -> list[bool]:
        """Whether a weight goes into each of the values."""
        found: list[bool] = []
        for node in self.program.nodes:
            own = node.op == "input" and 0 <= node.value - self.first < self.rows
            found.append(own or any(found[k] for k in node.args))
        return found

    @cached_property
    def shared(self) -> list[int]:
        """The values without weights that weighted ones, or gradients, are made of."""
        nodes, weighted = self.program.nodes, self.weighted
        read = [k for node, own in zip(nodes, weighted, strict=True) if own for k in node.args]
        read += [k for gradient, own in self.results() if gradient for k in own]
        return sorted({k for k in read if not weighted[k] and nodes[k].op != "const"})

    def results(self) -> Iterator[tuple[bool, tuple[int, ...]]]:
        """Yield of each output whether it is a gradient, and its values."""
        end = 0
        for name, size in self.program.outputs:
            end += size
            yield name.startswith(GRADIENT), self.program.results[end - size : end]

    def single(self) -> Program:
        """Return the program without weights: the shared values, then the plain outputs."""
        plain = [k for gradient, own in self.results() if not gradient for k in own]
        inputs = tuple(own for own in self.program.inputs if own[0] != WEIGHTS)
        needed = self._needed([*self.shared, *plain])

        def place(node: Operation) -> Operation:
            behind = node.op == "input" and node.value >= self.first
            return node._replace(value=node.value - self.rows) if behind else node

        nodes = [place(self.program.nodes[k]) for k in needed]
        sizes = ("shared", len(self.shared)), ("plain", len(plain))
        return _renumbered("single", inputs, sizes, needed, nodes, [*self.shared, *plain])

    def batch(self) -> Program:
        """Return the program of (shared values, weights) -> gradients."""
        results = [k for gradient, own in self.results() if gradient for k in own]
        given = {k: Operation("input", (), place) for place, k in enumerate(self.shared)}
        needed = self._needed(results, given)
        count = len(self.shared)

        def place(k: int) -> Operation:
            node = given.get(k, self.program.nodes[k])
            weight = node.op == "input" and k not in given
            return node._replace(value=node.value - self.first + count) if weight else node

        inputs = ("shared", count), (WEIGHTS, self.rows)
        sizes = (("gradients", len(results)),)
        return _renumbered("batch", inputs, sizes, needed, [*map(place, needed)], results)

    def _needed(self, results: list[int], given: dict[int, Operation] | None = None) -> list[int]:
        """Return the values that results are made of, in order; not beyond given ones."""
        nodes, found, open_ = self.program.nodes, set(), [*results]
        while open_:
            k = open_.pop()
            if k not in found:
                found.add(k)
                open_ += () if given and k in given else nodes[k].args
        return sorted(found)


def _renumbered(
    name: str,
    inputs: tuple[tuple[str, int], ...],
    outputs: tuple[tuple[str, int], ...],
    needed: list[int],
    nodes: list[Operation],
    results: list[int],
) -> Program:
    """Return a program of some values of another, told by their positions there."""
    places = {k: place for place, k in enumerate(needed)}
    own = tuple(
        node if node.op == "input" else node._replace(args=tuple(places[k] for k in node.args))
        for node in nodes
    )
    return Program(name, inputs, outputs, own, tuple(places[k] for k in results))


def joining_text(of: ByRows, single: Program, batch: Program, machine: Machine) -> str:
    """Return the LLVM function `by_rows`; the module has to define `single` and `batch`."""
    lines, count = Lines(machine.lanes), len(of.shared)
    number, lanes = lines.number, machine.lanes
    first = vector_place(count, count, lanes)
    for name, kind in (
        ("x", f"[{first + of.rows + -(-single.n_out // lanes)} x {number}]"),
        ("y", f"[{max(batch.n_out, 1)} x {number}]"),
    ):
        lines.do(f"%{name} = alloca {kind}, align 64")
    lines.do("call void @single(ptr %in, ptr %x)")
    _store_plain(lines, of, count)
    # So many rows at a time as there are lanes.
    for row in range(0, of.rows, lanes):
        for weight in range(of.rows):
            entries = (f"double {float(weight == row + lane)}" for lane in range(lanes))
            lines.store(f"<{', '.join(entries)}>", "%x", first + weight)
        lines.do("call void @batch(i64 1, ptr %x, ptr %y)")
        _store_rows(lines, of, row, min(lanes, of.rows - row))
    lines.do("ret void")
    head = f"void @by_rows({INOUT.format('%in', '%out')}) {machine.attributes}"
    mask = f"{number}, ptr, i32 immarg, <{lanes} x i1>"
    declared = f"declare void @llvm.masked.store.v{lanes}f64.p0({mask})"
    return f"{declared}\n\n{function_text(head, lines.text)}"


def _places(of: ByRows) -> Iterator[tuple[bool, int, int]]:
    """Yield of each number of all outputs whether it is of a gradient, its place among those, or
    among the others, and where it begins in `out`."""
    counts, start = {True: 0, False: 0}, 0
    for gradient, own in of.results():
        for _ in own:
            yield gradient, counts[gradient], start
            counts[gradient] += 1
            start += of.rows if gradient else 1


def _store_rows(lines: Lines, of: ByRows, row: int, count: int) -> None:
    """Append the stores of so many rows of all gradients, from a row on."""
    mask = ", ".join(f"i1 {'true' if lane < count else 'false'}" for lane in range(lines.width))
    for gradient, place, start in _places(of):
        if gradient:
            value = lines.load("%y", place)
            own = lines.let(f"getelementptr inbounds double, ptr %out, i64 {start + row}")
            given = f"{lines.number} {value}, ptr {own}, i32 8, <{lines.width} x i1> <{mask}>"
            lines.do(f"call void @llvm.masked.store.v{lines.width}f64.p0({given})")


def _store_plain(lines: Lines, of: ByRows, first: int) -> None:
    """Append the stores of the outputs that are no gradients."""
    for gradient, place, start in _places(of):
        if not gradient:
            entry = lines.let(f"getelementptr inbounds double, ptr %x, i64 {first + place}")
            value = lines.let(f"load double, ptr {entry}, align 8")
            own = lines.let(f"getelementptr inbounds double, ptr %out, i64 {start}")
            lines.do(f"store double {value}, ptr {own}, align 8")
