"""A program cut into sections: sines and cosines come between them, and each is short enough to be
compiled quickly.

The sines and cosines of all angles that are known at a time are computed together. Level 0 are the
angles that no sine or cosine goes into, level 1 those that sines and cosines of level 0 go into,
...: for each level a section computes what its angles need and ends with them; the last section is
the rest of the program.

The sections of a small program are code of one function. Where there are many angles they become
functions between the calls that compute sines and cosines, and LLVM's time grows with the square of
a function's length: the sections of a large program are cut further, where `simplify` begins a new
stretch, and are functions too. What later ones need is handed over in memory; a slot is used again
by the sections after the last one that needs its value.
"""

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass

from linkwork.kernels.program import Operation, Program
from linkwork.kernels.simplify import STRETCH

_LARGE = 16 * STRETCH
_MANY = 8  # vectors of angles
FETCHED = frozenset(("input", "const", "sin", "cos"))


@dataclass(frozen=True)
class Section:
    """Part of a program.

    nodes: positions of the values to compute, in order, and of inputs, constants, sines and cosines
        that are results.
    angles: positions of the values whose sines and cosines are computed at the end.
    vectors: number of vectors that the angles fill; the slots hold them, their sines and their
        cosines, that many vectors each.
    first: number of vectors before those in the slots.
    """

    nodes: tuple[int, ...]
    angles: tuple[int, ...] = ()
    vectors: int = 0
    first: int = 0


@dataclass(frozen=True)
class SectionPlan:
    """A program as sections, and the memory they need, in slots of one number each.

    apart: whether the sections are functions of their own
    kept: the slot of each value that a later section needs, where they are
    sines, cosines: slots by the angle's position; slots: number of slots
    places: in the flat output vector, by the value's position
    """

    sections: tuple[Section, ...]
    apart: bool
    kept: dict[int, int]
    sines: dict[int, int]
    cosines: dict[int, int]
    slots: int
    places: dict[int, list[int]]


def planned(program: Program, angles_in_vector: int) -> SectionPlan:
    """Cut a program into sections; a vector holds so many angles of one state."""
    # Results by place. A large program is cut further, into stretches.
    nodes = program.nodes
    large = len(nodes) > _LARGE
    places = defaultdict(list)
    for place, k in enumerate(program.results):
        places[k].append(place)

    def pieces(positions: Iterable[int]) -> list[tuple[int, ...]]:
        computed = [k for k in positions if nodes[k].op not in FETCHED or k in places]
        return _stretches(computed) if large else [tuple(computed)]

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
        sections += [
            *map(Section, before),
            Section(last, angles, vectors, slots // angles_in_vector),
        ]
        # Room for the angles, their sines and their cosines, side by side.
        size = vectors * angles_in_vector
        sines.update((k, slots + size + i) for i, k in enumerate(angles))
        cosines.update((k, slots + 2 * size + i) for i, k in enumerate(angles))
        slots += 3 * size

    # What no angle needs comes last. Sections that are compiled apart keep in memory what others
    # need.
    sections += map(Section, pieces(k for k in range(len(nodes)) if k not in done))
    apart = large or max(section.vectors for section in sections) > _MANY
    kept = _slots(nodes, sections, slots) if apart else {}
    return SectionPlan(
        tuple(sections),
        apart,
        kept,
        sines,
        cosines,
        max(kept.values(), default=slots - 1) + 1,
        dict(places),
    )


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


def _stretches(positions: list[int]) -> list[tuple[int, ...]]:
    """Cut between stretches, so that a piece has as many whole ones as have STRETCH of the
    positions at most."""
    stretches = defaultdict(list)
    for k in positions:
        stretches[k // STRETCH].append(k)
    pieces: list[list[int]] = [[]]
    for stretch in stretches.values():
        if len(pieces[-1]) + len(stretch) > STRETCH:
            pieces.append([])
        pieces[-1] += stretch
    return list(map(tuple, pieces))


def _slots(nodes: tuple[Operation, ...], sections: list[Section], first: int) -> dict[int, int]:
    """Return a slot from `first` on for each value that a later section than its own needs."""
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
