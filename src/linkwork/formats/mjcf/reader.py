"""MJCF, the model format of MuJoCo, read as a mechanism.

The bodies' tree becomes bodies and joints, equality constraints and tendons become the joints that
they are (`mjcf_loops`), actuators name rates, sites become tools. The reference is the keyframe
"home", or qpos0.
"""

from __future__ import annotations

from collections import Counter

import numpy as np
from scipy.spatial.transform import Rotation

from linkwork.equations.joints import motions_of
from linkwork.formats import poses
from linkwork.formats.masses import solid_of
from linkwork.formats.mjcf.document import ACTUATORS, Document
from linkwork.formats.mjcf.joints import Coupling, DrivenBall, Joints, read_joints
from linkwork.formats.mjcf.loops import Equality, LoopReader, Ties
from linkwork.formats.mjcf.survey import survey
from linkwork.formats.mjcf.tree import COORDINATES, ModelTree, read_tree
from linkwork.formats.names import FreeNames
from linkwork.formats.notes import Notes
from linkwork.formats.reading import Reading
from linkwork.formats.xml import Element
from linkwork.mechanism import (
    GROUND,
    Body,
    Joint,
    Mechanism,
    MechanismError,
    PairJoint,
    Tool,
)
from linkwork.solids.solid import together

EARTH = (0.0, 0.0, -9.81)
NEAR = 1e-9  # axes that agree [1]
PLAIN = ("motor", "general")  # actuators that are forces and nothing else, as they may be
ANGULAR_VELOCITY = {"wx": 0, "wy": 1, "wz": 2}
HOME = "home"


def read_mjcf(root: Element, notes: Notes, reading: Reading) -> Mechanism:
    """Read a document whose root is <mujoco>; what is left out or taken otherwise goes to the
    notes.

    Raises:
        MechanismError: one sentence that names file, line, element and what would be right.
    """
    # The document and its tree of bodies.
    document = Document.read(root)
    survey(document, notes)
    tree = read_tree(document, notes)
    loops = LoopReader(document, tree, notes)
    ties = loops.ties()
    # Joints of the tree, and the bodies between several joints of one body.
    names, body_names = FreeNames(notes), FreeNames(notes, (GROUND, *tree.nodes))
    joints = read_joints(
        tree, _free_couplings(document, ties), _ball_drives(document), names, body_names
    )
    bodies = {
        name: node.element.make(Body, **node.solid.fields(), shapes=node.shapes)
        for name, node in tree.nodes.items()
    } | joints.bodies
    # What closes loops: tendons, connects and welds, joint equalities.
    tendons, springs, tendon_sites = loops.tendons(ties, joints, names)
    _join_parts(tree, ties, joints, bodies, tendon_sites)
    closing = loops.closing(ties, names)
    gears = loops.gears(ties, joints, names)
    # All of it, named once; sites that nothing uses are tools.
    everything: dict[str, Joint] = joints.joints | closing | tendons | gears  # pyright: ignore
    used = ties.sites | tendon_sites | _driven_sites(document)
    tools = {
        name: (body, X)
        for name, (body, X) in tree.sites.items()
        if body in bodies and name not in used
    }
    tool_names = FreeNames(notes)
    fields = {
        "name": root.attributes.get("model", root.file.stem),
        "gravity": _gravity(document),
        "bodies": bodies,
        "joints": everything,
        "springs": springs,
        "actuators": _actuators(document, joints, notes),
        "tools": {
            tool_names.give(name): Tool(body=body, frame=poses.frame_of(X))
            for name, (body, X) in tools.items()
        },
        "reference": _reference(document, tree, joints, closing),
    }
    try:
        return Mechanism(**fields)
    except MechanismError as error:
        raise MechanismError(f"{root.file}: {error}") from None


def _gravity(document: Document) -> tuple[float, float, float]:
    gravity = EARTH
    for option in document.root.each("option"):
        gravity = option.vector("gravity", gravity)
        if any(flag.attributes.get("gravity") == "disable" for flag in option.each("flag")):
            return 0.0, 0.0, 0.0
    return gravity


def _free_couplings(document: Document, ties: Ties) -> dict[str, Coupling]:
    """Return the joint equalities by the joint that they move, where nothing else drives or couples
    that joint."""
    used = Counter(name for coupling in ties.couplings for name in (coupling.joint, coupling.other))
    used.update(
        element.attributes.get("joint") or element.attributes.get("jointinparent", "")
        for element in document.each("actuator")
    )
    used.update(
        part.attributes.get("joint", "")
        for tendon in document.each("tendon")
        for part in tendon.children
    )
    return {item.joint: item for item in ties.couplings if item.other and used[item.joint] == 1}


# -------------------------------------------------------------------------------------------- parts


def _join_parts(
    tree: ModelTree, ties: Ties, joints: Joints, bodies: dict[str, Body], tendon_sites: set[str]
) -> None:
    """Make one body of the parts that an export made of it.

    A joint that closes a loop and is no hinge or ball leads to a part of its body, named
    "body.joint" and welded to the body. Where a leaf of the tree is such a part, the joint leads to
    the body itself, which has the mass of both.
    """
    # Which bodies something hangs on, holds, or stands on.
    parents = {node.parent for node in tree.nodes.values()}
    uses = Counter(body for tie in (*ties.points, *ties.welds) for body in tie.bodies)
    standing = {body for name, (body, _) in tree.sites.items() if name not in ties.sites}
    for weld in list(ties.welds):
        # A leaf that only this weld and its joint know.
        part = next((body for body in weld.bodies if _is_part(tree, weld, body)), None)
        if (
            part is None
            or part in parents
            or part in standing
            or uses[part] > 1
            or part not in joints.last
        ):
            continue
        # Its joint leads to the whole body instead, from the same place.
        whole = weld.bodies[0] if weld.bodies[1] == part else weld.bodies[1]
        tie = weld.between((whole, part))
        X = tie.frames[0] @ poses.inverse(tie.frames[1])
        name = joints.last[part]
        joint = joints.joints[name]
        frames = joint.frames[0], poses.frame_of(X @ poses.of_frame(joint.frames[1]))
        joints.joints[name] = joint.model_copy(
            update={"connects": (joint.connects[0], whole), "frames": frames}
        )
        # Mass and shapes of both, in the whole body's frame.
        one, other = bodies[whole], bodies.pop(part)
        solid = together([solid_of(one), solid_of(other).seen(X)])
        bodies[whole] = Body(
            **solid.fields(), shapes=(*one.shapes, *poses.carried(other.shapes, X))
        )
        ties.welds.remove(weld)


def _is_part(tree: ModelTree, weld: Equality, body: str) -> bool:
    whole = weld.bodies[0] if weld.bodies[1] == body else weld.bodies[1]
    names = [tree.nodes[name].raw if name in tree.nodes else None for name in (whole, body)]
    return None not in names and str(names[1]).startswith(f"{names[0]}.")


# ---------------------------------------------------------------------------------------- actuators


def _driven_sites(document: Document) -> set[str]:
    keys = ("site", "refsite", "slidersite", "cranksite")
    return {
        element.attributes[key]
        for element in document.each("actuator")
        for key in keys
        if key in element.attributes
    }


def _actuators(document: Document, joints: Joints, notes: Notes) -> tuple[str, ...]:
    """Return the rates that actuators drive, each once."""
    rates: dict[str, None] = {}
    for raw in document.each("actuator", *ACTUATORS):
        element = document.resolved(raw, "actuator")
        rate = _driven(element, joints, notes)
        if rate is None:
            continue
        if rate in rates:
            notes.on(element, f"drives {rate!r} as another actuator does; it is one actuator here")
            continue
        rates[rate] = None
        if element.tag not in PLAIN or element.attributes.get("biastype", "none") != "none":
            notes.on(
                element,
                "is taken as a plain actuator: its control law is left out, the force is yours",
            )
    return tuple(rates)


def _ball_drives(document: Document) -> dict[str, DrivenBall]:
    """Return how balls are driven, by name of the ball, where actuators are named "ball.wx" and so
    on."""
    wanted: dict[tuple[str, bool], dict[int, np.ndarray]] = {}
    for element in document.each("actuator"):
        index = ANGULAR_VELOCITY.get(element.attributes.get("name", "").rpartition(".")[2])
        gear = np.array(element.numbers("gear", (1, 2, 3, 4, 5, 6), (1.0,)))
        for key, from_body in (("jointinparent", False), ("joint", True)):
            if key in element.attributes and index is not None and len(gear) == 3:
                columns = wanted.setdefault((element.attributes[key], from_body), {})
                columns[index] = -gear if from_body else gear
    drives = {}
    for (name, from_body), columns in wanted.items():
        R = poses.completed(columns)
        if R is not None:
            drives[name] = DrivenBall(R, from_body)
    return drives


def _driven(element: Element, joints: Joints, notes: Notes) -> str | None:
    """Return the rate that an actuator drives, or None with a note."""
    # Actuators of joints only.
    in_parent = "jointinparent" in element.attributes
    name = element.attributes.get("jointinparent") or element.attributes.get("joint")
    if name is None:
        notes.on(element, "is left out: only actuators of joints are read")
        return None
    gear = np.zeros(6)
    numbers = element.numbers("gear", (1, 2, 3, 4, 5, 6), (1.0,))
    gear[: len(numbers)] = numbers
    # Of one freedom: the force is told at the joint.
    if name in joints.coordinates:
        if gear[0] != 1:
            notes.on(
                element,
                (
                    f"has a gear of {gear[0]:g}, which is left out: the force here is the one at "
                    "the joint"
                ),
            )
        return joints.coordinates[name]
    # Balls and free joints: the gear is an axis, which has to be one of the joint's own.
    whole = name in joints.floats
    if not whole and name not in joints.balls:
        raise element.refusal(f"there is no joint {name!r} to drive")
    owner = joints.floats[name] if whole else joints.balls[name]
    group = joints.groups[owner]
    along = gear if whole else group.axes.T @ gear[:3] * (-1 if group.backwards else 1)
    rates = joints.joints[owner].rates(owner)[-len(along) :]
    # Turns here have their rates in the first body's axes, where the actuator's axis has to be,
    # too.
    axis = int(np.argmax(along))
    one = np.linalg.norm(along - np.eye(len(along))[axis]) < NEAR
    if not one or not (in_parent != group.backwards or (whole and axis < 3)):
        notes.on(
            element,
            (
                f"is left out: its axis is none of the axes of {owner!r} (jointinparent and a "
                "gear of length 1 are read)"
            ),
        )
        return None
    return rates[axis]


# ---------------------------------------------------------------------------------------- reference


def _reference(
    document: Document, tree: ModelTree, joints: Joints, closing: dict[str, PairJoint]
) -> dict[str, float]:
    """Return the joint coordinates of the keyframe "home", or those of qpos0; what is at zero is
    left out."""
    # qpos of the keyframe "home" where there is one, else where the joints stand.
    pieces = tree.pieces()
    positions = tree.positions()
    home = next(
        (key for key in document.each("keyframe", "key") if key.attributes.get("name") == HOME),
        None,
    )
    if home is not None and "qpos" in home.attributes:
        counts = [COORDINATES[piece.kind] for _, piece in pieces]
        values = np.array(home.numbers("qpos", (sum(counts),)))
        positions = dict(enumerate(np.split(values, np.cumsum(counts)[:-1])))
    # Joints of the tree read their own numbers; quaternions in the axes of their group.
    found: dict[str, float] = {}
    for index, slot in enumerate(joints.slots):
        values = positions[index]
        if len(slot) == 4:
            group = joints.groups[slot[0].partition(".")[0]]
            values = np.concatenate(
                [values[:1], group.axes.T @ values[1:] * (-1 if group.backwards else 1)]
            )
        found |= dict(zip(slot, map(float, values), strict=False))
    # Joints that close loops are read off the poses of the bodies that they join.
    at_home = tree.poses(positions)
    for name, joint in closing.items():
        near, far = (
            at_home[body] @ poses.of_frame(F)
            for body, F in zip(joint.connects, joint.frames, strict=True)
        )
        turn = Rotation.from_matrix(near[:3, :3].T @ far[:3, :3])
        for motion in motions_of(joint):
            quaternion = turn.as_quat(canonical=True, scalar_first=True)
            values = quaternion if motion.ball else [turn.as_rotvec() @ motion.turn]
            found |= dict(zip(joint.coordinates(name), map(float, values), strict=True))
    neutral = {label: 1.0 if label.endswith(".qw") else 0.0 for label in found}
    return {
        label: value for label, value in found.items() if abs(value - neutral[label]) > poses.TINY
    }
