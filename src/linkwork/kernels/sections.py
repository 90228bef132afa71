"""A program cut into sections: sines and cosines come between them, and each is short enough to be
compiled quickly.

The sines and cosines of all angles that are known at a time are computed together. Level 0 are the
angles that no sine or cosine goes into, level 1 those that sines and cosines of level 0 go into,
...: for each level a section computes what its angles need and ends with them; the last section is
the rest of the program.

The sections of a small program are code of one function. Where there are many angles they become
functions between the calls that compute sines and cosines, and LLVM's time grows with the square of
a function's length: the sections of a large program are cut further and are functions too, those
that recur one for all (`repeats`). What later ones need is handed over in memory; a slot is used
again by the sections after the last one that needs its value. Code that is long, but not large, is
cut into short sections for its speed (`by_sections`).
"""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

from linkwork.kernels.fixed_results import fixed_results
from linkwork.kernels.program import Operation, Program
from linkwork.kernels.repeats import FETCHED, Part, part_of, repeats
from linkwork.kernels.simplify import LARGE, STRETCH, by_stretches, chain_lengths

_MANY = 8  # vectors of angles


@dataclass(frozen=True)
class Section:
    """Part of a program.

    nodes: positions of the values to compute, in order, and of inputs, constants, sines and cosines
        that are results.
    angles: positions of the values whose sines and cosines are computed at the end.
    vectors: number of vectors that the angles fill; the slots hold them, their sines and their
        cosines, that many vectors each.
    first: number of vectors before those in the slots.
    part: number of the part that it is a call of, and number of the call, if it is one
    """

    nodes: tuple[int, ...]
    angles: tuple[int, ...] = ()
    vectors: int = 0
    first: int = 0
    part: tuple[int, int] | None = None


@dataclass(frozen=True)
class SectionPlan:
    """A program as sections, and the memory they need, in slots of one number each.

    apart: whether the sections are functions of their own
    kept: the slot of each value that a later section needs, where they are, but for results that
        short sections read
    sines, cosines: slots by the angle's position; slots: number of slots
    places: in the flat output vector, by the value's position
    fixed: results that no section writes: constants by their places
    parts: what sections have in common, by number
    """

    sections: tuple[Section, ...]
    apart: bool
    kept: dict[int, int]
    sines: dict[int, int]
    cosines: dict[int, int]
    slots: int
    places: dict[int, list[int]]
    fixed: dict[int, float]
    parts: tuple[Part, ...]
    nodes: tuple[Operation, ...]

    def slot(self, k: int) -> int:
        """Return the slot that holds the value at position k, or the sine or cosine there."""
        op, args, _ = self.nodes[k]
        if op in ("sin", "cos"):
            return (self.sines if op == "sin" else self.cosines)[args[0]]
        return self.kept[k]


def planned(
    program: Program, angles_in_vector: int, recurring: bool = True, short: int = 0
) -> SectionPlan:
    """Cut a program into sections; a vector holds so many angles of one state.

    recurring: whether what recurs in a large program is a part
    short: operations of a section of a program that stands depth first, and is cut without parts
    """
    # Results by place. A large program is cut further, into stretches.
    nodes = program.nodes
    large = short > 0 or len(nodes) > LARGE
    places, fixed = defaultdict(list), fixed_results(program)
    for place, k in enumerate(program.results):
        if place not in fixed:
            places[k].append(place)

    def pieces(positions: Iterable[int]) -> list[Section]:
        computed = [k for k in positions if nodes[k].op not in FETCHED or k in places]
        if not large:
            return [Section(tuple(computed))]
        if short or not recurring:
            return [*map(Section, _stretches(computed, ranks, short or STRETCH))]
        return list(_pieces(nodes, computed, places, ranks))

    # In a large program the operations of a stretch do not stand in their order yet.
    order: Sequence[int] = range(len(nodes)) if large else ()
    if large and not short:
        order = by_stretches(order, chain_lengths(nodes))
    ranks = {k: rank for rank, k in enumerate(order)}

    # Angles whose sines are taken together end a section: all that they need comes before.
    sections: list[Section] = []
    sines: dict[int, int] = {}
    cosines: dict[int, int] = {}
    slots = 0
    done: set[int] = set()
    for angles in _angles(nodes):
        needed = _needed(nodes, angles, done)
        done.update(needed)
        *before, last = pieces(needed)
        vectors = -(-len(angles) // angles_in_vector)
        ending = {"angles": angles, "vectors": vectors, "first": slots // angles_in_vector}
        sections += [*before, replace(last, **ending)]
        # Room for the angles, their sines and their cosines, side by side.
        size = vectors * angles_in_vector
        sines.update((k, slots + size + i) for i, k in enumerate(angles))
        cosines.update((k, slots + 2 * size + i) for i, k in enumerate(angles))
        slots += 3 * size

    # What no angle needs comes last. Sections that are compiled apart keep in memory what others
    # need; short ones read results where these are written.
    sections += pieces(k for k in range(len(nodes)) if k not in done)
    apart = large or max(section.vectors for section in sections) > _MANY
    last = _last(nodes, sections) if apart else {}
    if short:
        last = {k: s for k, s in last.items() if k not in places}
    parts = _call_parts(nodes, sections, places, last)
    kept = _slots(sections, last, slots)
    return SectionPlan(
        tuple(sections),
        apart,
        kept,
        sines,
        cosines,
        max(kept.values(), default=slots - 1) + 1,
        dict(places),
        fixed,
        tuple(parts),
        nodes,
    )


def _pieces(
    nodes: tuple[Operation, ...],
    positions: list[int],
    places: dict[int, list[int]],
    ranks: dict[int, int],
) -> Iterator[Section]:
    """Yield the sections of a large program between its sines: calls of parts, and stretches, of
    which the last one is no call.

    ranks: of the positions in the order in which they are carried out but for parts
    """
    computed = [k for k in positions if nodes[k].op not in FETCHED]
    cut = repeats(nodes, computed, places)
    if len(cut) == 1:
        yield from map(Section, _stretches(positions, ranks, STRETCH))
        return
    for own, kind in cut:
        if kind is None:
            yield from map(Section, _stretches(own, ranks, STRETCH))
        else:
            yield Section(own, part=(computed[0], kind))
    yield Section(tuple(k for k in positions if nodes[k].op in FETCHED))


def _call_parts(
    nodes: tuple[Operation, ...],
    sections: list[Section],
    places: dict[int, list[int]],
    last: dict[int, int],
) -> list[Part]:
    """Return the parts that sections are calls of, in which these are numbered.

    last: the last section that reads what is read by another one than its own; filled up, for a
    part writes in every call what is read of it after one
    """
    calls: defaultdict[tuple[int, int], list[int]] = defaultdict(list)
    for s, section in enumerate(sections):
        if section.part is not None:
            calls[section.part].append(s)
    parts: list[Part] = []
    for own in calls.values():
        part = part_of(nodes, [sections[s].nodes for s in own], places, last)
        for call, s in enumerate(own):
            sections[s] = Section(part.calls[call], part=(len(parts), call))
            for i in part.kept:
                last.setdefault(part.place(call, i), s)
        parts.append(part)
    return parts


def _angles(nodes: tuple[Operation, ...]) -> list[tuple[int, ...]]:
    """Return the angles of each level."""
    levels: list[int] = []
    found: defaultdict[int, dict[int, None]] = defaultdict(dict)
    for node in nodes:
        level = max((levels[a] for a in node.args), default=0)
        if node.op in ("sin", "cos"):
            found[level][node.args[0]] = None
            level += 1
        levels.append(level)
    return [tuple(found[level]) for level in sorted(found)]


def _needed(nodes: tuple[Operation, ...], roots: Iterable[int], done: set[int]) -> list[int]:
    """Return the positions of the values that the roots depend on, themselves included, but for
    those that are done."""
    found: set[int] = set()
    waiting = list(roots)
    while waiting:
        k = waiting.pop()
        if k not in found and k not in done:
            found.add(k)
            waiting.extend(nodes[k].args)
    return sorted(found)


def _stretches(positions: Iterable[int], ranks: dict[int, int], most: int) -> list[tuple[int, ...]]:
    """Cut between stretches, so that a piece has as many whole ones as have so many of the
    positions at most."""
    stretches = defaultdict(list)
    for k in sorted(positions, key=ranks.__getitem__):
        stretches[ranks[k] // most].append(k)
    pieces: list[list[int]] = [[]]
    for stretch in stretches.values():
        if len(pieces[-1]) + len(stretch) > most:
            pieces.append([])
        pieces[-1] += stretch
    return list(map(tuple, pieces))


def _last(nodes: tuple[Operation, ...], sections: list[Section]) -> dict[int, int]:
    """Return the last section that reads a value, for each that another one reads than its own."""
    home = {
        k: s
        for s, section in enumerate(sections)
        for k in section.nodes
        if nodes[k].op not in FETCHED
    }
    last: dict[int, int] = {}
    for s, section in enumerate(sections):
        needed = {a for k in section.nodes for a in nodes[k].args}.union(section.angles)
        last.update((k, s) for k in needed if home.get(k, s) != s)
    return last


def _slots(sections: list[Section], last: dict[int, int], first: int) -> dict[int, int]:
    """Return a slot from `first` on for each value that is kept to the last section that reads
    it."""
    ending = defaultdict(list)
    for k, s in last.items():
        ending[s].append(k)
    slots: dict[int, int] = {}
    free: list[int] = []
    end = first
    for s, section in enumerate(sections):
        for k in section.nodes:
            if k in last:
                if not free:
                    free.append(end)
                    end += 1
                slots[k] = free.pop()
        free.extend(slots[k] for k in ending[s])
    return slots
