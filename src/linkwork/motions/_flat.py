"""Flat motions: the motors of elastic joints from the motion of what they drive.

A motor with the coordinate theta and the inertia B drives the coordinate q by a spring along
l = l_0 + r_m theta + r_q q. With the force f that q needs, which follows from the motion of the
links as if they were driven themselves,

    T = f / r_q = -k (l - rest)    ->  theta,        u = B theta'' - r_m T

so that theta'' takes f'', and this the fourth derivative of the links' motion: q is a flat output.
f' and f'' are exact, by the chain rule along the motion.
Source: Spong, J. Dyn. Syst. Meas. Control 109 (1987) 310-319; Fliess, Levine, Martin & Rouchon,
Int. J. Control 61 (1995) 1327-1361 (flatness).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from linkwork import checks
from linkwork.equations.algebra import SX
from linkwork.equations.functions import forces_needed
from linkwork.errors import LinkworkError
from linkwork.mechanism import Combination, Friction, Mechanism, SlackSpring
from linkwork.mechanism.bearing import require_no_bearings
from linkwork.mechanism.effects import Effects
from linkwork.mechanism.limits import meetings
from linkwork.mechanism.sticking import strains
from linkwork.model.charts import CompiledChart
from linkwork.model.state import Motion, State
from linkwork.motions.leaps import require_no_leap
from linkwork.motions.timed_paths import TimedPath
from linkwork.robot import Robot

LEAP = 1e-9  # of a derivative of a path, over its largest, that is more than rounding
DERIVATIVES = ("positions", "rates", "accelerations", "jerks", "snaps")


class SpringDrive(NamedTuple):
    """Hold a motor, the coordinate that it drives, the transmission between both by its name, and
    the motor's inertia."""

    motor: str
    driven: str
    name: str
    line: Combination
    inertia: float


def flat(
    robot: Robot,
    time: ArrayLike,
    joints: Sequence[str],
    *derivatives: ArrayLike,
    guess: State | None = None,
) -> Motion:
    """Return the motion of a robot with elastic joints, motors included, for a motion of its links.

        theta = (rest - f / (k r_q) - l_0 - r_q q) / r_m,    u = B theta'' - r_m f / r_q

    Args:
        robot: whose actuators are motors behind springs, and joints that are driven themselves.
        time: t (K,) [s].
        joints: names of joints, no motors, that determine the motion of the links.
        derivatives: their coordinates and the first four derivatives (K, d): positions [m, rad],
            rates, accelerations, jerks, snaps [m/s^4, rad/s^4].
        guess: a state of the links' branch, near the first position; `home` if left out.

    Returns:
        A `Motion` with the actuators' `forces`, which `robot.inverse_dynamics` gives as a signal;
        a run from its first state under these moves so.

    Raises:
        LinkworkError: what is not flat, by name: a damper beside a spring, parts that meet or stick
            or have bearings, actuators that do not drive the links one by one.
    """
    checks.needed(robot, Robot)
    drives = spring_drives(robot)
    t = checks.finite(time, "the times")
    require_increasing(t)
    given = arrays(derivatives, t.size, len(joints))
    links = robot.once(links_of)
    require_flat(links, joints)
    # The links' motion, and the forces that they need.
    states, before = [], None if guess is None else linked(links, guess)
    for k, point in enumerate(given[0]):
        with checks.at(f"at t = {t[k]:.6g} s: "):
            before = links.assemble(dict(zip(joints, point.tolist(), strict=True)), guess=before)
        states.append(before)
    q = np.array([state.positions for state in states])
    led = links.in_chart(links.state(q), tuple(joints)).with_rates(given[1])
    forces = np.moveaxis(needed(links, led, given[2:]), 0, 2)
    moving = np.array([links.joint_rates(led), links.joint_accelerations(led, given[2])])
    motion = dict(zip(links.rates, np.moveaxis(moving, 0, 2).swapaxes(0, 1), strict=True))
    by_name = dict(zip(links.actuators, np.moveaxis(forces, 1, 0), strict=True))
    return with_motors(robot, t, led, motion, by_name, drives)


def links_of(robot: Robot) -> Robot:
    """Return the links of a robot, driven themselves."""
    return Robot(driven_links(robot.mechanism, spring_drives(robot)))


def flat_along(robot: Robot, timed: TimedPath, samples: int, guess: State | None) -> Motion:
    """Return the flat motion along a timed path of links' joints, which has to be made of
    polynomials of time whose jerk goes on from one to the next."""
    profile = timed.profile
    if profile is None:
        raise LinkworkError(
            "elastic joints take the fourth derivative of the links' motion, which a curve with a "
            "law does not tell; make the path of polynomials, as point_to_point does"
        )
    for order, what in enumerate(DERIVATIVES[:-1]):
        inner = profile.knots[1:-1]
        before = profile.derivatives[min(order, profile.degree + 1)][:-1]
        powers = np.diff(profile.knots)[:-1, None, None] ** np.arange(before.shape[1])[:, None]
        leap = np.abs((before * powers).sum(axis=1) - profile(inner, order))
        largest = np.maximum(profile.extremes(order), np.finfo(float).tiny)
        if (leap > LEAP * largest).any():
            k = int((leap / largest).max(axis=1).argmax())
            raise LinkworkError(
                f"the {what} of the path leap at t = {inner[k]:.6g} s, where elastic joints would "
                "take a torque without bound; take law='septic', or polynomials of higher degree"
            )

    def led(time: np.ndarray, guess: State | None) -> Motion:
        parts = [profile(time, order) for order in range(len(DERIVATIVES))]
        return flat(robot, time, timed.names, *parts, guess=guess)

    motion = led(np.linspace(0, timed.duration, samples), guess)
    require_no_leap(robot, motion, timed.names, led)
    return motion


def leads_links(robot: Robot, names: Sequence[str]) -> bool:
    """Tell whether coordinates are those of links that motors drive through springs, the motors
    themselves not being led."""
    if len(names) >= robot.mobility:
        return False
    motors = {drive.motor for drive in drives_of(robot.mechanism)}
    return bool(motors) and not motors & {*names}


def require_increasing(t: np.ndarray) -> None:
    """Refuse times that are no sequence, or that do not increase."""
    if t.ndim != 1:
        raise LinkworkError(f"the times have the shape {t.shape}; give a sequence of them")
    if (late := np.flatnonzero(np.diff(t) <= 0)).size:
        k = int(late[0])
        raise LinkworkError(
            f"the times have {t[k + 1]:g} s after {t[k]:g} s, at index {k + 1}; they have to "
            "increase"
        )


def arrays(derivatives: Sequence[ArrayLike], count: int, width: int) -> list[np.ndarray]:
    """Return the positions and their four derivatives (count, width)."""
    if len(derivatives) != len(DERIVATIVES):
        raise LinkworkError(
            f"{checks.amount_is(len(derivatives), 'array')} given; a flat motion takes "
            f"{', '.join(DERIVATIVES)}"
        )
    found = []
    for name, values in zip(DERIVATIVES, derivatives, strict=True):
        found.append(checks.finite(values, f"the {name}"))
        if found[-1].shape != (count, width):
            raise LinkworkError(
                f"the {name} have the shape {found[-1].shape}; give one row of {width} numbers for "
                f"each of {count} times"
            )
    return found


def spring_drives(robot: Robot) -> tuple[SpringDrive, ...]:
    """Return the motors behind springs; refuse a robot without."""
    found = tuple(drives_of(robot.mechanism))
    if not found:
        raise LinkworkError(
            f"no actuator of {', '.join(robot.actuators) or 'the robot'} is a motor behind a "
            "spring; give a joint the field elastic, or take follow and inverse_dynamics"
        )
    return found


def drives_of(mechanism: Mechanism) -> Iterator[SpringDrive]:
    """Yield the motors that turn or slide nothing but their own inertia and a spring."""
    for motor in mechanism.actuators:
        joint = mechanism.pairs.get(motor)
        lines = {
            name: line
            for name, line in mechanism.transmissions.items()
            if isinstance(line, Combination) and line.ratios.get(motor)
        }
        if joint is None or len(lines) != 1 or not alone(mechanism, motor):
            continue
        [(name, line)] = lines.items()
        (own,) = joint.effects().values()
        others = [label for label, ratio in line.ratios.items() if ratio and label != motor]
        if len(others) != 1 or not line.spring.stiffness:
            continue
        require_plain(motor, own, name, line)
        yield SpringDrive(motor, others[0], name, line, own.rotor)


def require_plain(motor: str, own: Effects, name: str, line: Combination) -> None:
    """Refuse what makes a motor behind a spring not flat."""
    if line.spring.damping:
        raise LinkworkError(
            f"transmissions.{name}: has a damper beside its spring, so that the motor's way "
            "follows from a differential equation and not from the links' motion; leave its "
            "damping out"
        )
    more = line.spring.slack or any(line.spring.powers) or line.stop or line.inertia
    if more or line.friction != Friction():
        raise LinkworkError(
            f"transmissions.{name}: has more than a linear spring, so that the motion of the links "
            "does not tell that of the motor; leave slack, powers, friction, stop and inertia out"
        )
    if own != Effects(rotor=own.rotor):
        raise LinkworkError(
            f"joints.{motor}: has more than a rotor's inertia; give what acts in it to the "
            "joint that it drives"
        )


def alone(mechanism: Mechanism, motor: str) -> bool:
    """Tell whether a motor moves one body without mass that nothing else holds."""
    for body in mechanism.pairs[motor].connects:
        own = mechanism.bodies.get(body)
        joints = [name for name, joint in mechanism.pairs.items() if body in joint.connects]
        if own and joints == [motor] and not own.mass and not own.inertia.tensor().any():
            return True
    return False


def driven_links(mechanism: Mechanism, drives: Sequence[SpringDrive]) -> Mechanism:
    """Return the mechanism without motors behind springs, what they drive being driven itself."""
    by_motor, gone = {drive.motor: drive for drive in drives}, {drive.name for drive in drives}
    rotors = {
        body
        for motor in by_motor
        for body in mechanism.pairs[motor].connects
        if body in mechanism.bodies
        and [n for n, joint in mechanism.pairs.items() if body in joint.connects] == [motor]
    }
    parts = {
        "bodies": {n: b for n, b in mechanism.bodies.items() if n not in rotors},
        "joints": {n: j for n, j in mechanism.joints.items() if n not in by_motor},
        "transmissions": {n: x for n, x in mechanism.transmissions.items() if n not in gone},
        "reference": {n: x for n, x in mechanism.reference.items() if n not in by_motor},
        "actuators": tuple(
            by_motor[name].driven if name in by_motor else name for name in mechanism.actuators
        ),
    }
    return mechanism.model_copy(update=parts)


def require_flat(links: Robot, joints: Sequence[str]) -> None:
    """Refuse links whose forces do not follow from their motion, or have no second derivative."""
    mechanism = links.mechanism
    checks.known(joints, links.rates, "joint of the links")
    for what in (*meetings(mechanism), *(strain.of for strain in strains(mechanism))):
        raise LinkworkError(
            f"{what}: presses or sticks with a force that has no second derivative, or a state of "
            "its own, so that the links' motion does not tell that of the motors; leave it out"
        )
    lines = mechanism.transmissions.items()
    for name in (n for n, line in lines if isinstance(getattr(line, "spring", 0), SlackSpring)):
        if mechanism.transmissions[name].spring.slack:  # pyright: ignore
            raise LinkworkError(f"transmissions.{name}: has slack, where its force has a corner")
    require_no_bearings(
        mechanism.joints, "a flat motion leaves out", "give these joints plain friction"
    )
    if len(joints) != links.mobility or len(links.actuators) != links.mobility:
        raise LinkworkError(
            f"the links have {links.mobility} freedoms ({', '.join(links.independent)}), but "
            f"{', '.join(joints) or 'no joints'} are led and {', '.join(links.actuators)} driven; "
            "a flat motion takes as many of each"
        )


def needed(links: Robot, led: State, higher: Sequence[np.ndarray]) -> np.ndarray:
    """Return the actuator forces u of the links and their first two time derivatives (3, K, n)."""
    return np.array(
        [
            np.array(part).T
            for part in links.once(force_derivatives, links.chart_of(led))(
                led.q.T, led.rates.T, *(part.T for part in higher), links.p
            )
        ]
    )


def force_derivatives(links: Robot, chart: CompiledChart) -> ca.Function:
    """Return (q, v, v', v'', v''', p) -> u, u', u'' of actuators that drive all rates."""
    equations = chart.equations
    n = equations.mobility
    v, derivatives = equations.v, [SX.sym(f"d{k}v", n) for k in (1, 2, 3)]
    chain = [equations.tree.q, v, *derivatives[:-1]]
    rates = [equations.tree.derivatives(equations.rates), *derivatives]
    forces = forces_needed(equations, derivatives[0], SX.zeros(n))
    found = [ca.solve(ca.densify(equations.actuation.T), ca.densify(forces))]
    for _ in range(2):
        along = (ca.jtimes(found[-1], x, dx) for x, dx in zip(chain, rates, strict=True))
        found.append(sum(along, SX.zeros(n)))
    inputs = [equations.tree.q, v, *derivatives, equations.p]
    return ca.Function("force_derivatives", inputs, found, {"cse": True})


def linked(links: Robot, state: State) -> State:
    """Return a robot's state as one of its links alone."""
    return links.state({name: state[name] for name in links.coordinates})


def with_motors(
    robot: Robot,
    time: np.ndarray,
    led: State,
    motion: dict[str, np.ndarray],
    forces: dict[str, np.ndarray],
    drives: Sequence[SpringDrive],
) -> Motion:
    """Return the motion of the whole robot.

    motion: rates and accelerations (K, 2) of the links' joints; forces: what each actuator of the
        links would take, and its derivatives (K, 3)
    """
    positions = {name: led[name] for name in led.coordinates}
    moving, u = dict(motion), {name: force[:, 0] for name, force in forces.items()}
    for drive in drives:
        line, ratios, f = drive.line, drive.line.ratios, forces[drive.driven]
        r_m, r_q, k = ratios[drive.motor], ratios[drive.driven], line.spring.stiffness
        q, dq = positions[drive.driven], motion[drive.driven]
        positions[drive.motor] = (
            line.spring.rest - line.offset - f[:, 0] / (k * r_q) - r_q * q
        ) / r_m
        moving[drive.motor] = (-f[:, 1:] / (k * r_q) - r_q * dq) / r_m
        u[drive.motor] = drive.inertia * moving[drive.motor][:, 1] - r_m * f[:, 0] / r_q
    state = robot.state(positions, {name: moving[name][:, 0] for name in robot.independent})
    dv = np.array([moving[name][:, 1] for name in state.independent]).T
    tool = robot.tool_pose(state) if robot.mechanism.tools else np.zeros((time.size, 0))
    return Motion(
        time,
        state,
        dv,
        robot.joint_rates(state),
        robot.joint_accelerations(state, dv),
        tool,
        forces=np.array([u[name] for name in robot.actuators]).T,
    )
