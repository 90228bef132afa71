"""Lists of moves as machine tools take them: lines and arcs, one after the other, with a feed.

A line of the list has words of a letter and a number. Known are G0 (as fast as the limits allow),
G1 (straight, with the feed F), G2 and G3 (arcs, clockwise and counter-clockwise, seen from the tip
of the axis that they turn about, with the centre at I, J, K along X, Y, Z from the start or with
the radius R; a helix where the end lies out of their plane), G17, G18, G19 (their plane: XY, at
first, ZX, YZ), G20, G21 (inches, millimetres; these at first), G61, G90, G91 (absolute, relative;
absolute at first), F per minute, N, M2 and M30 (the end). Text in parentheses or after a semicolon
is a comment.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from math import inf, isfinite, sqrt

import numpy as np

from linkwork import checks
from linkwork.errors import LinkworkError
from linkwork.motions.laws import AxisLimits, MotionLaw, law_of
from linkwork.motions.profiles import Profile
from linkwork.motions.timed_paths import TimedPath, lawful, limits_of
from linkwork.paths import Path, Triple, finite, fixed_orientation

AXES = ("X", "Y", "Z")
OFFSETS = ("I", "J", "K")  # of an arc's centre, along these axes
PLANES = {17: (0, 1, 2), 18: (2, 0, 1), 19: (1, 2, 0)}  # of arcs: their axes, and that about which
UNITS = {20: 0.0254, 21: 1e-3}
SILENT = (61,)  # codes that say what holds anyway
MINUTE = 60.0
WORD = re.compile(r"([A-Za-z])\s*([+-]?(?:\d+\.?\d*|\.\d+))\s*")
COMMENT = re.compile(r"\([^)]*\)|;.*")
ON_CIRCLE = 2e-3
"""How far both ends of an arc may be from its radius, over it, for the rounding of lists."""
SAME = 1e-11
"""Distance along an axis up to which a move does not leave its place [m]: what sums of relative
moves, and inches, round."""
SMOOTH = 1e-6
"""Angle between two moves up to which the second goes on without a stop [rad]."""


@dataclass(frozen=True, eq=False)
class FedMove:
    """Hold a line, or an arc in a plane of two axes, run through at a feed.

    start, end: (3,) [m]; feed: [m/s]; number: of its line in the list
    centre: (2,) [m], sweep [rad] and plane of an arc: the two axes, and the one that it turns about
    """

    start: np.ndarray
    end: np.ndarray
    feed: float
    number: int
    centre: np.ndarray | None = None
    sweep: float = 0.0
    plane: tuple[int, int, int] = PLANES[17]

    @property
    def across(self) -> list[int]:
        """Return the two axes of the plane of an arc."""
        return [*self.plane[:2]]

    @property
    def radius(self) -> float:
        """Return the radius of an arc [m], infinite of a line."""
        if self.centre is None:
            return inf
        return float(np.hypot(*(self.start[self.across] - self.centre)))

    @property
    def length(self) -> float:
        """Return the way along it [m]."""
        if self.centre is None:
            return float(np.linalg.norm(self.end - self.start))
        climb = (self.end - self.start)[self.plane[2]]
        return sqrt((self.radius * self.sweep) ** 2 + climb**2)

    @property
    def bend(self) -> float:
        """Return the curvature [1/m], that of a helix with its climb."""
        return 0.0 if self.centre is None else self.radius * (self.sweep / self.length) ** 2

    def at(self, way: np.ndarray) -> Triple:
        """Return positions (K, 3) and their first and second derivative at ways along it [m]."""
        part = (way / self.length)[:, None]
        change = self.end - self.start
        x, d = self.start + part * change, np.ones_like(part) * change / self.length
        if self.centre is None:
            return x, d, 0 * d
        a = self.start[self.across] - self.centre
        b, rate = np.array([-a[1], a[0]]), self.sweep / self.length
        c, n, dd = np.cos(part * self.sweep), np.sin(part * self.sweep), 0 * d
        x[:, self.across] = self.centre + c * a + n * b
        d[:, self.across] = rate * (c * b - n * a)
        dd[:, self.across] = -(rate**2) * (c * a + n * b)
        return x, d, dd


def gcode(
    text: str,
    limits: AxisLimits,
    *,
    start: Sequence[float] | None = None,
    orientation: float | Sequence[float] | None = None,
    law: str | MotionLaw = "s_curve",
    planar: bool = False,
) -> TimedPath:
    """Make a timed path of a G-code-like list of moves.

    Moves that go on in one direction at one feed are run through without a stop, at corners the
    tool stops. An arc is run through so slowly that the acceleration towards its centre keeps the
    limit, too.

    Args:
        text: the list: G0 to G3 with X, Y, Z, I, J, K, R; F in mm/min; G17 to G21, G90, G91; N, M2,
            M30.
        limits: of the speed along the way [m/s], which feeds are kept below and G0 takes, and of
            the acceleration and jerk along it.
        start: where the tool is at first, (x, y) or (x, y, z) [m]; left out: where the first move
            leads to.
        orientation: as of `linkwork.paths.circle`.
        law: of each stretch between two stops, as for `point_to_point`.
        planar: for a robot in the plane: without Z.

    Raises:
        LinkworkError: what is not understood, with the number of its line.
    """
    if not isinstance(text, str):
        raise LinkworkError(f"the list is {checks.shown(text)}; give its text")
    checks.switch(planar, "planar")
    size = 2 if planar else 3
    # What is fixed, and where the tool is at first.
    turn = fixed_orientation(orientation, size)
    bounds = limits_of(limits).of((), 1)[:, 0]
    begun = None if start is None else np.resize(finite("the start", start, (size,)), 3)
    if begun is not None and planar:
        begun[2] = 0.0
    # Line after line, then the way over time and the curve over the way.
    moves = [*read(text, begun, float(bounds[0]), planar)]
    if not moves:
        raise LinkworkError("the list has no move; give two points at least")
    profile, corners = run_through(moves, bounds, law_of(law))
    edges = np.cumsum([0.0, *(one.length for one in moves)])
    total, curve = edges[-1], partial(joined, moves, edges, size, turn)
    passed = np.interp(edges, profile(profile.knots)[:, 0], profile.knots).tolist()
    path = Path(curve, profile.law, tuple((edges[1:-1] / total).tolist()))
    rests = tuple((corners / total).tolist())
    return TimedPath(path, profile.duration, (), tuple(passed), corners=rests, places=size)


def joined(
    moves: Sequence[FedMove], edges: np.ndarray, size: int, turn: np.ndarray, s: np.ndarray
) -> Triple:
    """Return the curve of moves one after the other; edges: ways at their ends [m]; size: of the
    place, which the fixed turn follows."""
    total = edges[-1]
    way = np.asarray(s, float) * total
    place = np.clip(np.searchsorted(edges, way, side="right") - 1, 0, len(moves) - 1)
    parts = np.zeros((3, way.size, size + turn.size))
    parts[0, :, size:] = turn
    for k in np.unique(place):
        mine = place == k
        for order, value in enumerate(moves[k].at(way[mine] - edges[k])):
            parts[order, mine, :size] = value[:, :size] * total**order
    return parts[0], parts[1], parts[2]


def run_through(
    moves: Sequence[FedMove], bounds: np.ndarray, law: MotionLaw
) -> tuple[Profile, np.ndarray]:
    """Return the way over time, at rest at corners and where the feed changes, and the ways at
    which it rests (corners,)."""
    # Chains of moves between two stops.
    chains = [[moves[0]]]
    for before, after in pairwise(moves):
        if goes_on(before, after):
            chains[-1].append(after)
        else:
            chains.append([after])
    # Each chain by one law, within its feed and what its arcs allow.
    knots, rows, way, ends = [np.zeros(1)], [], 0.0, []
    for chain in chains:
        V, A, J = bounds
        if isfinite(A):
            V = min([V, *(sqrt(A / one.bend) for one in chain if one.bend > 0)])
        length = sum(one.length for one in chain)
        with checks.at(f"line {chain[0].number}: "):
            part = lawful(law, length, (min(V, chain[0].feed), A, J))
        moved = part.along(np.array([way]), np.ones(1))
        rows.append(moved.coefficients)
        knots.append(knots[-1][-1] + moved.knots[1:])
        way += length
        ends.append(way)
    powers = max(row.shape[1] for row in rows)
    filled = [np.pad(row, ((0, 0), (0, powers - row.shape[1]), (0, 0))) for row in rows]
    return Profile(np.concatenate(knots), np.concatenate(filled)), np.array(ends[:-1])


def goes_on(before: FedMove, after: FedMove) -> bool:
    """Tell whether the way goes on in one direction at one feed."""
    if before.feed != after.feed:
        return False
    last, first = before.at(np.array([before.length]))[1][0], after.at(np.zeros(1))[1][0]
    return bool(np.linalg.norm(last - first) < SMOOTH)


@dataclass(frozen=True)
class ModalState:
    """Hold what a list has said until now.

    move: 0 to 3; scale: [m] of a unit; relative; feed: units per minute; plane: of arcs
    """

    move: int | None = None
    scale: float = UNITS[21]
    relative: bool = False
    feed: float | None = None
    plane: tuple[int, int, int] = PLANES[17]


def read(text: str, at: np.ndarray | None, fastest: float, planar: bool) -> Iterator[FedMove]:
    """Yield the moves of a list; at: where the tool is (3,), None: where the first move leads."""
    modes = ModalState()
    for number, line in enumerate(text.splitlines(), 1):
        with checks.at(f"line {number}: "):
            codes, words = words_of(line)
            modes, ended = said(modes, codes, words)
            moving = {*words} & {*AXES, *OFFSETS, "R"}
            if moving and planar:
                require_planar(modes, words)
            if moving and at is None:
                at = first_point(modes, words, planar)
            elif moving and at is not None:
                one = fed_move(modes, words, at, fastest, number)
                if one is not None:
                    yield one
                    at = one.end
            # The end of a list ends it after the move of its line.
            if ended:
                return


def require_planar(modes: ModalState, words: dict[str, float]) -> None:
    """Refuse what leads out of the plane."""
    if extra := sorted({*words} & {"K", "Z"}):
        raise LinkworkError(f"a planar list has no {extra[0]}; leave it out")
    if modes.plane != PLANES[17]:
        raise LinkworkError("a planar list is in the plane of G17; leave G18 and G19 out")


def words_of(line: str) -> tuple[list[tuple[str, float]], dict[str, float]]:
    """Return the G and M codes of a line, and its other words by letter."""
    left = COMMENT.sub("", line).strip().strip("%")
    codes, words, place = [], {}, 0
    while place < len(left):
        if not (found := WORD.match(left, place)):
            raise LinkworkError(
                f"{checks.shown(left[place:])} is not understood; give words of a letter and a "
                "number, such as X10.5"
            )
        letter, value = found[1].upper(), float(found[2])
        place = found.end()
        if letter in "GM":
            codes.append((letter, value))
        elif letter not in (*AXES, *OFFSETS, "R", "F", "N"):
            raise LinkworkError(f"the word {found[0].strip()!r} is not known; leave it out")
        elif letter in words:
            raise LinkworkError(f"{letter} is given twice; give it once")
        else:
            words[letter] = value
    return codes, words


def said(
    modes: ModalState, codes: Sequence[tuple[str, float]], words: dict[str, float]
) -> tuple[ModalState, bool]:
    """Return what holds after the codes of a line, and whether they end the list."""
    ended = False
    for letter, value in codes:
        if letter == "M" and value in (2, 30):
            ended = True
        elif letter == "G" and value in (0, 1, 2, 3):
            modes = replace(modes, move=int(value))
        elif letter == "G" and value in PLANES:
            modes = replace(modes, plane=PLANES[int(value)])
        elif letter == "G" and value in UNITS:
            modes = replace(modes, scale=UNITS[int(value)])
        elif letter == "G" and value in (90, 91):
            modes = replace(modes, relative=value == 91)
        elif letter == "M" or value not in SILENT:
            raise LinkworkError(
                f"{letter}{value:g} is not known; there are G0 to G3, G17 to G21, G61, G90, G91, "
                "M2 and M30"
            )
    if "F" in words:
        modes = replace(modes, feed=checks.positive(words["F"], "the feed F"))
    return modes, ended


def first_point(modes: ModalState, words: dict[str, float], planar: bool) -> np.ndarray:
    """Return where the first move leads to, which is where the tool is."""
    needed = AXES[:2] if planar else AXES
    lacking = [axis for axis in needed if axis not in words]
    if lacking or modes.relative:
        raise LinkworkError(
            f"where the tool is at first is not known; give {', '.join(needed)} of the first move, "
            "or start="
        )
    return modes.scale * np.array([words.get(axis, 0.0) for axis in AXES])


def fed_move(
    modes: ModalState, words: dict[str, float], at: np.ndarray, fastest: float, number: int
) -> FedMove | None:
    """Return the move that a line asks for, None where it leads nowhere."""
    if modes.move is None:
        raise LinkworkError("no move is chosen; give G0, G1, G2 or G3")
    given = np.array([modes.scale * words.get(axis, np.nan) for axis in AXES])
    end = np.where(np.isnan(given), at, at + given if modes.relative else given)
    end = np.where(np.abs(end - at) <= SAME, at, end)
    feed = fastest
    if modes.move:
        if modes.feed is None:
            raise LinkworkError(f"G{modes.move} has no feed; give F in units per minute")
        feed = modes.scale * modes.feed / MINUTE
    elif not isfinite(fastest):
        raise LinkworkError("G0 is as fast as the limit of the speed; give one")
    if modes.move < 2:
        if extra := sorted({*words} & {*OFFSETS, "R"}):
            raise LinkworkError(f"{extra[0]} belongs to arcs; give G2 or G3")
        return FedMove(at, end, feed, number) if (end != at).any() else None
    return arc(modes, words, FedMove(at, end, feed, number))


def arc(modes: ModalState, words: dict[str, float], line: FedMove) -> FedMove:
    """Return the arc from the start of a line to its end."""
    sense, plane = 1.0 if modes.move == 3 else -1.0, [*modes.plane[:2]]
    a, chord = line.start[plane], (line.end - line.start)[plane]
    way = float(np.hypot(*chord))
    own = [OFFSETS[axis] for axis in plane]
    if strange := sorted({*OFFSETS} - {*own} & {*words}):
        raise LinkworkError(f"{strange[0]} is across the plane of the arc; give {', '.join(own)}")
    if ("R" in words) == bool({*own} & {*words}):
        raise LinkworkError(
            f"an arc has a centre {', '.join(own)} or a radius R; give one of the two"
        )
    across = np.array([-chord[1], chord[0]]) / way if way else np.zeros(2)
    if "R" in words:
        r = modes.scale * words["R"]
        if not way > 0 or abs(r) < way / 2 * (1 - ON_CIRCLE):
            raise LinkworkError(
                f"no arc of the radius R = {words['R']:g} leads from the start to an end "
                f"{way / modes.scale:g} away; give a larger one, or {', '.join(own)}"
            )
        # Of the two centres the one to the left where the shorter arc turns left.
        side = sense * np.sign(r) * sqrt(max(0.0, r**2 - way**2 / 4))
        centre = a + chord / 2 + side * across
    else:
        offset = modes.scale * np.array([words.get(name, 0.0) for name in own])
        radii = np.hypot(*offset), np.hypot(*(a + offset - line.end[plane]))
        if not min(radii) > 0 or abs(radii[1] - radii[0]) > ON_CIRCLE * max(radii):
            raise LinkworkError(
                f"the start is {radii[0] / modes.scale:g} from the centre and the end "
                f"{radii[1] / modes.scale:g}; give a centre between them"
            )
        # Numbers of lists are rounded: the nearest centre as far from both.
        off = (offset - chord / 2) @ chord / way**2 if way else 0.0
        centre = a + offset - off * chord
    u, w = a - centre, line.end[plane] - centre
    angle = np.arctan2(u[0] * w[1] - u[1] * w[0], u @ w)
    sweep = sense * ((sense * angle) % (2 * np.pi)) if way else 0.0
    sweep = sweep or sense * 2 * np.pi
    return replace(line, centre=centre, sweep=sweep, plane=modes.plane)
