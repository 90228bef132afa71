"""Random descriptions of mechanisms: all joint types, effects and fields, and names that YAML might
misread."""

import numpy as np
from hypothesis import strategies as st

from linkwork.mechanism import (
    GROUND,
    Body,
    Box,
    Capsule,
    Cylinder,
    CylindricalJoint,
    FixedJoint,
    Frame,
    FreeJoint,
    Friction,
    GearJoint,
    Inertia,
    Limits,
    Mechanism,
    PlanarJoint,
    PointSpring,
    Polygon,
    PrismaticJoint,
    RevoluteJoint,
    RodJoint,
    ScrewJoint,
    Sphere,
    SphericalJoint,
    Spring,
    Tool,
    UniversalJoint,
)

TRAPS = (
    *(
        "on",
        "Yes",
        "nO",
        "true",
        "null",
        "~",
        "1",
        "-7",
        "1e3",
        "010",
        "0x1F",
        "0o17",
        "1_000",
        "1:30",
        "2024-01-01",
    ),
    *(
        "<<",
        "=",
        "!tag",
        "&anchor",
        "*alias",
        "- a",
        "a: b",
        "a:",
        "#x",
        "a #b",
        "%",
        "@",
        "`",
        "'",
        '"',
        "\\",
        "[",
        "{",
    ),
    *(
        "a,b",
        "a]",
        "?",
        "|",
        ">",
        "é",
        "关节",
        "link 1",
        "x" * 300,
        "type",
        "linkwork",
        "self",
        "ground_",
        "-",
        "---",
    ),
)
QUATERNION = ("qw", "qx", "qy", "qz")

numbers = st.floats(allow_nan=False, allow_infinity=False, allow_subnormal=False)
positive = st.floats(0, 1e6, exclude_min=True, allow_subnormal=False)
non_negative = st.floats(0, 1e6, allow_subnormal=False)
vectors = st.tuples(*[st.floats(-1e50, 1e50, allow_subnormal=False)] * 3)
directions = st.tuples(*[st.floats(-2, 2, allow_subnormal=False)] * 3).map(
    lambda v: v if np.linalg.norm(v) > 0.1 else (0.0, 0.6, -0.8)
)
frames = st.builds(Frame, position=vectors, rotation=vectors)
two_frames = st.just((Frame(), Frame())) | st.tuples(frames, frames)
frictions = st.builds(Friction, viscous=non_negative, coulomb=non_negative, coulomb_rate=positive)
springs = st.builds(Spring, stiffness=non_negative, rest=numbers, damping=non_negative)
limits = st.builds(
    Limits,
    lower=st.none() | st.floats(-9, -1),
    upper=st.none() | st.floats(1, 9),
    speed=st.none() | st.floats(0.1, 9),
)


def valid_name(text):
    return bool(text) and text == text.strip() and text.isprintable() and "." not in text


names = st.sampled_from(TRAPS) | st.text(min_size=1, max_size=6).filter(valid_name)


@st.composite
def inertias(draw):
    if draw(st.booleans()):
        return Inertia(zz=draw(non_negative))
    points = np.array(
        draw(
            st.lists(
                st.tuples(*[st.floats(-1, 1, allow_subnormal=False)] * 3), min_size=3, max_size=4
            )
        )
    )
    tensor = np.sum([p @ p * np.eye(3) - np.outer(p, p) for p in points], axis=0)
    tensor[np.abs(tensor) < np.finfo(float).tiny] = 0
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = tensor.tolist()
    return Inertia(xx=xx, yy=yy, zz=zz, xy=xy, xz=xz, yz=yz)


parts = st.floats(0, 1, allow_subnormal=False)
looks = {"frame": frames, "colour": st.none() | st.tuples(parts, parts, parts)}
corners = st.lists(st.integers(0, 99), min_size=6, max_size=9, unique=True).map(
    lambda hundredths: tuple(
        (float(np.cos(t)), float(np.sin(t))) for t in np.sort(hundredths) * 2 * np.pi / 100
    )
)
shapes = st.one_of(
    st.builds(Box, size=st.tuples(positive, positive, positive), **looks),
    st.builds(Cylinder, radius=positive, length=positive, **looks),
    st.builds(Sphere, radius=positive, **looks),
    st.builds(Capsule, radius=positive, length=positive, **looks),
    st.builds(Polygon, points=corners, thickness=positive, **looks),
)
bodies = st.builds(
    Body,
    mass=non_negative,
    centre_of_mass=vectors,
    inertia=st.just(Body(mass=0).inertia) | inertias(),
    shapes=st.lists(shapes, max_size=2),
)


def effects_of_one():
    return {
        "friction": frictions,
        "spring": springs,
        "limits": limits,
        "rotor_inertia": non_negative,
    }


def effects_by(freedoms):
    freedom = st.sampled_from(freedoms)
    slack = springs.map(lambda spring: spring.model_copy(update={"rest": 0.0}))
    above = limits.map(lambda bound: bound.model_copy(update={"lower": None}))
    turning = "turn" in freedoms
    return {
        "friction": st.dictionaries(freedom, frictions),
        "spring": st.dictionaries(freedom, slack if turning else springs),
        "limits": st.dictionaries(freedom, above if turning else limits),
        "rotor_inertia": st.dictionaries(freedom, non_negative),
    }


def crossing(first, second):
    """Return the first direction and one perpendicular to it, in the second's plane if that is
    another direction."""
    other = (
        second if np.linalg.norm(np.cross(first, second)) > 0.1 else np.roll(first, 1) * (1, -1, 2)
    )
    normal = np.cross(first, other)
    normal = normal / np.linalg.norm(normal)
    return first, tuple(np.where(abs(normal) < np.finfo(float).tiny, 0.0, normal).tolist())


axes = st.builds(crossing, directions, directions)


def pair_joints(first, second):
    """Return joints of any type between two bodies."""
    common = {"connects": st.just((first, second)), "frames": two_frames}
    one = common | effects_of_one()
    return st.one_of(
        st.builds(FixedJoint, **common),
        st.builds(RevoluteJoint, **one, axis=directions),
        st.builds(PrismaticJoint, **one, axis=directions),
        st.builds(ScrewJoint, **one, axis=directions, pitch=numbers),
        st.builds(
            CylindricalJoint, **common, **effects_by(CylindricalJoint.freedoms), axis=directions
        ),
        st.builds(UniversalJoint, **common, **effects_by(UniversalJoint.freedoms), axes=axes),
        st.builds(SphericalJoint, **common, **effects_by(SphericalJoint.freedoms)),
        st.builds(PlanarJoint, **common, **effects_by(PlanarJoint.freedoms)),
        st.builds(FreeJoint, **common, **effects_by(FreeJoint.freedoms)),
        st.builds(RodJoint, **common, length=positive),
    )


@st.composite
def mechanisms(draw):
    """Draw a mechanism whose bodies all hang on ground, with more joints that close loops."""
    body_names = draw(st.lists(names.filter(lambda name: name != GROUND), max_size=4, unique=True))
    joint_names = iter(draw(st.lists(names, min_size=8, max_size=8, unique=True)))
    joints = {}
    for index, body in enumerate(body_names):
        ends = draw(st.permutations([body, draw(st.sampled_from([GROUND, *body_names[:index]]))]))
        joints[next(joint_names)] = draw(pair_joints(*ends))
    two = st.permutations([GROUND, *body_names]).map(lambda order: order[:2])
    if body_names:
        for _ in range(draw(st.integers(0, 2))):
            joints[next(joint_names)] = draw(pair_joints(*draw(two)))
    labels = [label for name, joint in joints.items() for label in joint.coordinates(name)]
    rates = [label for name, joint in joints.items() for label in joint.rates(name)]
    geared = [
        label for label in labels if label in joints or label.rpartition(".")[2] not in QUATERNION
    ]
    if len(geared) > 1 and draw(st.booleans()):
        ratios = st.dictionaries(st.sampled_from(geared), positive, min_size=2)
        ratios, powers = draw(ratios), st.tuples(numbers, numbers, numbers)
        powers = st.dictionaries(st.sampled_from([*ratios]), powers, max_size=1)
        gear = st.builds(GearJoint, ratios=st.just(ratios), powers=powers, offset=numbers)
        joints[next(joint_names)] = draw(gear)
    points = st.builds(
        PointSpring,
        connects=two,
        points=st.tuples(vectors, vectors),
        stiffness=non_negative,
        rest_length=non_negative,
        damping=non_negative,
    )
    return Mechanism(
        name=draw(st.text(max_size=10)),
        gravity=draw(vectors),
        bodies={name: draw(bodies) for name in body_names},
        joints=joints,
        springs=draw(st.dictionaries(names, points, max_size=2)) if body_names else {},
        actuators=draw(st.lists(st.sampled_from(rates), unique=True)) if rates else (),
        tools=draw(
            st.dictionaries(
                names, st.builds(Tool, body=st.sampled_from(body_names), frame=frames), max_size=2
            )
        )
        if body_names
        else {},
        reference=draw(st.dictionaries(st.sampled_from(labels), numbers)) if labels else {},
    )
