"""The oracle of all joint types against MuJoCo, on trees of all types but screws, with the effects
MuJoCo has too."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from numpy.typing import ArrayLike

from linkwork.mechanism import (
    CylindricalJoint,
    Frame,
    FreeJoint,
    Mechanism,
    PairJoint,
    PlanarJoint,
    PrismaticJoint,
    RevoluteJoint,
    SphericalJoint,
    UniversalJoint,
)

from tests.oracle import pairs
from tests.oracle.maximal import MaximalOracle, Poses
from tests.oracle.random_joints import (
    TREE,
    random_coordinates,
    random_effects,
    random_joint,
    random_pose,
)
from tests.oracle.random_mechanisms import random_body
from tests.oracle.test_pairs import close

x, y, z = np.eye(3)
GRAVITY = (1.0, -2.0, -9.0)


@pytest.mark.parametrize("seed", range(6))
def test_agrees_on_trees(seed):
    rng = np.random.default_rng(seed)
    mechanism = tree(rng)
    model = mujoco.MjModel.from_xml_string(document(mechanism))  # pyright: ignore
    data = mujoco.MjData(model)  # pyright: ignore
    q = np.concatenate([random_coordinates(rng, joint) for joint in mechanism.pairs.values()])
    w = rng.normal(size=len(mechanism.rates))
    oracle = MaximalOracle(mechanism)
    poses = oracle.poses(dict(zip(mechanism.coordinates, q, strict=True)))
    twists = oracle.twists(poses, dict(zip(mechanism.rates, w, strict=True)))
    turns = axes_of_turns(mechanism, poses)
    data.qpos, data.qvel = q, turns.T @ w
    mujoco.mj_forward(model, data)  # pyright: ignore
    for name in mechanism.bodies:
        close(data.body(name).xpos, poses[name][0], 1e-12)
        close(data.body(name).xmat.reshape(3, 3), poses[name][1], 1e-12)
    found = oracle.joint_accelerations(poses, twists, oracle.accelerations(poses, twists))
    close(found, turns @ data.qacc, 1e-9)
    close(oracle.energy(poses, twists)[::-1], data.energy, 1e-10)


def tree(rng: np.random.Generator) -> Mechanism:
    """Return a tree of all types but screws, with effects; F2 is the second body's own frame, as
    MuJoCo wants it.

    The joints' order is MuJoCo's, depth first.
    """
    kinds = [
        str(kind) for kind in rng.permutation([kind for kind in TREE[False] if kind != "screw"])
    ]
    names = [f"body_{i}" for i in range(len(kinds))]
    parents = [str(rng.choice(["ground", *names[:i]])) for i in range(len(kinds))]
    joints = {}
    for name, parent, kind in zip(names, parents, kinds, strict=True):
        poses = {parent: random_pose(rng, False), name: random_pose(rng, False)}
        joint, _ = random_joint(rng, False, (parent, name), kind, poses)
        frames = (joint.frames[0], Frame())
        joints[name] = joint.model_copy(
            update={"frames": frames, **random_effects(rng, joint, coulomb=False)}
        )

    def below(body: str) -> list[str]:
        return [
            each
            for name in names
            if joints[name].connects[0] == body
            for each in (name, *below(name))
        ]

    bodies = {name: random_body(rng, False) for name in names}
    return Mechanism(
        gravity=GRAVITY,
        bodies=bodies,
        joints={f"to_{name}": joints[name] for name in below("ground")},
    )


def document(mechanism: Mechanism) -> str:
    """Return the mechanism as an MJCF document."""
    hung = {joint.connects[1]: joint for joint in mechanism.pairs.values()}

    def element(name: str) -> str:
        data, frame, joint = mechanism.bodies[name], hung[name].frames[0], hung[name]
        I = data.inertia  # noqa: E741
        moments = numbers((I.xx, I.yy, I.zz, I.xy, I.xz, I.yz))
        joints = "".join(
            f'<joint type="{kind}" axis="{numbers(axis)}" stiffness="{spring.stiffness!r}" '
            f'springref="{spring.rest!r}" '
            f'damping="{friction.viscous + spring.damping!r}" armature="{rotor!r}"/>'
            for (kind, axis), (friction, spring, _, rotor, *_) in zip(
                parts(joint), joint.effects().values(), strict=True
            )  # pyright: ignore
        )
        return (
            f'<body name="{name}" pos="{numbers(frame.position)}" '
            f'quat="{numbers(pairs.quaternion(pairs.exponential(frame.rotation)))}">{joints}'
            f'<inertial mass="{data.mass!r}" pos="{numbers(data.centre_of_mass)}" '
            f'fullinertia="{moments}"/>'
            f"{below(name)}</body>"
        )

    def below(body: str) -> str:
        return "".join(
            element(joint.connects[1])
            for joint in mechanism.pairs.values()
            if joint.connects[0] == body
        )

    return (
        f'<mujoco><compiler angle="radian"/><option gravity="{numbers(mechanism.gravity)}"><flag '
        'energy="enable"/>'
        f"</option><worldbody>{below('ground')}</worldbody></mujoco>"
    )


def parts(joint: PairJoint) -> list[tuple[str, ArrayLike]]:
    """Return the joint as MuJoCo's joints, one per freedom."""
    match joint:
        case RevoluteJoint(axis=e):
            return [("hinge", e)]
        case PrismaticJoint(axis=e):
            return [("slide", e)]
        case CylindricalJoint(axis=e):
            return [("hinge", e), ("slide", e)]
        case UniversalJoint(axes=(a, b)):
            return [("hinge", a), ("hinge", b)]
        case SphericalJoint():
            return [("ball", z)]
        case PlanarJoint():
            return [("slide", x), ("slide", y), ("hinge", z)]
        case FreeJoint():
            return [("slide", x), ("slide", y), ("slide", z), ("ball", z)]
    return []


def axes_of_turns(mechanism: Mechanism, poses: Poses) -> np.ndarray:
    """Return the matrix from MuJoCo's rates to the mechanism's: a ball's are in the second frame's
    axes there."""
    places = {"ground": (np.zeros(3), np.eye(3)), **poses}
    blocks = np.eye(len(mechanism.rates))
    for name, joint in mechanism.pairs.items():
        if "turn" in joint.freedoms:
            R_1, R_2 = (
                places[body][1] @ pairs.exponential(frame.rotation)
                for body, frame in zip(joint.connects, joint.frames, strict=True)
            )
            k = mechanism.rates.index(f"{name}.wx")
            blocks[k : k + 3, k : k + 3] = R_1.T @ R_2
    return blocks


def numbers(values) -> str:
    return " ".join(repr(float(value)) for value in values)
