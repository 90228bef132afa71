"""Transmission indices: which share of the largest power that a leg's transmission wrench could
transmit it does transmit.

With the transmission wrench T_i of leg i (`leg_wrenches`), the twist I_i of its actuator and the
twist O_i that the platform has where all other actuators are locked,

    input   lambda_i = |T_i . I_i| / max |T_i . I_i|
    output  eta_i    = |T_i . O_i| / max |T_i . O_i|

are power coefficients between 0 and 1: what is attained over what T would attain if it were turned
about its characteristic point C, where it enters the leg's first passive joint, or the platform.
For a force f at C with the pitch h, and a twist with velocity v_C there,

    lambda or eta = |f . (v_C + h omega)| / (|f| |v_C + h omega|);    of a couple |m . omega| / ...

In the plane these are the sines of the transmission angles. They depend on no choice of frame or
unit. lambda is 0 where a leg is singular, eta where the actuators are (kind II).

Source: Wang, Wu & Liu, Mechanism and Machine Theory 45 (2010) 1462-1476 (power coefficients of
transmission wrenches with input and output twists, their least value as the local transmission
index); Chen & Angeles, Mechanism and Machine Theory 42 (2007) 1225-1237 (characteristic points).
"""

from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass

import numpy as np

from linkwork.analysis.leg_wrenches import (
    PIN,
    RANK,
    Link,
    PlatformLeg,
    legs_at,
    links_at,
    null_space,
    on_line,
    pinned,
    transmitted,
    widths,
)
from linkwork.checks import needed
from linkwork.equations.algebra import cross_product
from linkwork.errors import LinkworkError
from linkwork.mechanism import GROUND
from linkwork.mechanism.joints import OneFreedom
from linkwork.robot import Robot, State


@dataclass(frozen=True, eq=False)
class TransmissionIndices:
    """Hold how well the legs of a robot transmit motion and force at states (...).

    actuators: names (n), one of each leg
    input, output: indices (..., n) from 0 to 1; of a leg whose actuator does not move the platform
        the input index is 0 and the output index nan, and so is the output index where a locked
        robot has more than one free motion
    wrenches: T (..., n, 6), [moment about the ground's origin; force], of length 1 in the
        mechanism's own unit
    """

    actuators: tuple[str, ...]
    input: np.ndarray
    output: np.ndarray
    wrenches: np.ndarray

    @property
    def local(self) -> np.ndarray:
        """Return the local transmission index (...): the least of all, nan left out."""
        both = np.concatenate([self.input, self.output], axis=-1)
        return np.nanmin(both, axis=-1)

    @property
    def output_angle(self) -> np.ndarray:
        """Return the output transmission angles (..., n) [rad], arc sines of the indices."""
        return np.arcsin(np.minimum(self.output, 1.0))

    @property
    def input_angle(self) -> np.ndarray:
        """Return the input transmission angles (..., n) [rad]."""
        return np.arcsin(np.minimum(self.input, 1.0))


def transmission_indices(robot: Robot, state: State) -> TransmissionIndices:
    """Return the input and output transmission indices of a parallel robot at states.

    Args:
        robot: with legs of one actuator each, that slides or turns, between what the tool is
            relative to and the tool's body (its pin, where a tool that is led in its place alone
            sits in a joint, as that of a five-bar).
        state: one or a stack of closed configurations; their rates do not matter.

    Raises:
        LinkworkError: no tool or no actuators; gears; a leg with several actuators, with one that
            turns between two moving bodies, or without a unique transmission wrench, by name.
    """
    needed(robot, Robot)
    needed(state, State)
    # All moments are about the tool, however far from the ground's origin it is.
    robot.require_tool()
    require_single(robot)
    tool, count = robot.mechanism.first_tool, int(np.prod(state.batch, dtype=int))
    poses = {
        name: (
            np.broadcast_to(p.reshape(-1, 3), (count, 3)),
            np.broadcast_to(R.reshape(-1, 3, 3), (count, 3, 3)),
        )
        for name, (p, R) in ({GROUND: (np.zeros(3), np.eye(3))} | robot.body_poses(state)).items()
    }
    p, R = poses[tool.body]
    tips = p + R @ tool.frame.position
    near = {name: (p - tips, R) for name, (p, R) in poses.items()}
    # Legs are the same at all states.
    legs, platform = legs_of(robot, links_at(robot, near), tool.relative_to)
    require_driven(robot, {leg.driven.name for leg in legs if leg.driven}, platform)
    found = [
        at_one(robot, [leg.at(k) for leg in legs], platform, tip) for k, tip in enumerate(tips)
    ]
    n = len(robot.actuators)
    parts = [
        np.reshape([one[k] for one in found], (*state.batch, *shape))
        for k, shape in enumerate([(n,), (n,), (n, 6)])
    ]
    return TransmissionIndices(robot.actuators, *parts)


def require_single(robot: Robot) -> None:
    """Refuse robots without actuators, and actuators that are no joints of one freedom."""
    if not robot.actuators:
        raise LinkworkError("the robot has no actuators that transmit; name some under 'actuators'")
    for name in robot.actuators:
        if not isinstance(robot.mechanism.joints.get(name), OneFreedom):
            raise LinkworkError(
                f"the actuator {name!r} drives no joint of one freedom; transmission indices are "
                "those of joints that turn or slide"
            )


def at_one(
    robot: Robot, legs: list[PlatformLeg], platform: str, tip: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return input and output indices (n) and transmission wrenches (n, 6) at one configuration, by
    legs there, moments about the tip (3)."""
    base, length = robot.mechanism.first_tool.relative_to, robot.equations.tree.length
    width = widths(length)
    found = [transmitted(leg, base, platform, length) for leg in legs]
    by_actuator = {leg.driven.name: k for k, leg in enumerate(legs) if leg.driven}
    # What holds the platform but for one actuator leaves it one motion.
    inputs, outputs, wrenches = [], [], []
    for name in robot.actuators:
        k = by_actuator[name]
        T, leg = found[k][0], legs[k]
        others = [wrench for j, (wrench, _) in enumerate(found) if j != k and legs[j].driven]
        held = np.column_stack([*others, *(free for _, free in found)])
        inputs.append(input_index(T, leg, base, platform))
        outputs.append(output_index(T, leg, platform, held / width[:, None], width))
        moment = T[:3] + cross_product(tip, T[3:])
        wrenches.append(np.array([*moment, *T[3:]]) / np.linalg.norm(T / width))
    return np.array(inputs), np.array(outputs), np.array(wrenches)


def legs_of(robot: Robot, links: list[Link], base: str) -> tuple[list[PlatformLeg], str]:
    """Return the legs and the platform: the pin of a hinge that the tool sits in where each leg
    then has one actuator, the tool's body else."""
    if (split := pinned(robot, links)) is not None:
        legs = [*legs_at(split, base, PIN)]
        if all(len(leg.drives) <= 1 for leg in legs):
            return legs, PIN
    platform = robot.mechanism.first_tool.body
    legs = [*legs_at(links, base, platform)]
    for leg in legs:
        if len(leg.drives) > 1:
            names = ", ".join(link.name for link in leg.drives)
            raise LinkworkError(
                f"the actuators {names} drive one leg between {base!r} and {platform!r}, which has "
                "no unique transmission wrench; its indices need legs with one actuator each"
            )
    return legs, platform


def require_driven(robot: Robot, driven: Container[str], platform: str) -> None:
    """Refuse actuators that are in no leg."""
    base = robot.mechanism.first_tool.relative_to
    for name in robot.actuators:
        if name not in driven:
            raise LinkworkError(
                f"the actuator {name!r} is in no leg between {base!r} and {platform!r}; "
                "transmission indices need legs with one actuator each"
            )


def input_index(T: np.ndarray, leg: PlatformLeg, base: str, platform: str) -> float:
    """Return lambda of a leg; 0 where its actuator does not move the platform."""
    driven = leg.driven
    assert driven is not None and driven.twist is not None
    if driven.axis.any() and base not in driven.bodies:
        raise LinkworkError(
            f"the actuator {driven.name!r} turns between two bodies that move, where its leg has "
            "no characteristic point; input indices are those of actuators that slide, or turn at "
            f"{base!r}"
        )
    if not np.isfinite(T).all():
        return 0.0
    body = next((name for name in driven.bodies if name != base), platform)
    beside = leg.attached(body) or [driven]
    return share(T, driven.twist, on_line(T, beside, body))


def output_index(
    T: np.ndarray, leg: PlatformLeg, platform: str, held: np.ndarray, width: np.ndarray
) -> float:
    """Return eta of a leg; held: in own units, what else holds the platform (6, k)."""
    if not (np.isfinite(T).all() and np.isfinite(held).all()):
        return float("nan")
    motions = null_space((held / np.linalg.norm(held, axis=0)).T) / width[:, None]
    if platform == PIN:
        motions = unspun(motions, leg)
    if motions.shape[1] != 1:
        return float("nan")
    return share(T, motions[:, 0], on_line(T, leg.attached(platform) or [*leg.links], platform))


def unspun(motions: np.ndarray, leg: PlatformLeg) -> np.ndarray:
    """Return motions (6, k) of a pin, at the origin, without its turn about its own axis."""
    (hinge,) = {tuple(link.axis) for link in leg.attached(PIN)}
    weights = null_space((hinge @ motions[:3])[None])
    return motions @ weights


def share(wrench: np.ndarray, twist: np.ndarray, place: np.ndarray) -> float:
    """Return the power of a wrench on a twist over the largest that it would have if it were turned
    about a place."""
    (m, f), (omega, v) = np.split(wrench, 2), np.split(twist, 2)
    if np.linalg.norm(f) < RANK * np.linalg.norm(wrench):
        return share_of(m, omega)
    pitch = (f @ m) / (f @ f)
    return share_of(f, v + cross_product(omega, place) + pitch * omega)


def share_of(one: np.ndarray, other: np.ndarray) -> float:
    """Return the cosine between two vectors, without sign; 0 where one of them is none."""
    sizes = np.linalg.norm(one) * np.linalg.norm(other)
    return float(min(abs(one @ other) / sizes, 1.0)) if sizes > 0 else 0.0
