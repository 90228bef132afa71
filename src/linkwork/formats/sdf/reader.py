"""SDF read as a mechanism: links are bodies, joints connect any two of them, and links that no
chain of joints holds to the world float.

Models keep their links' names; several models, and nested ones, put their own names before them
(`arm::link`). Static models are ground. Named frames are tools. The weight of links without
gravity is carried.

Source: the SDF specification, http://sdformat.org/spec.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from linkwork.formats import drake, poses
from linkwork.formats.floating import FLOATING
from linkwork.formats.masses import without_noise
from linkwork.formats.names import FreeNames
from linkwork.formats.notes import Notes
from linkwork.formats.programs import note_program
from linkwork.formats.reading import EARTH, Reading
from linkwork.formats.sdf.includes import ScopeReader
from linkwork.formats.sdf.joints import JointReader
from linkwork.formats.sdf.links import shapes_of_link, solid_of_link, survey_link
from linkwork.formats.sdf.scopes import Scope
from linkwork.formats.sdf.unread import tell_unread
from linkwork.formats.xml import Element
from linkwork.mechanism import (
    GROUND,
    Body,
    Frame,
    FreeJoint,
    Joint,
    Lift,
    Mechanism,
    MechanismError,
    PairJoint,
    PointSpring,
    Tool,
)
from linkwork.mechanism.body import rigid
from linkwork.mechanism.consistency import neighbours, reached
from linkwork.solids.solid import Solid

WORLDLY = (0.0, 0.0, -9.8)  # gravity of a world that says nothing
SILENT = (
    *("model", "include", "link", "joint", "frame", "pose", "static", "gravity", "world", "actor"),
    *("self_collide", "allow_auto_disable", "enable_wind", "gui", "scene", "light", "state"),
    *("physics", "road", "audio", "population", "spherical_coordinates", "magnetic_field"),
    *("wind", "atmosphere"),  # which act by programs alone
    *(*drake.BETWEEN, drake.JOINT, drake.BUSHING),
)


def read_sdf(root: Element, notes: Notes, reading: Reading) -> Mechanism:
    """Read a document whose root is <sdf>, with the models that it includes.

    Raises:
        MechanismError: one sentence that names file, line, element and what would be right.
    """
    if not any(root.each("world", "model", "include")):
        raise root.refusal("holds no <model> and no <world>")
    files = ScopeReader(reading, notes)
    try:
        return _mechanism(root, files.top(root), notes, reading)
    except MechanismError:
        # What is missing may be what an include that is not there would have brought.
        if files.absent:
            raise files.absent[0] from None
        raise


def _mechanism(root: Element, top: Scope, notes: Notes, reading: Reading) -> Mechanism:
    """Read a document with its models as scopes."""
    scopes = list(top.all())
    _survey(scopes, notes)
    # Links that move are bodies.
    body_names, bodies, keys, lifts = FreeNames(notes, (GROUND,)), {}, {}, {}
    for scope in scopes:
        for name, link in () if scope.static else scope.links():
            survey_link(link, notes)
            keys[scope.path + name] = called = body_names.give(scope.path + name, link)
            bodies[called] = body = _body(scope, link, reading, notes)
            if not link.inner_flag("gravity", True) and body.mass:
                lifts[called] = Lift(body=called, point=body.centre_of_mass, mass=body.mass)
    # Joints between them, gears between joints, and free joints where nothing holds.
    reader = JointReader(keys, notes, FreeNames(notes), body_names)
    for scope in scopes:
        reader.scope(scope)
    reader.couplings()
    tied, springs = _tied(scopes, keys, reader.names)
    joints: dict[str, Joint] = {**_free(scopes, keys, reader), **reader.joints, **tied}
    bodies |= reader.between
    loops = sum(isinstance(joint, PairJoint) for joint in joints.values()) > len(bodies)
    actuators, tools = _driven(reader, loops, root, notes), _tools(scopes, keys, notes)
    gravity = _gravity(top)
    try:
        return Mechanism(
            name=_name(root, top),
            gravity=gravity,
            bodies=bodies,
            joints=joints,
            springs=springs,
            lifts=lifts,
            actuators=actuators,
            drives=_drives(reader, actuators, root, notes),
            tools=tools,
        )
    except MechanismError as error:
        raise MechanismError(f"{root.file}: {error}") from None


def _survey(scopes: Iterable[Scope], notes: Notes) -> None:
    """Note the parts of worlds and models that are not read."""
    for scope in scopes:
        for part in scope.element.each("link", "joint"):
            tell_unread(part, notes)
        for child in scope.element.children:
            if child.tag == "plugin":
                note_program(child, notes)
            elif child.tag == drake.BUSHING:
                notes.on(child, drake.SOFT, alters=True)
            elif child.tag not in SILENT:
                notes.on(child, "is left out: it is not known here", alters=True)
        if scope.static:
            notes.on(scope.element, "stands still: it is static")


def _name(root: Element, top: Scope) -> str:
    models = list(top.models)
    return models[0] if len(models) == 1 else top.element.attributes.get("name", root.file.stem)


def _gravity(top: Scope) -> tuple[float, float, float]:
    """Return the gravity of a world, or the usual one where the file holds models alone."""
    given = top.element.inner("gravity")
    if given is not None:
        return given.vector("gravity")
    return WORLDLY if "name" in top.element.attributes else EARTH


def _body(scope: Scope, link: Element, reading: Reading, notes: Notes) -> Body:
    solid = solid_of_link(scope, link, reading, notes)
    reach = float(solid.centre @ solid.centre)
    tensor = without_noise(solid.inertia, solid.mass, reach)
    fields = Solid(solid.mass, solid.centre, tensor).fields()
    if not rigid(*np.linalg.eigvalsh(tensor)):
        fields["inertia"]["moments"] = "any"
        notes.on(link, "has moments of inertia that no rigid body has; they are kept")
    shapes = tuple(shapes_of_link(scope, link, reading, notes))
    return link.make(Body, **fields, shapes=shapes)


def _free(scopes: list[Scope], keys: dict[str, str], reader: JointReader) -> dict[str, Joint]:
    """Return a free joint for the first link of each group that no chain of joints holds to
    ground; the link of a model's own frame comes first."""
    joined = neighbours(
        joint.connects for joint in reader.joints.values() if isinstance(joint, PairJoint)
    )
    held = reached(GROUND, joined)
    moving = [
        (scope, name)
        for scope in scopes
        if not scope.static and not scope.world and scope.moves()
        for name in dict.fromkeys((scope.canonical(), *(name for name, _ in scope.links())))
    ]
    free: dict[str, Joint] = {}
    for scope, name in moving:
        key, X = scope.mount(name, scope.element)
        body = keys.get(key, GROUND)
        if body not in held:
            free[body] = FreeJoint(connects=(GROUND, body), frames=(poses.frame_of(X), Frame()))
            held |= reached(body, joined)
    return {
        reader.names.give(FLOATING if len(free) == 1 else f"{body}_{FLOATING}"): joint
        for body, joint in free.items()
    }


def _tied(
    scopes: list[Scope], keys: dict[str, str], names: FreeNames
) -> tuple[dict[str, Joint], dict[str, PointSpring]]:
    """Return the joints and springs that Drake's elements are."""
    joints: dict[str, Joint] = {}
    springs: dict[str, PointSpring] = {}
    for scope in scopes:

        def mount(name: str, asking: Element, scope: Scope = scope) -> tuple[str, np.ndarray]:
            key, B = scope.mount(name, asking)
            return keys.get(key, GROUND), poses.inverse(B) @ scope.in_world(name, asking)

        own, between = drake.read_between(scope.element, mount, names)
        joints, springs = joints | own, springs | between
    return joints, springs


def _driven(reader: JointReader, loops: bool, root: Element, notes: Notes) -> tuple[str, ...]:
    """Return the coordinates that are driven: those whose effort is not limited to zero, if any is;
    else all hinges and slides of a tree, and none where there are loops."""
    axes = [
        (joint.labels[tag], driven)
        for joint in reader.read
        for tag, driven in joint.driven.items()
        if tag in joint.labels
    ]
    where = root.file.name
    if any(driven is False for _, driven in axes):
        return tuple(label for label, driven in axes if driven is not False)
    if loops:
        notes.say(f"{where}: nothing says which joints are driven; name the actuators")
        return ()
    if axes:
        notes.say(f"{where}: nothing says which joints are driven; all hinges and slides are")
    return tuple(label for label, _ in axes)


def _drives(
    reader: JointReader, actuators: tuple[str, ...], root: Element, notes: Notes
) -> dict[str, dict[str, float | str]]:
    """Return the limits of effort as drives that bound the forces."""
    drives = {
        joint.labels[tag]: {"type": "saturated", "limit": effort}
        for joint in reader.read
        for tag, effort in joint.efforts.items()
        if joint.labels.get(tag) in actuators
    }
    if drives:
        notes.say(
            f"{root.file.name}: limits of effort are the mechanism's drives; they act in runs that "
            "are given them (drives=robot.drives)"
        )
    return drives


def _tools(scopes: list[Scope], keys: dict[str, str], notes: Notes) -> dict[str, Tool]:
    """Return the named frames that are on bodies."""
    tools, names = {}, FreeNames(notes)
    for scope in scopes:
        for name, frame in scope.named.items():
            if frame.tag != "frame":
                continue
            body, B = scope.mount(name, frame)
            if body in keys:
                X = poses.inverse(B) @ scope.in_world(name, frame)
                place = Tool(body=keys[body], frame=poses.frame_of(X))
                tools[names.give(scope.path + name, frame)] = place
    return tools
