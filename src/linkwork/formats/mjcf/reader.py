"""MJCF, the model format of MuJoCo, read as a mechanism.

The bodies' tree becomes bodies and joints, equality constraints and tendons become the joints that
they are (`mjcf.loops`, `mjcf.tendons`), actuators name rates or transmissions and become drives
(`mjcf.actuators`), sites become tools. The reference is the keyframe "home", or qpos0.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from linkwork.equations.joints import motions_of
from linkwork.errors import LinkworkError
from linkwork.formats import poses
from linkwork.formats.masses import solid_of
from linkwork.formats.mjcf import flattening
from linkwork.formats.mjcf.actuators import Actuation, ActuatorReader, ball_drives, driven_sites
from linkwork.formats.mjcf.alignment import aligned
from linkwork.formats.mjcf.document import Document
from linkwork.formats.mjcf.fluid import drags_of, fluid_of
from linkwork.formats.mjcf.joints import Coupling, Joints, read_joints
from linkwork.formats.mjcf.loops import Equality, LoopReader, Ties
from linkwork.formats.mjcf.reflected import reflected, with_reflected
from linkwork.formats.mjcf.replicas import every
from linkwork.formats.mjcf.spring_dampers import with_spring_dampers
from linkwork.formats.mjcf.survey import MAKERS, SOFT, UNMADE, require_names, survey
from linkwork.formats.mjcf.tendons import TendonReader, Tendons
from linkwork.formats.mjcf.tree import COORDINATES, NEAR, TURNING, ModelTree, read_tree
from linkwork.formats.names import FreeNames
from linkwork.formats.notes import Notes
from linkwork.formats.reading import EARTH, Reading
from linkwork.formats.xml import Element
from linkwork.mechanism import (
    GROUND,
    Body,
    GearJoint,
    Joint,
    Lift,
    Mechanism,
    MechanismError,
    PairJoint,
    Tool,
)
from linkwork.mechanism.transmissions import Transmission
from linkwork.solids.solid import together

HOME = "home"
FROM_REST = "has a spring, so that its turn is counted from qpos0, where that rests"
QUATERNION = (".qw", ".qx", ".qy", ".qz")


def read_mjcf(root: Element, notes: Notes, reading: Reading) -> Mechanism:
    """Read a document whose root is <mujoco>; what is left out or taken otherwise goes to the
    notes.

    Raises:
        MechanismError: one sentence that names file, line, element and what would be right.
    """
    document, unmade = Document.read(root, reading.includes), UNMADE
    makers = flattening.made(document)
    try:
        document = flattening.flattened(document, makers, notes) if makers else document
    except LinkworkError as error:
        unmade = f"{UNMADE}; {error}"
        for mesh in (maker for maker in makers if maker.tag == "mesh"):
            notes.on(mesh, f"is made by MuJoCo alone: {error}")
    survey(document, notes, unmade)
    try:
        return _mechanism(document, notes, reading)
    except MechanismError as error:
        # What is not there may be what an element that is not read would have made.
        world = [part for section in document.root.each("worldbody") for part in every(section)]
        maker = next((part for part in world if part.tag in MAKERS), None)
        if maker is None:
            raise
        reason = SOFT if maker.tag == flattening.FLEXIBLE else unmade
        raise maker.refusal(f"{reason} ({error})") from None


def _mechanism(document: Document, notes: Notes, reading: Reading) -> Mechanism:
    # The tree of bodies.
    root = document.root
    tree = aligned(document, read_tree(document, notes))
    require_names(document)
    added = reflected(document, tree, notes)
    tree = with_reflected(with_spring_dampers(document, tree, added, notes), added.joints)
    standing = _put_by_key(document, tree)
    loops = LoopReader(document, tree, standing, notes)
    ties = loops.ties()
    # Joints of the tree, and the bodies between several joints of one body.
    names, body_names = FreeNames(notes), FreeNames(notes, (GROUND, *tree.nodes))
    joints = read_joints(
        standing, _free_couplings(document, ties), ball_drives(document), names, body_names
    )
    for node, piece in standing.pieces():
        sprung = piece.kind == "free" and any(piece.spring.pulls)
        if sprung and np.abs(node.pose[:3, :3] - np.eye(3)).max() > NEAR:
            notes.on(piece.element, FROM_REST)
    bodies = {
        name: node.element.make(Body, **node.solid.fields(), shapes=node.shapes)
        for name, node in tree.nodes.items()
    } | joints.bodies
    lifts = _lifts(tree) if document.passive else {}
    fluid = fluid_of(document)
    acts = document.passive and (fluid.density or fluid.viscosity)
    drags = drags_of(document, tree, notes) if acts else {}
    dragged = {drag.body for drag in drags.values()}
    # What closes loops: tendons, connects and welds, joint equalities.
    tendon_reader = TendonReader(document, loops, joints, names, notes, added.tendons)
    tendons = tendon_reader.read(ties.tendons)
    _join_parts(tree, ties, joints, bodies, tendons.used, {*lifts, *dragged})
    closing = loops.closing(ties, names)
    gears = loops.gears(ties, joints, names)
    # All of it, named once; sites that nothing uses are tools.
    held = closing | tendons.joints | gears
    everything: dict[str, Joint] = joints.joints | held  # pyright: ignore
    given = tendons.lines, tendons.elements
    actuation = ActuatorReader(document, tree, joints, *given, names, notes).read()
    tied, transmissions = _tied(tendons, actuation)
    used = ties.sites | tendons.used | driven_sites(document)
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
        "joints": everything | tied,
        "springs": tendons.springs,
        "lifts": lifts,
        "fluid": fluid,
        "drags": drags,
        "transmissions": transmissions,
        "actuators": tuple(actuation.names),
        "drives": actuation.drives,
        "tools": {
            tool_names.give(name): Tool(body=body, frame=poses.frame_of(X))
            for name, (body, X) in tools.items()
        },
        "reference": _reference(document, standing, joints, closing),
    }
    try:
        return Mechanism(**fields)
    except MechanismError as error:
        raise MechanismError(f"{root.file}: {error}") from None


def _tied(
    tendons: Tendons, actuation: Actuation
) -> tuple[dict[str, GearJoint], dict[str, Transmission]]:
    """Return the gears of tendons by the names of transmissions, and all transmissions with those
    that nothing but a gear holds."""
    names, gears = actuation.lines, tendons.ties
    named = {
        label: gear.model_copy(
            update={
                "ratios": {names[line]: ratio for line, ratio in gear.ratios.items()},
                "powers": {names[line]: powers for line, powers in gear.powers.items()},
            }
        )
        for label, gear in gears.items()
    }
    lines = (line for gear in gears.values() for line in gear.ratios)
    held = {names[line]: tendons.lines[line] for line in lines}
    return named, held | actuation.transmissions


def _gravity(document: Document) -> tuple[float, float, float]:
    gravity = EARTH
    for option in document.root.each("option"):
        gravity = option.vector("gravity", gravity)
    return (0.0, 0.0, 0.0) if "gravity" in document.off else gravity


def _lifts(tree: ModelTree) -> dict[str, Lift]:
    """Return the weights that are carried (gravcomp), by body."""
    found = {}
    for name, node in tree.nodes.items():
        part = node.element.number("gravcomp", 0.0)
        if part and node.solid.mass:
            centre, mass = poses.triple(node.solid.centre), part * float(node.solid.mass)
            found[name] = node.element.make(Lift, body=name, point=centre, mass=mass)
    return found


def _free_couplings(document: Document, ties: Ties) -> dict[str, Coupling]:
    """Return the linear joint equalities by the joint that they move, where nothing else drives or
    couples that joint."""
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
    linear = (item for item in ties.couplings if item.other and not item.powers)
    return {item.joint: item for item in linear if used[item.joint] == 1}


# -------------------------------------------------------------------------------------------- parts


def _join_parts(
    tree: ModelTree,
    ties: Ties,
    joints: Joints,
    bodies: dict[str, Body],
    tendon_sites: set[str],
    loaded: set[str],
) -> None:
    """Make one body of the parts that an export made of it.

    A joint that closes a loop and is no hinge or ball leads to a part of its body, named
    "body.joint" and welded to the body. Where a leaf of the tree is such a part, the joint leads to
    the body itself, which has the mass of both.

    loaded: bodies on which something acts that is told of the body
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
            or part in loaded
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


# ---------------------------------------------------------------------------------------- reference


def _home(document: Document) -> Element | None:
    """Return the keyframe "home", or None."""
    keys = document.each("keyframe", "key")
    return next((key for key in keys if key.attributes.get("name") == HOME), None)


def _put_by_key(document: Document, tree: ModelTree) -> ModelTree:
    """Return the tree with its mocap bodies where the keyframe "home" puts them."""
    home = _home(document)
    nodes = [node for node in tree.nodes.values() if node.element.attributes.get("mocap") == "true"]
    if home is None or not nodes:
        return tree
    # What the keyframe does not say, or not to the end, stays as the bodies say.
    places = np.array([node.pose[:3, 3] for node in nodes])
    turns = np.array([poses.to_quaternion(node.pose[:3, :3]) for node in nodes])
    for name, values in (("mpos", places), ("mquat", turns)):
        given = home.numbers(name, tuple(range(values.size + 1)), ())
        whole = len(given) - len(given) % values.shape[1]
        values.flat[:whole] = given[:whole]
    moved = dict(tree.nodes)
    for node, p, q in zip(nodes, places, turns, strict=True):
        X = poses.pose(p, poses.from_quaternion(*q)) if q.any() else poses.pose(p)
        if np.abs(X - node.pose).max() > NEAR:
            moved[node.name] = replace(node, pose=X)
    return replace(tree, nodes=moved)


def _turn_from(joint: PairJoint, values: np.ndarray) -> np.ndarray:
    """Return a free joint's coordinates (7) with the turn counted to its frame in the body."""
    R = poses.of_frame(joint.frames[1])[:3, :3]
    if np.array_equal(R, np.eye(3)):
        return values
    turn = poses.from_quaternion(*values[3:]) @ R
    return np.concatenate([values[:3], poses.to_quaternion(turn)])


def _reference(
    document: Document, tree: ModelTree, joints: Joints, closing: dict[str, PairJoint]
) -> dict[str, float]:
    """Return the joint coordinates of the keyframe "home", or those of qpos0; what is at zero is
    left out."""
    # qpos of the keyframe "home" where there is one, else where the joints stand.
    pieces = tree.pieces()
    positions = tree.positions()
    home = _home(document)
    if home is not None and "qpos" in home.attributes:
        counts = [COORDINATES[piece.kind] for _, piece in pieces]
        values = np.concatenate([np.zeros(0), *positions.values()])
        said = home.attributes["qpos"].split()
        # The last of qpos may be left out.
        given = home.numbers("qpos", (min(len(said), len(values)),), ())
        values[: len(given)] = given
        positions = dict(enumerate(np.split(values, np.cumsum(counts)[:-1])))
        # A quaternion without length is no turn, as MuJoCo takes it.
        for index, (_, piece) in enumerate(pieces):
            if piece.kind in TURNING and not positions[index][-4:].any():
                positions[index][-4] = 1.0
    # Joints of the tree read their own numbers; quaternions in the axes of their group.
    found: dict[str, float] = {}
    for index, slot in enumerate(joints.slots):
        values = positions[index]
        if len(slot) == 4:
            group = joints.groups[slot[0].partition(".")[0]]
            values = np.concatenate(
                [values[:1], group.axes.T @ values[1:] * (-1 if group.backwards else 1)]
            )
        elif len(slot) == 7:
            values = _turn_from(joints.joints[slot[0].partition(".")[0]], values)
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
    # The parts of a quaternion stay together: of a tiny turn qw is 1 to rounding.
    neutral = {label: 1.0 if label.endswith(".qw") else 0.0 for label in found}
    away = {label for label, value in found.items() if abs(value - neutral[label]) > poses.TINY}
    turned = {label.rpartition(".")[0] for label in away if label.endswith(QUATERNION)}
    return {
        label: value
        for label, value in found.items()
        if label in away or (label.endswith(QUATERNION) and label.rpartition(".")[0] in turned)
    }
