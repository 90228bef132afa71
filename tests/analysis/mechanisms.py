"""Mechanisms of the tests: a general 3-RPR, Dietmaier's platform, a planar arm, a 3-RRS, a cart and
a mass on springs; robots that stand elsewhere."""

from functools import cache
from math import atan2, hypot

import numpy as np

import linkwork as lw

from tests.oracle.published import DIETMAIER_BASE, DIETMAIER_PLATFORM

LIGHT = lw.Body(mass=1.0, inertia=lw.Inertia(zz=0.1))
SOLID = lw.Body(mass=1.0, inertia=lw.Inertia(xx=0.1, yy=0.1, zz=0.1))
ALONG_X = (1.0, 0.0, 0.0)


@cache
def dietmaier():
    home = lw.Frame(position=(0.3, 0.5, 0.8), rotation=(0.1, 0.2, 0.3))
    sizes = {"tube_radii": (0.003, 0.005), "platform_radius": 0.1, "platform_thickness": 0.01}
    return lw.Robot(lw.robots.stewart(DIETMAIER_BASE, DIETMAIER_PLATFORM, home, **sizes))


def rpr(corners, vertices, pose):
    """Return a 3-RPR with any corners and platform vertices (3, 2), its reference at a pose
    (x, y, angle)."""
    x, y, angle = pose
    joints, reference = {}, {}
    for i, (corner, vertex) in enumerate(
        zip(np.array(corners), np.array(vertices), strict=True), start=1
    ):
        tip = np.array([x, y]) + turned(vertex, angle)
        aim = atan2(*(tip - corner)[::-1])
        joints |= {
            f"pivot_{i}": lw.RevoluteJoint(
                connects=("ground", f"cylinder_{i}"), frames=(lw.Frame.planar(*corner), lw.Frame())
            ),
            f"slide_{i}": lw.PrismaticJoint(
                connects=(f"cylinder_{i}", f"piston_{i}"), axis=ALONG_X
            ),
            f"wrist_{i}": lw.RevoluteJoint(
                connects=(f"piston_{i}", "platform"), frames=(lw.Frame(), lw.Frame.planar(*vertex))
            ),
        }
        reference |= {
            f"pivot_{i}": aim,
            f"slide_{i}": hypot(*(tip - corner)),
            f"wrist_{i}": angle - aim,
        }
    bodies = [f"{part}_{i}" for part in ("cylinder", "piston") for i in (1, 2, 3)]
    return lw.Robot(
        lw.Mechanism(
            name="general 3-RPR",
            bodies=dict.fromkeys((*bodies, "platform"), LIGHT),
            joints=joints,
            actuators=("slide_1", "slide_2", "slide_3"),
            tools={"platform": lw.Tool(body="platform")},
            reference=reference,
        )
    )


def elsewhere(robot, shift):
    """Return a robot whose joints on the ground are shifted [m]."""
    described = robot.mechanism
    joints = dict(described.joints)
    for name, joint in described.pairs.items():
        if joint.connects[0] == "ground":
            frame, other = joint.frames
            place = tuple(np.add(frame.position, shift))
            frames = (frame.model_copy(update={"position": place}), other)
            joints[name] = joint.model_copy(update={"frames": frames})  # pyright: ignore
    return lw.Robot(described.model_copy(update={"joints": joints}))


def turned(vector, angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s], [s, c]]) @ np.asarray(vector)


def postures(corners, vertices, lengths, samples=20001):
    """Return the platform's angles at which three circles about the corners hold its vertices, by
    their common point.

    Two differences of |P + R b_i - A_i|^2 = l_i^2 are linear in P; the sign changes of the third,
    times the square of their determinant, are the solutions.
    """
    A, b, rho = (np.asarray(part, float) for part in (corners, vertices, lengths))
    phi = np.linspace(-np.pi, np.pi, samples)
    R = np.moveaxis(np.array([[np.cos(phi), -np.sin(phi)], [np.sin(phi), np.cos(phi)]]), -1, 0)
    c = np.einsum("nij,kj->nki", R, b) - A
    M = 2 * (c[:, 1:] - c[:, :1])
    h = rho[1:] ** 2 - rho[0] ** 2 - np.sum(c[:, 1:] ** 2, axis=2) + np.sum(c[:, :1] ** 2, axis=2)
    det = np.linalg.det(M)
    P = np.stack(
        [h[:, 0] * M[:, 1, 1] - h[:, 1] * M[:, 0, 1], h[:, 1] * M[:, 0, 0] - h[:, 0] * M[:, 1, 0]],
        axis=1,
    )
    f = np.sum((P + det[:, None] * c[:, 0]) ** 2, axis=1) - det**2 * rho[0] ** 2
    return phi[:-1][np.sign(f[1:]) * np.sign(f[:-1]) < 0]


@cache
def arm(first=1.0, second=0.6):
    """Return a planar arm of two links, bent in its reference."""
    described = lw.robots.pendulum((first, second), (1.0, 1.0))
    return lw.Robot(described.model_copy(update={"reference": {"hinge_1": 0.3, "hinge_2": 1.2}}))


@cache
def geared_five_bar(ratio):
    """Return two cranks in mesh that lead a point by a link each, and where the first one's angle
    puts it: x (2) on either side of the line between the cranks' ends, none where they do not
    reach."""
    first, second, crank, other, base = 0.35, 0.4, 0.3, 0.45, 0.4

    def tips(turn):
        ends = [
            radius * np.array([np.cos(angle), np.sin(angle)]) + [foot, 0.0]
            for radius, angle, foot in ((crank, turn, 0.0), (other, ratio * turn, base))
        ]
        between = ends[1] - ends[0]
        away = np.hypot(*between)
        along = (first**2 - second**2 + away**2) / (2 * away)
        aside = np.sqrt(np.maximum(first**2 - along**2, 0.0)) or np.nan
        normal = np.array([-between[1], between[0]]) / away
        foot = ends[0] + along * between / away
        return ends, [foot + side * aside * normal for side in (1, -1)]

    ends, (tip, _) = tips(0.4)
    aims = [atan2(*(tip - end)[::-1]) for end in ends]
    joints = {
        "crank_1": lw.RevoluteJoint(connects=("ground", "crank_1")),
        "crank_2": lw.RevoluteJoint(
            connects=("ground", "crank_2"), frames=(lw.Frame.planar(base), lw.Frame())
        ),
        "pin_1": lw.RevoluteJoint(
            connects=("crank_1", "link_1"), frames=(lw.Frame.planar(crank), lw.Frame())
        ),
        "pin_2": lw.RevoluteJoint(
            connects=("crank_2", "link_2"), frames=(lw.Frame.planar(other), lw.Frame())
        ),
        "tip": lw.RevoluteJoint(
            connects=("link_1", "link_2"), frames=(lw.Frame.planar(first), lw.Frame.planar(second))
        ),
        "gear": lw.mechanism.GearJoint(ratios={"crank_2": 1.0, "crank_1": -ratio}),
    }
    turns = {"crank_1": 0.4, "crank_2": 0.4 * ratio}
    described = lw.Mechanism(
        bodies=dict.fromkeys(("crank_1", "crank_2", "link_1", "link_2"), LIGHT),
        joints=joints,
        actuators=("crank_1",),
        tools={"tip": lw.Tool(body="link_1", frame=lw.Frame.planar(first))},
        reference={
            **turns,
            "pin_1": aims[0] - 0.4,
            "pin_2": aims[1] - 0.4 * ratio,
            "tip": aims[1] - aims[0],
        },
    )
    return lw.Robot(described), lambda turn: [place[0] for place in tips(turn)[1]]


@cache
def spindle_arm():
    """Return an arm that a spindle of 2 mm a turn lifts, where the spindle's pivot is, and its
    pitch [m/rad]."""
    pitch, pivot, raised = 0.002 / (2 * np.pi), np.array([0.6, -0.1]), 1.0
    to_pin = 0.5 * np.array([np.cos(raised), np.sin(raised)]) - pivot
    aim, length = atan2(*to_pin[::-1]), hypot(*to_pin)
    joints = {
        "hinge": lw.RevoluteJoint(connects=("ground", "arm")),
        "pivot": lw.RevoluteJoint(
            connects=("ground", "tube"), frames=(lw.Frame.planar(*pivot), lw.Frame())
        ),
        "spindle": lw.RevoluteJoint(connects=("tube", "spindle"), axis=ALONG_X),
        "guide": lw.PrismaticJoint(connects=("tube", "nut"), axis=ALONG_X),
        "thread": lw.ScrewJoint(connects=("spindle", "nut"), axis=ALONG_X, pitch=pitch),
        "pin": lw.RevoluteJoint(connects=("nut", "arm"), frames=(lw.Frame(), lw.Frame.planar(0.5))),
    }
    described = lw.Mechanism(
        bodies=dict.fromkeys(("arm", "tube", "spindle", "nut"), SOLID),
        joints=joints,
        actuators=("spindle",),
        tools={"arm": lw.Tool(body="arm", task=("rz",))},
        reference={
            "hinge": raised,
            "pivot": aim,
            "guide": length,
            "thread": length / pitch,
            "spindle": -length / pitch,
            "pin": raised - aim,
        },
    )
    return lw.Robot(described), pivot, pitch


@cache
def cart(mass=2.0, stiffness=50.0, damping=0.0):
    """Return a mass on a slide with a spring."""
    slide = lw.PrismaticJoint(
        connects=("ground", "mass"),
        axis=ALONG_X,
        spring=lw.Spring(stiffness=stiffness, rest=0.1, damping=damping),
    )
    return lw.Robot(
        lw.Mechanism(
            bodies={"mass": lw.Body(mass=mass)},
            joints={"slide": slide},
            actuators=("slide",),
            tools={"mass": lw.Tool(body="mass")},
            gravity=(0.0, 0.0, 0.0),
        )
    )


@cache
def cables():
    """Return a mass in the plane that three slides pull from corners, one of them more than it has
    freedoms."""
    corners = ((0.0, 0.0), (2.0, 0.0), (1.0, 2.0))
    joints, reference = {}, {}
    for i, (x, y) in enumerate(corners, start=1):
        along = np.array([1.0, 0.8]) - (x, y)
        joints |= {
            f"pivot_{i}": lw.RevoluteJoint(
                connects=("ground", f"drum_{i}"), frames=(lw.Frame.planar(x, y), lw.Frame())
            ),
            f"cable_{i}": lw.PrismaticJoint(connects=(f"drum_{i}", f"cord_{i}"), axis=ALONG_X),
            f"knot_{i}": lw.RevoluteJoint(connects=(f"cord_{i}", "mass")),
        }
        reference |= {
            f"pivot_{i}": float(np.arctan2(along[1], along[0])),
            f"cable_{i}": float(np.hypot(*along)),
        }
        reference |= {f"knot_{i}": -reference[f"pivot_{i}"]}
    del joints["knot_1"]
    joints["knot_1"] = lw.RevoluteJoint(connects=("cord_1", "mass"))
    joints["level"] = lw.GearJoint(ratios={"pivot_1": 1.0, "knot_1": 1.0})
    cord = lw.Body(mass=0.01, inertia=lw.Inertia(zz=1e-4))
    return lw.Robot(
        lw.Mechanism(
            gravity=(0.0, -9.81, 0.0),
            bodies=dict.fromkeys(
                (f"{part}_{i}" for part in ("drum", "cord") for i in (1, 2, 3)), cord
            )
            | {"mass": lw.Body(mass=5.0, inertia=lw.Inertia(zz=0.01))},
            joints=joints,
            actuators=("cable_1", "cable_2", "cable_3"),
            tools={"mass": lw.Tool(body="mass")},
            reference=reference,
        )
    )


@cache
def rrs(knee=2.0, link=0.5, base=0.4, platform=0.3):
    """Return a 3-RRS, its platform level in the reference: legs of hinge, hinge and ball in upright
    planes.

    knee: angle between the links of a leg there [rad]; base, platform: distances of hinges and
    balls from the middle [m]
    """
    bodies, joints, reference = {"platform": SOLID}, {}, {}
    reach = 2 * link * np.sin(knee / 2)
    lean = np.arccos((platform - base) / reach) - (np.pi - knee) / 2
    half = (lean + np.pi - knee) / 2
    for i, azimuth in enumerate(2 * np.pi / 3 * np.arange(3), start=1):
        foot, tip = (
            lw.Frame(
                position=(r * np.cos(azimuth), r * np.sin(azimuth), 0), rotation=(0, 0, azimuth)
            )
            for r in (base, platform)
        )
        end, axis = lw.Frame(position=(link, 0, 0)), (0.0, -1.0, 0.0)
        low, high = f"low_{i}", f"high_{i}"
        bodies |= {low: SOLID, high: SOLID}
        joints |= {
            f"hip_{i}": lw.RevoluteJoint(
                connects=("ground", low), axis=axis, frames=(foot, lw.Frame())
            ),
            f"knee_{i}": lw.RevoluteJoint(
                connects=(low, high), axis=axis, frames=(end, lw.Frame())
            ),
            f"ball_{i}": lw.SphericalJoint(connects=(high, "platform"), frames=(end, tip)),
        }
        reference |= {f"hip_{i}": lean, f"knee_{i}": np.pi - knee}
        reference |= {f"ball_{i}.qw": np.cos(half), f"ball_{i}.qy": np.sin(half)}
    return lw.Robot(
        lw.Mechanism(
            bodies=bodies,
            joints=joints,
            actuators=("hip_1", "hip_2", "hip_3"),
            tools={"centre": lw.Tool(body="platform")},
            reference=reference,
        )
    )
