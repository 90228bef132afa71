"""Measuring: the quantities of a study's members at the saved times."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np

from linkwork.equations import Equations, body_motion, functions
from linkwork.equations.powers import powers
from linkwork.robot.ensemble import Ensemble, SavedRows, joints
from linkwork.robot.reactions import MEMORY, Samples, transmitted
from linkwork.simulation.threads import usable_processors
from linkwork.sweeps.preparation import Bench
from linkwork.sweeps.quantities import QUANTITIES, REACTIONS

if TYPE_CHECKING:
    from linkwork.robot.members import Members

ACTING = ("joint_acceleration", "actuator_force", "actuator_power", "command", *REACTIONS)
BLOCK = 16384  # saved states that are looked at at a time
ENERGIES = ("kinetic_energy", "potential_energy", "energy")
OF_POSITION = (
    "joint_position",
    "tool_pose",
    "tool_error",
    "tracking_error",
    "drive_state",
    "conditioning",
)


def measured(
    bench: Bench, law: int, ensemble: Ensemble, wanted: Iterable[str], threads: int | None
) -> dict[str, np.ndarray]:
    """Return the wanted quantities (members, times[, components]) of an ensemble; nan at times that
    a member did not reach.

    Angles are those of the joints, turn by turn; tool_error is the tool's distance from the goal's
    motion, in the coordinates of its pose, and tracking_error  x_d - x  of the actuated joints, as
    controllers see it. law: which of the study's controllers; threads: all processors if left out
    """
    wanted, crew = list(wanted), ensemble.members
    shape = (len(ensemble), len(bench.times))
    sizes = {name: QUANTITIES[name].axis for name in wanted}
    values = {name: np.full((*shape, *bench.lengths(axis)), np.nan) for name, axis in sizes.items()}
    first, *others = [block for rows in ensemble.rows() for block in blocks(rows)] or [None]

    def put(rows: SavedRows | None) -> None:
        found = {} if rows is None else everywhere(bench, law, crew, rows, wanted)
        for name in found:
            values[name][rows.members, rows.times] = found[name]  # pyright: ignore[reportOptionalMemberAccess]

    put(first)  # compiles what is needed
    with ThreadPoolExecutor(threads or usable_processors()) as pool:
        list(pool.map(put, others))
    if "joint_position" in wanted and bench.robot.labels.may_wind:
        values["joint_position"] = wound(bench, values["joint_position"], ensemble)
    return values


def blocks(rows: SavedRows) -> Iterator[SavedRows]:
    """Yield saved states some at a time: a block fits the processor's cache, and threads have
    something to share."""
    for first in range(0, len(rows.members), BLOCK):
        yield rows[first : first + BLOCK]


def wound(bench: Bench, positions: np.ndarray, ensemble: Ensemble) -> np.ndarray:
    """Return positions with the turns of angles, counted along each member's run."""
    rates = np.full((*positions.shape[:2], len(bench.robot.rates)), np.nan)
    for rows in ensemble.rows():
        found = rows.measured(partial(joints, ensemble.members))
        rates[rows.members, rows.times] = found["joint_rate"]
    times = np.broadcast_to(bench.times, positions.shape[:2])
    return ensemble.turned(times, positions, rates)


def everywhere(
    bench: Bench, law: int, crew: Members, rows: SavedRows, wanted: Sequence[str]
) -> dict[str, np.ndarray]:
    """Return the wanted quantities of saved states (rows[, components]), also of those where
    singular poses are passed."""
    still = [name for name in wanted if name in OF_POSITION] if rows.nodes else []
    moving = [name for name in wanted if name not in still]
    found = of_rows(bench, law, crew, rows, still) if still else {}
    return found | rows.measured(lambda rows: of_rows(bench, law, crew, rows, moving))


def of_rows(
    bench: Bench, law: int, crew: Members, rows: SavedRows, wanted: Sequence[str]
) -> dict[str, np.ndarray]:
    """Return the wanted quantities of states (rows[, components])."""
    # What acts, which accelerations follow from.
    robot, chart, t = bench.robot, rows.chart, rows.t
    (q, v, z), p_robot = rows.split(), crew.p_robot(rows.members)
    found: dict[str, np.ndarray] = {"drive_state": z[:, : len(bench.extras)]}
    acceleration = 0 * v
    if set(ACTING) & set(wanted):
        acceleration, found["command"], found["actuator_force"] = forced(crew, rows, t)
    if "actuator_power" in wanted:
        actuated = chart.compiled("powers", powers)(q, v, p_robot)[0]
        found["actuator_power"] = found["actuator_force"] * actuated
    # Joints.
    positions, joint_rates, joint_accelerations, _ = chart.kernel("joints_motion")(
        q, v, acceleration, p_robot
    )
    found |= {
        "joint_position": positions,
        "joint_rate": joint_rates,
        "joint_acceleration": joint_accelerations,
    }
    if set(REACTIONS) & set(wanted):
        samples = Samples(
            chart.with_parameters(p_robot), q, v, acceleration, found["actuator_force"]
        )
        found |= dict(zip(REACTIONS, reactions(bench, samples), strict=True))
    # What controllers lead, beside what they were told.
    if "tracking_error" in wanted:
        actuated = [robot.coordinates.index(name) for name in robot.actuators]
        found["tracking_error"] = bench.wanted_joints(law)(t) - positions[:, actuated]
    if {"tool_pose", "tool_error"} & set(wanted):
        found["tool_pose"] = poses(robot.chart.compiled("tool", tool)(q, p_robot)[0])
    if "tool_error" in wanted:
        found["tool_error"] = bench.tool_error(law, rows.times, found["tool_pose"])
    # Energies and conditioning.
    if set(ENERGIES) & set(wanted):
        kinetic, potential, _ = chart.kernel("energy")(q, v, p_robot)
        found |= dict(
            zip(
                ENERGIES, (kinetic[:, 0], potential[:, 0], (kinetic + potential)[:, 0]), strict=True
            )
        )
    if "conditioning" in wanted:
        found["conditioning"] = np.abs(
            robot.kernel("tree_rates")(q, np.zeros(robot.mobility), p_robot)[1][:, 0]
        )
    return {name: found[name] for name in wanted}


def tool(equations: Equations) -> ca.Function:
    """Return q -> the first tool's pose: x, y, angle where it moves in the plane, else position and
    matrix, row by row."""
    position, orientation, angle = body_motion.tool_pose(
        equations.tree, next(iter(equations.mechanism.tools.values()))
    )
    pose = (
        ca.vertcat(position[:2], angle)
        if body_motion.is_planar(equations.tree)
        else ca.vertcat(position, orientation)
    )
    return functions.function("tool", equations, {"q": equations.tree.q}, {"pose": pose})


def poses(found: np.ndarray) -> np.ndarray:
    """Return the poses (rows, 3) or (rows, 6), with rotation vectors, of what `tool` gives."""
    if found.shape[1] == 3:
        return found
    from scipy.spatial.transform import Rotation

    turns = Rotation.from_matrix(found[:, 3:].reshape(-1, 3, 3)).as_rotvec()
    return np.concatenate([found[:, :3], turns], axis=1)


def reactions(bench: Bench, samples: Samples) -> tuple[np.ndarray, np.ndarray]:
    """Return how large the moments, about the origins of F1, and the forces are that joints
    transmit (rows, joints).

    The samples' chart has a row of parameters for each sample, or one for all.
    """
    size, p = max(1, MEMORY // bench.network.numbers), samples.chart.p
    parts = []
    for first in range(0, len(samples.q), size):
        rows = slice(first, first + size)
        part = replace(
            samples[rows], chart=samples.chart.with_parameters(p[rows] if len(p) > 1 else p)
        )
        parts.append(transmitted(bench.robot, [part], (len(part.q),), length=bench.spread).wrenches)
    moment, force = np.split(np.concatenate(parts), 2, axis=-1)
    return np.linalg.norm(moment, axis=-1), np.linalg.norm(force, axis=-1)


def forced(
    crew: Members, rows: SavedRows, t: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return accelerations of the independent rates, commands and actuator forces of saved
    states."""
    q, v, z = rows.split()
    inputs = np.concatenate([crew.system.inputs(t), rows.held], axis=1)
    p = crew.p[rows.members] if len(crew.p) > 1 else crew.p
    if crew.system.acting is None:
        return (
            rows.chart.kernel("motion")(q, v, inputs, crew.p_robot(rows.members))[1],
            inputs,
            inputs,
        )
    found = crew.system.kernel(rows.chart, "recorded")(q, v, z, inputs, p)
    return found[0], found[1], found[2]
