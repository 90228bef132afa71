"""Angles that turn alone: once more, with all bodies where they are; and angles with which gears
turn others, idle wheels that nothing else depends on (rotors) and shown ones that bodies stand by.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from math import lcm

import casadi as ca
import numpy as np

from linkwork.equations import body_motion
from linkwork.mechanism import Combination, GearJoint
from linkwork.model.closing import bending
from linkwork.model.turning import behind_threads, threaded
from linkwork.robot import Robot

MESHES = 60  # turns at most after which gears are known to stand as they did
ALIKE = 1e-9  # in own units, by which poses and residuals may differ that are one


def turns_alone(robot: Robot, label: str) -> bool:
    """Tell whether a joint coordinate is an angle that may turn once more with all bodies where
    they are, as that of a thread may not, and with all gears in mesh."""
    if robot.unit(label) != "rad" or not robot.joints_asked((label,)).wraps[0]:
        return False
    return label not in robot.equations.tree.places or robot.once(comes_back, label)


def comes_back(robot: Robot, label: str) -> bool:
    """Tell whether a coordinate is an angle after a turn of which all bodies are where they were,
    whatever gears tie it to."""
    if label in robot.equations.tree.places:
        return robot.unit(label) == "rad" and not moved_by(robot, label, 2 * np.pi)
    return label in robot.labels.jumping


def moved_by(robot: Robot, label: str, shift: float) -> set[str]:
    """Return the bodies that a shift [m, rad] of a coordinate of the tree alone moves."""
    tree, q, still = robot.equations.tree, robot.home.q, np.zeros(robot.mobility)
    turned = np.array(q)
    turned[tree.places[label]] += shift
    (p, R, *_), (p_turned, R_turned, *_) = (
        robot.kernel("bodies_motion")(each, still) for each in (q, turned)
    )
    away = np.concatenate(
        [(p_turned - p).reshape(-1, 3) / tree.length, (R_turned - R).reshape(-1, 9)], axis=1
    )
    moved = np.abs(away).max(axis=1, initial=0.0) >= ALIKE
    return {body for body, there in zip(robot.bodies, moved, strict=True) if there}


def idle_wheels(robot: Robot) -> tuple[str, ...]:
    """Return the angles of the tree that gears alone tie to others: neither loops nor the tool
    depend on them in another way."""
    equations, mechanism = robot.equations, robot.mechanism
    Phi, tree, meshes = equations.rows.Phi, equations.tree, gear_rows(robot)
    pose = body_motion.tool_pose(tree, mechanism.first_tool) if mechanism.tools else ()
    leads = ca.which_depends(ca.vertcat(ca.SX(0, 1), *pose), tree.q, 1, False)
    entries = [*zip(*Phi.sparsity().get_triplet(), strict=True)]
    tied = {c for r, c in entries if r not in meshes}
    geared = {c for r, c in entries if r in meshes}
    bends = bending(tree, Phi)
    return tuple(
        label
        for place, rate in tree.single
        if (label := tree.coordinates[place])
        and rate in geared - tied
        and not (tree.slides[rate] or leads[place] or bends[rate])
    )


def gear_rows(robot: Robot) -> list[int]:
    """Return the places of the closure rows that are gears."""
    names = [name.partition(":")[0] for name in robot.equations.rows.names]
    return [k for k, name in enumerate(names) if name in robot.mechanism.gears]


def shown(robot: Robot, label: str) -> tuple[str, ...]:
    """Return the coordinates that tell where an angle is by how bodies stand: those that gears tie
    to it, but idle wheels; itself where gears tie it to the lengths of cables."""
    found, left = {label}, [label]
    while left:
        near = left.pop()
        for gear in robot.mechanism.gears.values():
            names = labels_of(robot, gear)
            if near in names:
                if not names <= {*robot.coordinates}:
                    return (label,)
                left += names - found
                found |= names
    idle = robot.once(idle_wheels)
    return tuple(name for name in robot.coordinates if name in found and name not in idle)


def labels_of(robot: Robot, gear: GearJoint) -> set[str]:
    """Return what a gear couples, sums by their coordinates."""
    found = set[str]()
    for label in gear.coupled:
        line = robot.mechanism.transmissions.get(label)
        found |= {*line.ratios} if isinstance(line, Combination) else {label}
    return found


def turned_with(robot: Robot, label: str) -> np.ndarray | None:
    """Return what the tree's coordinates (nq) grow by with a whole turn of one of them that leaves
    loops closed and all bodies but idle wheels where they are; None where there is none."""
    tree, Phi = robot.equations.tree, robot.equations.rows.Phi
    idle = robot.once(idle_wheels)
    if label in idle or label not in tree.places or not robot.once(comes_back, label):
        return None
    # The wheels turn as the gears of home say.
    G = np.array(tree.evaluated("gears", [Phi], robot.p)(robot.home.q)[0])[gear_rows(robot)]
    wheels = [tree.rate_places[name] for name in idle]
    turn, asked = np.zeros(len(tree.coordinates)), -2 * np.pi * G[:, tree.rate_places[label]]
    turn[[tree.places[name] for name in idle]] = np.linalg.lstsq(G[:, wheels], asked, rcond=None)[0]
    turn[tree.places[label]] = 2 * np.pi
    # All loops are as open as before, wherever the joints are.
    q = robot.home.q + 0.3 * np.random.default_rng(1842).standard_normal(turn.size)
    opened = robot.chart.residuals(q + turn) - robot.chart.residuals(q)
    size = np.abs(turn).max() * robot.equations.rows.units
    return turn if (np.abs(opened) <= ALIKE * size).all() else None


def meshing_turns(robot: Robot) -> dict[str, int]:
    """Return after how many turns angles that gears tie, and bodies stand by, may all be back as
    they were, by label; 0 where they never are, for a ratio of gears that is no fraction."""
    idle, found = robot.once(idle_wheels), dict[str, int]()
    for gear in robot.mechanism.gears.values():
        names = labels_of(robot, gear)
        if names & {*idle} or not all(name in robot.coordinates for name in names):
            continue
        told = sorted(name for name in names if robot.once(comes_back, name))
        ratios = [gear.ratios.get(name, 0.0) / (gear.ratios.get(told[0]) or 1.0) for name in told]
        fractions = [Fraction(ratio).limit_denominator(MESHES) for ratio in ratios]
        apart = [abs(ratio - part) for ratio, part in zip(ratios, fractions, strict=True)]
        parts = [part for each in fractions for part in each.as_integer_ratio() if part]
        plain = names == {*gear.coupled} and not gear.powers and max(apart, default=0) < ALIKE
        turns = lcm(*parts) if plain else 0
        found |= {name: turns * found.get(name, 1) for name in told if len(told) > 1}
    return found


def with_threads(robot: Robot, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return closed configurations (N, nq) with the whole turns of their threads in the angles that
    turn as these do, and where they can be had (N)."""
    q, good = q.copy(), np.ones(len(q), bool)
    for place, turns in behind_threads(robot.chart, robot.home.q, q).items():
        label = robot.equations.tree.coordinates[place]
        if (turn := robot.once(turned_with, label)) is None:
            good &= turns == 0
        else:
            q += turns[:, None] * turn
    return q, good


def meshed(robot: Robot, q: np.ndarray, given: Sequence[str]) -> np.ndarray:
    """Return configurations (N, nq) with gears in mesh that are sums of the tree's coordinates, and
    with the turns of threads, by idle wheels, else by others that are not given."""
    tree, Phi = robot.equations.tree, robot.equations.rows.Phi
    rows = [k for k in gear_rows(robot) if not bending(tree, Phi[k, :]).any()]
    G = np.array(tree.evaluated("gears", [Phi], robot.p)(robot.home.q)[0])[rows]
    for label, thread, ratio in threaded(robot.chart):
        pair = [robot.coordinates[int(place)] for place in (label, thread)]
        if all(name in tree.places for name in pair):
            G = np.append(G, np.zeros((1, G.shape[1])), axis=0)
            G[-1, [tree.rate_places[name] for name in pair]] = 1.0, -ratio
    if not len(G):
        return q
    idle, places = robot.once(idle_wheels), dict(tree.single)
    free = [(i, k) for i, k in places.items() if tree.coordinates[i] not in given]
    wheels = [k for i, k in free if tree.coordinates[i] in idle]
    others = [k for i, k in free if tree.coordinates[i] not in idle]
    # What wheels cannot do is left to others.
    w, own, rates = np.zeros((len(q), G.shape[1])), [*places], [*places.values()]
    w[:, rates] = q[:, own] - robot.home.q[own]
    W, off = G[:, wheels], w @ G.T
    left = np.eye(len(G)) - W @ np.linalg.pinv(W)
    w[:, others] -= off @ np.linalg.pinv(left @ G[:, others]).T
    w[:, wheels] -= (w @ G.T) @ np.linalg.pinv(W).T
    q = q.copy()
    q[:, own] = robot.home.q[own] + w[:, rates]
    return q
