"""URDF read as a mechanism, with the two conventions in use for loops (`sidecars`).

The root link is ground. A joint's first frame is its <origin>, its second the child link's own
frame; hinges and slides are at zero where these agree. Links without mass that are fixed to others
and carry nothing are frames: they become tools.

Source: the URDF specification, https://wiki.ros.org/urdf/XML.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from math import inf

import numpy as np

from linkwork.formats import drake, poses, xml
from linkwork.formats.followers import follower
from linkwork.formats.masses import NOISE as RELATIVE
from linkwork.formats.masses import without_noise
from linkwork.formats.names import FreeNames
from linkwork.formats.notes import Notes
from linkwork.formats.programs import note_program
from linkwork.formats.reading import Reading
from linkwork.formats.urdf.actuators import bound_of, read_actuation, reflected_inertia
from linkwork.formats.urdf.model import (
    NO_LIMIT,
    ONE_FREEDOM,
    UrdfJoint,
    UrdfModel,
    origin,
    read_model,
    weight,
)
from linkwork.formats.urdf.shapes import shapes_of
from linkwork.formats.urdf.sidecars import LINK, LOOP_JOINT, read_closures
from linkwork.formats.urdf.unread import of_its_version, tell_unread
from linkwork.formats.xml import Element
from linkwork.mechanism import (
    GROUND,
    Body,
    FixedJoint,
    FreeJoint,
    Friction,
    Joint,
    Lift,
    Limits,
    Mechanism,
    MechanismError,
    PlanarJoint,
    PrismaticJoint,
    RevoluteJoint,
    ScrewJoint,
    Shape,
    SphericalJoint,
    Spring,
    Tool,
    UniversalJoint,
)
from linkwork.mechanism.body import rigid
from linkwork.mechanism.joints import ManyFreedoms
from linkwork.solids.solid import Solid, together

MASSES = {"mass", "inertia", "density"}  # in a link itself, where they are not read
MASSLESS = (
    "holds no <mass>, which is zero then (a <density>, as some programs write it, is not read)"
)
READ_INSIDE = ("joint", "springStiffness", "springReference", LINK)  # <gazebo>, <loop_joint>
WEIGHT = ("turnGravityOff", "gravity")
NO_LINK = "it is told of no link, and weight acts on all bodies"
GAZEBO_MOTION = {
    "turnGravityOff": NO_LINK,
    "gravity": NO_LINK,
    "kinematic": "bodies move by forces alone",
    "dampingFactor": "nothing slows bodies down but joints",
    "link": "links are those of the file itself",
    "model": "models inside are not read",
}
MOTION = ("drake:prismatic_spring", "drake:tendon_constraint", "force_element", LOOP_JOINT)
OFF = ("false", "0", "0.0")
MACRO = "is a macro; expand the file with xacro first"
DEFINITIONS = ("xacro:property", "xacro:macro", "xacro:arg")
JOINTS = ("joint", drake.JOINT)
PITCH = "drake:screw_thread_pitch"  # advance per turn [m]
SILENT = {
    "robot": {
        *("material", "link", "loop", "coupling", "constraint", "transmission"),
        *(*JOINTS, *drake.BETWEEN, drake.BUSHING),
    },
    "link": {"visual", "collision", "material", "inertial", "origin"},
    "joint": {
        "origin",
        "parent",
        "child",
        "axis",
        "limit",
        "dynamics",
        "mimic",
        "calibration",
        "safety_controller",
        PITCH,
    },
}
SILENT[drake.JOINT] = SILENT["joint"]


def read_urdf(root: Element, notes: Notes, reading: Reading) -> Mechanism:
    """Read a document whose root is <robot>, and `robot.yaml` or the file of its own name beside
    it.

    Where the root link is to float it is a body fixed to ground, unless a floating joint carries
    all else.

    Raises:
        MechanismError: one sentence that names file, line, element and what would be right.
    """
    # What the file holds, and what closes its loops.
    root = of_its_version(root, notes)
    tell_unread(root, notes)
    macros = _survey(root, notes)
    if not macros:
        return _mechanism(root, notes, reading)
    try:
        return _mechanism(root, notes, reading)
    except MechanismError as error:
        # What is not there may be what a macro would have made.
        raise macros[0].refusal(f"{MACRO} ({error})") from None


def _mechanism(root: Element, notes: Notes, reading: Reading) -> Mechanism:
    """Read a document whose elements have been looked at."""
    model = read_model(root, notes, reading.floating)
    closures = read_closures(model, notes, reading.merging)
    model.find_frames()
    _say_what_stands(model, notes)
    # Links that are frames on a body are no bodies of their own.
    shapes, solids = shapes_of(model, reading, notes), _solids(model, notes)
    bodies = {
        name: _body(link, solids[name], shapes[name])
        for link, name in (
            (link, model.bodies[name])
            for name, link in model.links.items()
            if name not in model.frames
        )
        if name != GROUND
    }
    base = model.bodies[model.base]
    joints: dict[str, Joint] = (
        {} if base == GROUND else {model.names.give(base): FixedJoint(connects=(GROUND, base))}
    )
    joints |= {
        model.labels[joint.name]: _joint(model, joint, notes)
        for joint in model.joints.values()
        if joint.child not in model.frames or model.closes(joint)
    }
    # What couples joints, and which of them are driven.
    gears = _mimics(model, joints, notes)
    tied, springs = drake.read_between(root, partial(_mounted, model), model.names)
    double = {model.labels[joint.name] for joint in model.joints.values() if model.closes(joint)}
    loops = closures.joints(model) | tied
    used, tool_names = closures.frames(), FreeNames(notes)
    actuation = read_actuation(model, closures.actuators, bool(loops or double), notes)
    try:
        return Mechanism(
            name=root.attributes.get("name") or root.file.stem,
            bodies=bodies,
            joints=joints | gears | loops,
            springs=springs,
            lifts=_lifts(model),
            transmissions=actuation.transmissions,
            actuators=tuple(actuation.names),
            drives=actuation.drives,
            tools={
                tool_names.give(link, model.links[link]): Tool(body=body, frame=poses.frame_of(X))
                for link, (body, X) in model.frames.items()
                if body in bodies and link not in used
            },
        )
    except MechanismError as error:
        raise MechanismError(f"{root.file}: {error}") from None


def _mounted(model: UrdfModel, link: str, asking: Element) -> tuple[str, np.ndarray]:
    """Return the body that a link is, or is fixed to, and the link's pose in it."""
    if link not in model.links:
        raise asking.refusal(f"there is no link {xml.shortened(link)}")
    return model.seat(link)


def _say_what_stands(model: UrdfModel, notes: Notes) -> None:
    """Note that the root link stands still, whatever it weighs, where it is ground."""
    if model.bodies[model.base] != GROUND:
        return
    if model.base == GROUND:
        base = f"the root link {GROUND!r} is ground"
    else:
        base = f"the root link {model.base!r} is taken as ground and stands still"
    notes.say(
        f"{model.root.file.name}: {base}"
        + (", so that its mass plays no part" if weight(model.links[model.base]) else "")
    )


def _survey(root: Element, notes: Notes) -> list[Element]:
    """Note the elements that are not read, and return the macros among them."""
    macros = [element for element in root.children if element.tag.startswith("xacro:")]
    links = {link.attributes.get("name", "") for link in root.each("link")}
    mimics = {each.attributes.get("name", "") for each in root.each("joint") if each.first("mimic")}
    for element in macros:
        # What defines something makes nothing by itself.
        alters = element.tag not in DEFINITIONS
        notes.on(element, f"is left out: it {MACRO}", alters)
    for element in (each for each in root.children if each not in macros):
        if element.tag == "gazebo":
            _survey_gazebo(element, links, mimics, notes)
        if element.tag == drake.BUSHING:
            notes.on(element, drake.SOFT, alters=True)
        if element.tag not in SILENT["robot"] and not any(element.each(*READ_INSIDE)):
            notes.on(
                element,
                "is left out: it is no part of a mechanism known here",
                alters=element.tag in MOTION,
            )
        for child in element.children if element.tag in ("link", *JOINTS) else ():
            if child.tag.startswith("xacro:"):
                notes.on(child, f"in a <{element.tag}> is left out: it {MACRO}", alters=True)
            elif child.tag not in SILENT[element.tag] and not _says_nothing(child):
                notes.on(
                    child,
                    f"in a <{element.tag}> is left out: it is not known here",
                    alters=element.tag in JOINTS or child.tag in MASSES,
                )
    return macros


def _survey_gazebo(element: Element, links: set[str], mimics: set[str], notes: Notes) -> None:
    """Note what <gazebo> says of the motion that is not read; mimics: joints that the file itself
    ties to others."""
    told = element.attributes.get("reference", "") in links
    for child in element.each(*GAZEBO_MOTION):
        if _is_said(child) and not (told and child.tag in WEIGHT):
            notes.on(child, f"in a <gazebo> is left out: {GAZEBO_MOTION[child.tag]}", alters=True)
    for plugin in element.each("plugin"):
        tied = plugin.first("mimicJoint")
        note_program(plugin, notes, done=tied is not None and tied.content in mimics)


def _is_said(child: Element) -> bool:
    """Tell whether an element of <gazebo> takes a link's weight away, or says another thing that is
    not off."""
    return (child.content.lower() in OFF) == (child.tag == "gravity")


def _says_nothing(element: Element) -> bool:
    """Tell whether an element has nothing but attributes at zero, as exporters write them."""
    return (
        bool(element.attributes)
        and not element.children
        and all(set(value) <= set("0. ") for value in element.attributes.values())
    )


# ------------------------------------------------------------------------------------------- bodies


def _solids(model: UrdfModel, notes: Notes) -> dict[str, Solid]:
    """Return the mass of each body: of the link that it is, with those that are frames of it."""
    parts: dict[str, list[Solid]] = {}
    size = model.size
    for name, link in model.links.items():
        body, X = model.seat(name)
        if body != GROUND:
            parts.setdefault(body, []).append(_solid(link, size, notes).seen(X))
    heavy = {
        body: [solid for solid in solids if solid.mass or solid.inertia.any()]
        for body, solids in parts.items()
    }
    return {
        body: solids[0] if len(solids) == 1 else together(solids) for body, solids in heavy.items()
    }


def _solid(link: Element, size: float, notes: Notes) -> Solid:
    """Return the mass of a link in its own axes; `size` is the robot's [m], for what is rounding in
    its inertia."""
    inertial = link.first("inertial")
    if inertial is None:
        return Solid(0.0, np.zeros(3), np.zeros((3, 3)))
    if inertial.first("mass") is None:
        notes.on(inertial, f"of {xml.shortened(link.text('name'))} {MASSLESS}", alters=True)
    mass, tensor = weight(link), np.zeros((3, 3))
    given = inertial.first("inertia")
    if given is not None:
        xx, yy, zz, xy, xz, yz = (
            given.number(name, 0.0) for name in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
        )
        tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        tensor = without_noise(tensor, mass, size**2)
    moments = np.linalg.eigvalsh(tensor)
    if moments[0] < -RELATIVE * moments[2]:
        notes.on(
            link,
            "has a principal moment of inertia below zero; it is kept, as the file says, and "
            "motions in which it prevails gain speed against their forces",
            alters=True,
        )
    elif not rigid(*moments):
        notes.on(
            link,
            (
                "has moments of inertia that no rigid body has, one above the sum of the "
                "others; they are kept"
            ),
        )
    return Solid(mass, np.zeros(3), tensor).seen(origin(inertial))


def _lifts(model: UrdfModel) -> dict[str, Lift]:
    """Return what carries the weights that <gazebo> takes from links."""
    lifts: dict[str, Lift] = {}
    for element in model.root.each("gazebo"):
        name = element.attributes.get("reference", "")
        if name not in model.links or not any(map(_is_said, element.each(*WEIGHT))):
            continue
        (body, X), mass = model.seat(name), weight(model.links[name])
        inertial = model.links[name].first("inertial")
        if body != GROUND and mass and inertial is not None:
            centre = poses.triple((X @ origin(inertial))[:3, 3])
            lifts[model.bodies[name]] = element.make(Lift, body=body, point=centre, mass=mass)
    return lifts


def _body(link: Element, solid: Solid, shapes: tuple[Shape, ...]) -> Body:
    fields = solid.fields()
    if not rigid(*np.linalg.eigvalsh(solid.inertia)):
        fields["inertia"]["moments"] = "any"
    try:
        return Body(**fields, shapes=shapes)
    except MechanismError as error:
        raise link.refusal(str(error)) from None


# ------------------------------------------------------------------------------------------- joints


def _joint(model: UrdfModel, joint: UrdfJoint, notes: Notes) -> Joint:
    """Return a joint of the tree."""
    # Where it stands on the body that carries its parent link.
    element = joint.element
    (parent, X), (child, Y) = model.seat(joint.parent), model.seat(joint.child)
    if parent == child:
        raise element.refusal(f"connects {xml.shortened(child)} to itself, by way of fixed joints")
    connects, first = (parent, child), X @ joint.origin
    frames = poses.frame_of(first), poses.frame_of(Y)
    axis = poses.triple(joint.axis)
    # Those without friction or limits.
    match joint.type:
        case "fixed":
            return FixedJoint(connects=connects, frames=frames)
        case "floating":
            return FreeJoint(connects=connects, frames=frames)
        case "spherical":
            friction = _viscous(joint, SphericalJoint, notes)
            return SphericalJoint(connects=connects, frames=frames, friction=friction)
        case "universal":
            first_axis, second_axis = (
                poses.triple(np.eye(3)["xyz".index(letter)]) for letter in joint.axes
            )
            friction = _viscous(joint, UniversalJoint, notes)
            return UniversalJoint(
                connects=connects,
                frames=frames,
                axes=(first_axis, second_axis),
                friction=friction,
            )
        case "planar":
            turn = poses.pose(rotation=poses.from_z(joint.axis))
            frames = poses.frame_of(first @ turn), poses.frame_of(Y @ turn)
            friction = _viscous(joint, PlanarJoint, notes)
            return PlanarJoint(connects=connects, frames=frames, friction=friction)
    # Hinges and slides, with theirs, and a spring of Gazebo's.
    dynamics = element.first("dynamics")
    friction = Friction()
    if dynamics is not None:
        viscous, coulomb = dynamics.number("damping", 0.0), dynamics.number("friction", 0.0)
        friction = dynamics.make(Friction, viscous=viscous, coulomb=coulomb)
        if coulomb:
            notes.on(
                element, "has dry friction, which is smoothed here about rate zero", alters=True
            )
    fields = {
        "connects": connects,
        "frames": frames,
        "axis": axis,
        "friction": friction,
        "spring": _spring(model, joint),
        "limits": _limits(joint),
        "rotor_inertia": reflected_inertia(model, joint),
    }
    if joint.type == "screw":
        pitch = element.named(PITCH).number("value") / (2 * np.pi)
        return element.make(ScrewJoint, pitch=pitch, **fields)
    return element.make(PrismaticJoint if joint.type == "prismatic" else RevoluteJoint, **fields)


def _viscous(joint: UrdfJoint, made: type[ManyFreedoms], notes: Notes) -> dict[str, Friction]:
    """Return the damping of a joint of several freedoms, one number or one of each: Drake's, and
    that of joints whose type is the file's own."""
    element, dynamics = joint.element, joint.element.first("dynamics")
    retyped = joint.type != element.attributes.get("type")
    if dynamics is None or (element.tag != drake.JOINT and retyped):
        return {}
    if dynamics.number("friction", 0.0):
        remark = "has dry friction, which is left out: it has several freedoms"
        notes.on(element, remark, alters=True)
    count = len(made.freedoms)
    given = dynamics.numbers("damping", (1, count), (0.0,))
    each = np.broadcast_to(given, count).tolist()
    return {
        freedom: dynamics.make(Friction, viscous=value)
        for freedom, value in zip(made.freedoms, each, strict=True)
        if value
    }


def _spring(model: UrdfModel, joint: UrdfJoint) -> Spring:
    """Return the spring that <gazebo reference="joint"> gives a joint."""
    found = Spring()
    for element in model.root.each("gazebo"):
        if element.attributes.get("reference") == joint.name:
            found = element.make(
                Spring,
                stiffness=element.inner_number("springStiffness", found.stiffness),
                rest=element.inner_number("springReference", found.rest),
            )
    return found


def _limits(joint: UrdfJoint) -> Limits:
    limit, speed = joint.element.first("limit"), bound_of(joint, "velocity")
    if limit is None or joint.type == "continuous":
        return Limits(speed=speed)
    lower, upper = (limit.number(name, 0.0, most=inf) for name in ("lower", "upper"))
    ends = {"lower": lower, "upper": upper} if lower < upper else {}
    known = {end: value for end, value in ends.items() if abs(value) < NO_LIMIT}
    return Limits(**known, speed=speed)


def _mimics(model: UrdfModel, joints: Mapping[str, Joint], notes: Notes) -> dict[str, Joint]:
    """Return a gear for every <mimic>: q - multiplier q_other = offset."""
    gears: dict[str, Joint] = {}
    # Both are hinges or slides; one that is fixed, or not there, follows or leads nothing.
    for joint in model.joints.values():
        mimic = joint.element.first("mimic")
        if mimic is None:
            continue
        other = mimic.text("joint")
        if other == joint.name:
            raise mimic.refusal(f"{xml.shortened(other)} mimics itself; name another joint")
        kinds = {
            name: model.joints[name].type if name in model.joints else ""
            for name in (joint.name, other)
        }
        strange = next(
            (name for name, kind in kinds.items() if kind not in (*ONE_FREEDOM, "fixed")), None
        )
        if strange is not None:
            notes.on(
                joint.element,
                f"mimics or is no hinge or slide: there is none {xml.shortened(strange)}; it "
                "moves freely here",
                alters=True,
            )
        elif kinds[joint.name] == "fixed":
            notes.on(joint.element, "is fixed, so that it mimics no other")
        elif kinds[other] == "fixed":
            notes.on(
                joint.element, "mimics a joint that is fixed; it moves freely here", alters=True
            )
        else:
            # The gear between those that are both there.
            labels = model.labels[joint.name], model.labels[other]
            numbers = mimic.number("multiplier", 1.0), mimic.number("offset", 0.0)
            tied = follower(mimic, joints, labels, *numbers)
            gears[model.names.give(f"{joint.name}_mimic")] = tied
    return gears
