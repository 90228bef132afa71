"""The dependent rates from Phi q' = 0, step by step in closed form.

    sum_j Phi_ij x_j = sum_k (-Phi_ik) e_k - gamma_i        x: rates of q' = L v, and b of q''

Rows of constants are solved first, as sums of angles are. A rate that stands in one row waits for
the others. A rate that stands in two rows, a x and b x, is taken out by their combination
a (second) - b (first) and found afterwards from (a^2 + b^2) x, for a link in the plane its length
squared, which never vanishes. What is then coupled, up to four rates at a time, is left to
Cramer's rule.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

from linkwork.errors import LinkworkError
from linkwork.export.symbolic.trig import ZERO, Trig, rational

PAIR, CRAMER = 2, 4  # rates that are solved together: soon, and at most
Key = tuple[str, str]  # ("rate", independent), ("gamma", row) or ("solved", unknown)
Linear = Mapping[Key, Trig]


@dataclass(frozen=True)
class RateRow:
    """Hold a row: coefficients of unknowns on the left, what is known on the right."""

    left: Mapping[str, Trig]
    right: Linear

    def without(self, solved: Sequence[str]) -> RateRow:
        """Return the row with solved unknowns on the right."""
        right = dict(self.right)
        for name in solved:
            if name in self.left:
                right = summed(right, {("solved", name): -self.left[name]})
        left = {name: c for name, c in self.left.items() if name not in solved}
        return RateRow(left, right)

    def combined(self, mine: Trig, other: RateRow, theirs: Trig) -> RateRow:
        """Return a combination of two rows."""
        left = summed(scaled(self.left, mine), scaled(other.left, theirs))
        return RateRow(left, summed(scaled(self.right, mine), scaled(other.right, theirs)))


@dataclass(frozen=True)
class SolvedTogether:
    """Say that A x = right for some unknowns."""

    unknowns: tuple[str, ...]
    A: tuple[tuple[Trig, ...], ...]
    right: tuple[Linear, ...]


def scaled(values: Mapping, factor: Trig) -> dict:
    return {key: value * factor for key, value in values.items()}


def summed(a: Mapping, b: Mapping) -> dict:
    """Return the sum of two linear forms."""
    found = {key: a.get(key, ZERO) + b.get(key, ZERO) for key in {**a, **b}}
    return {key: value for key, value in found.items() if value}


def steps_of(rows: Sequence[RateRow], late: Sequence[str]) -> list[SolvedTogether]:
    """Return the steps that solve rows for all their unknowns, in their order.

    late: unknowns that are taken out first where a row of constants allows it, found last
    """
    left, found, waiting = list(rows), [], []
    while left:
        if step := constant_step(left, late):
            waiting.append(step)
        elif block := coupled(left, PAIR):
            found.append(block)
        elif step := waiting_step(left, still=True):
            waiting.append(step)
        elif block := coupled(left, CRAMER):
            found.append(block)
        elif step := waiting_step(left, still=False):
            waiting.append(step)
        else:
            names = sorted({name for row in left for name in row.left})
            raise LinkworkError(
                f"the loops couple {len(names)} rates ({', '.join(names)}) and leave no {CRAMER} "
                "of them to be solved at a time, which is where closed forms end; "
                "evaluate robot.rate_map instead"
            )
        solved = found[-1].unknowns if found else ()
        left = [row.without(solved) for row in left]
        left = [row for row in left if row.left]
    return found + waiting[::-1]


def constant_step(left: list[RateRow], late: Sequence[str]) -> SolvedTogether | None:
    """Take an unknown out by a row of numbers, one of `late` if there is one."""
    for place, row in enumerate(left):
        if any(c.number is None for c in row.left.values()):
            continue
        name = next((each for each in late if each in row.left), next(iter(row.left)))
        pivot = row.left[name].number
        assert pivot
        own = left.pop(place)
        for index, other in enumerate(left):
            if name in other.left:
                factor = other.left[name] * (-1 / pivot)
                left[index] = other.combined(rational(1), own, factor)
        return SolvedTogether((name,), ((row.left[name],),), (known_of(own, name),))
    return None


def coupled(left: Sequence[RateRow], most: int) -> SolvedTogether | None:
    """Find rows that hold as many unknowns as they are, the fewest, and `most` at most."""
    for size in range(1, most + 1):
        for places in combinations(range(len(left)), size):
            names = {name: None for place in places for name in left[place].left}
            if len(names) == size:
                unknowns = tuple(names)
                A = tuple(
                    tuple(left[place].left.get(name, ZERO) for name in unknowns) for place in places
                )
                return SolvedTogether(unknowns, A, tuple(left[place].right for place in places))
    return None


def waiting_step(left: list[RateRow], still: bool) -> SolvedTogether | None:
    """Take an unknown out that stands in one row, or in two; it waits for the others.

    still: only where the sum of squares of its two coefficients does not move
    """
    held: dict[str, list[int]] = {}
    for place, row in enumerate(left):
        for name in row.left:
            held.setdefault(name, []).append(place)
    for name, places in held.items():
        if len(places) == 1:
            row = left.pop(places[0])
            return SolvedTogether((name,), ((row.left[name],),), (known_of(row, name),))
    pairs = [(size_of(left, name, at), name) for name, at in held.items() if len(at) == 2]
    if not pairs or (still and min(pairs)[0][0]):
        return None
    _, name = min(pairs)
    first, second = (left[place] for place in held[name])
    a, b = first.left[name], second.left[name]
    squares = first.combined(a, second, b)
    left[held[name][0]] = second.combined(a, first, -b)
    del left[held[name][1]]
    return SolvedTogether((name,), ((squares.left[name],),), (known_of(squares, name),))


def size_of(left: Sequence[RateRow], name: str, places: Sequence[int]) -> tuple[bool, int]:
    """Tell whether the sum of squares of an unknown's coefficients moves, and how long it is."""
    squares = sum((left[place].left[name] * left[place].left[name] for place in places), ZERO)
    return squares.moves, len(squares.terms)


def known_of(row: RateRow, name: str) -> Linear:
    """Return the right side of a row once all unknowns but one are known."""
    return row.without([each for each in row.left if each != name]).right


def determinant(A: Sequence[Sequence[Trig]]) -> Trig:
    """Return the determinant of a small matrix, along its first row."""
    if not A:
        return rational(1)
    return sum((A[0][j] * minor(A, 0, j) * (-1) ** j for j in range(len(A)) if A[0][j]), ZERO)


def minor(A: Sequence[Sequence[Trig]], row: int, column: int) -> Trig:
    """Return the determinant without a row and a column."""
    rows = [each for i, each in enumerate(A) if i != row]
    return determinant([[x for j, x in enumerate(each) if j != column] for each in rows])
