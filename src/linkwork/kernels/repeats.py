"""Parts that a program repeats with other operands, as the loops of a ladder or equal legs: each is
compiled once and called.

Two stretches of a program are the same part where their operations are, and where every operand
that is computed within them is computed at the same place of them. Operands from elsewhere are the
part's arguments: other values, inputs and numbers. Parts grow out of single operations: wherever
two neighbours come together often they become one, where more often before where less often; what
comes together in one place does so in all, whatever is around it, so that the cuts of equal
stretches agree.
Source: Larsson & Moffat 2000 (Re-Pair: repeated replacement of frequent pairs).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass
from itertools import compress, pairwise
from struct import pack, unpack
from typing import NamedTuple

import numpy as np

from linkwork.kernels.program import Operation

FETCHED = frozenset(("input", "const", "sin", "cos"))
ARGUMENTS = frozenset(("input", "kept", "number", "const"))
LONGEST = 250  # operations of a part: enough to be worth a call, few enough to recur
SHORTEST = 48  # operations that are worth a call
COMMON = 0.3  # share of the occurrences of a neighbour in which two come together
NONE = -1  # the kind of two neighbours that are too long together
CHANCE = 2654435761  # times a kind, modulo 2^32: which of two is as good as thrown by a die
SAVING = 0.5  # of the operations that need not be compiled, from which on parts are called


class Recurrence(NamedTuple):
    """A stretch of a sequence of operations.

    start: of its first one; size; kind: equal for equal stretches
    outside: operands before it in the sequence: which operation of the stretch, which of its
        operands, and the place of that
    """

    start: int
    size: int
    kind: int
    outside: tuple[tuple[int, int, int], ...]


class Kinds(dict):
    """Numbers for whatever is asked for, from 0 on."""

    def __missing__(self, key: object) -> int:
        self[key] = len(self)
        return self[key]


def repeats(
    nodes: Sequence[Operation], positions: Sequence[int], results: Mapping[int, Sequence[int]]
) -> list[tuple[tuple[int, ...], int | None]]:
    """Cut a sequence of operations into stretches, with a number for each that is a part: equal
    for equal ones. Without parts where these save too little.

    nodes: the program; positions: of the sequence; results: places in the output, by position
    """
    if len(positions) < 2 * SHORTEST:
        return [(tuple(positions), None)]
    kinds = Kinds()
    stretches = grown(single(nodes, positions, results, kinds), kinds)
    counts = Counter(stretch.kind for stretch in stretches)
    found: list[tuple[tuple[int, ...], int | None]] = []
    for start, size, kind, _ in stretches:
        own = tuple(positions[start : start + size])
        part = kind if counts[kind] > 1 and size >= SHORTEST else None
        if part is None and found and found[-1][1] is None:
            found[-1] = (*found[-1][0], *own), None
        else:
            found.append((own, part))
    sizes = {part: len(own) for own, part in found if part is not None}
    repeated = sum(len(own) for own, part in found if part is not None) - sum(sizes.values())
    return found if repeated > SAVING * len(positions) else [(tuple(positions), None)]


def single(
    nodes: Sequence[Operation],
    positions: Sequence[int],
    results: Mapping[int, Sequence[int]],
    kinds: Kinds,
) -> list[Recurrence]:
    """Return stretches of one operation each."""
    places, found = {k: place for place, k in enumerate(positions)}, []
    for start, k in enumerate(positions):
        op, args, _ = nodes[k]
        what = [nodes[a].op if nodes[a].op in ("input", "const") else "" for a in args]
        outside = tuple((0, j, places[a]) for j, a in enumerate(args) if a in places)
        found.append(Recurrence(start, 1, kinds[op, *what, len(results.get(k, ()))], outside))
    return found


def grown(stretches: list[Recurrence], kinds: Kinds) -> list[Recurrence]:
    """Return stretches that those have become of which neighbours that often come together are
    joined, until none do."""
    alone = np.array([stretch.kind for stretch in stretches], int)
    together = np.array([pair(*two, kinds) for two in pairwise(stretches)] + [NONE])
    while (first := chosen(alone, together)).size:
        for i in first.tolist():
            stretches[i] = merged(stretches[i], stretches[i + 1], int(together[i]))
        alone[first] = together[first]
        # The second of each two is left out.
        left = np.ones(len(stretches), bool)
        left[first + 1] = False
        stretches = list(compress(stretches, left.tolist()))
        alone, together, first = alone[left], together[left], (np.cumsum(left) - 1)[first]
        # What has become longer has other neighbours, and so have these.
        together[-1] = NONE
        last = len(stretches) - 1
        for i in np.unique([first - 1, first]).tolist():
            if 0 <= i < last:
                together[i] = pair(stretches[i], stretches[i + 1], kinds)
    return stretches


def chosen(alone: np.ndarray, together: np.ndarray) -> np.ndarray:
    """Return where two neighbours are to be joined: the places of the first ones.

    alone: kinds of the stretches; together: that of each with the next, NONE where it has none
    """
    # How much speaks for each two: how often they come together, then chance.
    counts = np.bincount(alone)[alone]
    often = np.where(together == NONE, 0, np.bincount(together + 1)[together + 1])
    least = COMMON * np.minimum(counts, np.append(counts[1:], 0))
    weights = np.where(often > np.maximum(1, least), (often << 32) + together * CHANCE % 2**32, 0)
    # Taken from the left, but not where the next two have more that speaks for them: every other
    # place where several follow each other.
    taken = (weights > 0) & (weights >= np.append(weights[1:], 0))
    places = np.flatnonzero(taken)
    begins = np.flatnonzero(taken & ~np.append(False, taken[:-1]))
    return places[(places - begins[np.searchsorted(begins, places, "right") - 1]) % 2 == 0]


def pair(first: Recurrence, second: Recurrence, kinds: Kinds) -> int:
    """Return the kind of two neighbours together, NONE where they are too long."""
    if first.size + second.size > LONGEST:
        return NONE
    start = first.start
    links = [(k, j, place - start) for k, j, place in second.outside if place >= start]
    return kinds[first.kind, second.kind, tuple(links)]


def merged(first: Recurrence, second: Recurrence, kind: int) -> Recurrence:
    """Return two neighbours as one stretch."""
    still = [(k + first.size, j, at) for k, j, at in second.outside if at < first.start]
    return Recurrence(first.start, first.size + second.size, kind, (*first.outside, *still))


@dataclass(frozen=True)
class Part:
    """A part of a program that is called with arguments, from several places.

    nodes: its arguments, then its operations. An argument's `Operation.value` is its place among
        those of its op: "input", "kept" (a value from elsewhere) or "number"
    kept, results: nodes that are written for other sections, and those that are results
    calls: positions of the operations in the program, of each call
    inputs, values, numbers: the arguments of each call: places in the input, positions in the
        program, and numbers
    """

    nodes: tuple[Operation, ...]
    kept: tuple[int, ...]
    results: tuple[int, ...]
    calls: tuple[tuple[int, ...], ...]
    inputs: tuple[tuple[int, ...], ...]
    values: tuple[tuple[int, ...], ...]
    numbers: tuple[tuple[float, ...], ...]

    def place(self, call: int, node: int) -> int:
        """Return the position in the program of one of the operations in a call."""
        return self.calls[call][node - len(self.nodes) + len(self.calls[call])]


def part_of(
    nodes: Sequence[Operation],
    calls: Sequence[tuple[int, ...]],
    results: Mapping[int, Sequence[int]],
    needed: Container[int],
) -> Part:
    """Return the part that equal stretches of a program have in common.

    nodes: the program; calls: positions of the stretches' operations; results: places in the
    output, by position; needed: positions that other sections read
    """
    # Operations that do not wait for each other become neighbours, as in `simplify`.
    calls = by_depth(nodes, calls)
    own = {k: i for i, k in enumerate(calls[0])}
    # Operands from elsewhere: one argument for those that are the same in every call.
    found: dict[str, dict[tuple, int]] = {"input": {}, "kept": {}, "number": {}, "const": {}}
    operands: list[list[tuple[str, int]]] = []
    for i, first in enumerate(calls[0]):
        operands.append([])
        for j, a in enumerate(nodes[first].args):
            if a in own:
                operands[-1].append(("own", own[a]))
                continue
            each = tuple(nodes[call[i]].args[j] for call in calls)
            op = nodes[a].op if nodes[a].op in ("input", "const") else "kept"
            if op == "input":
                each = tuple(int(nodes[k].value) for k in each)
            elif op == "const":
                each = tuple(pack("<d", nodes[k].value) for k in each)
                op = "const" if len({*each}) == 1 else "number"
            operands[-1].append((op, found[op].setdefault(each, len(found[op]))))
    # Arguments first, then the operations with places of their own.
    arguments, first_of = [], {}
    for op, of_calls in found.items():
        first_of[op] = len(arguments)
        values = (unpack("<d", each[0])[0] if op == "const" else i for each, i in of_calls.items())
        arguments += [Operation(op, (), value) for value in values]
    first_of["own"] = len(arguments)
    body = [
        Operation(nodes[k].op, tuple(first_of[op] + place for op, place in own_operands))
        for k, own_operands in zip(calls[0], operands, strict=True)
    ]
    # What is kept of its results, and where each call takes its arguments from.
    start, count = len(arguments), range(len(calls))
    kept = [i + start for i in range(len(body)) if any(call[i] in needed for call in calls)]
    return Part(
        (*arguments, *body),
        tuple(kept),
        tuple(i + start for i, k in enumerate(calls[0]) for _ in results.get(k, ())),
        tuple(calls),
        tuple(tuple(each[c] for each in found["input"]) for c in count),
        tuple(tuple(each[c] for each in found["kept"]) for c in count),
        tuple(tuple(unpack("<d", each[c])[0] for each in found["number"]) for c in count),
    )


def by_depth(nodes: Sequence[Operation], calls: Sequence[tuple[int, ...]]) -> list[tuple[int, ...]]:
    """Return equal stretches with their operations ordered by the length of the chains that they
    end within the stretch."""
    depths: dict[int, int] = {}
    for k in calls[0]:
        depths[k] = 1 + max((depths.get(a, 0) for a in nodes[k].args), default=0)
    order = sorted(range(len(calls[0])), key=lambda i: depths[calls[0][i]])
    return [tuple(call[i] for i in order) for call in calls]
