"""Robots whose tools shift in some directions and turn about some axes, described ad hoc."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from linkwork import (
    Body,
    CylindricalJoint,
    Frame,
    Inertia,
    Mechanism,
    PrismaticJoint,
    RevoluteJoint,
    SphericalJoint,
    Tool,
)

ROUND = Inertia(xx=0.01, yy=0.01, zz=0.01)
PART = Body(mass=1.0, inertia=ROUND)
BASE, TOP, HEIGHT = 0.3, 0.2, 0.5
FIRST, SECOND = 0.3, 0.35


def at(*position: float, rotation: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Frame:
    return Frame(position=tuple(map(float, position)), rotation=rotation)


def scara(task=None, rotation=(0.0, 0.0, 0.0)) -> Mechanism:
    """Two arms of 0.4 and 0.3 m, a spindle that slides and turns: x, y, z and a turn about z."""
    names = ("upper", "fore", "quill", "hand")
    return Mechanism(
        name="scara",
        bodies=dict.fromkeys(names, PART),
        joints={
            "shoulder": RevoluteJoint(connects=("ground", "upper")),
            "elbow": RevoluteJoint(connects=("upper", "fore"), frames=(at(0.4, 0, 0), at(0, 0, 0))),
            "lift": PrismaticJoint(
                connects=("fore", "quill"), frames=(at(0.3, 0, 0), at(0, 0, 0)), axis=(0, 0, 1)
            ),
            "wrist": RevoluteJoint(connects=("quill", "hand")),
        },
        actuators=("shoulder", "elbow", "lift", "wrist"),
        tools={"hand": Tool(body="hand", frame=Frame(rotation=rotation), task=task)},
        reference={"shoulder": 0.3, "elbow": 0.8, "lift": -0.1, "wrist": -0.4},
    )


def three_legs(lower: str, task=None) -> Mechanism:
    """The 3-RRS ("RRS") and 3-RPS ("RPS") with legs in planes 120 degrees apart; z, and two
    tilts."""
    bodies, joints, reference, drives = {"platform": PART}, {}, {}, []
    foot = np.arctan2(HEIGHT, TOP - BASE)
    for i, angle in enumerate(np.radians([0.0, 120.0, 240.0]), start=1):
        about, e = (0.0, 0.0, float(angle)), np.array([np.cos(angle), np.sin(angle), 0.0])
        shaft = at(*(BASE * e), rotation=about)
        bodies |= {f"lower_{i}": PART, f"upper_{i}": PART}
        # The leg's plane is spanned by e and z, its first joint turns about -t = (sin, -cos, 0).
        joints[f"hinge_{i}"] = RevoluteJoint(
            connects=("ground", f"lower_{i}"), frames=(shaft, Frame()), axis=(0, -1, 0)
        )
        if lower == "RPS":
            joints[f"slide_{i}"] = PrismaticJoint(
                connects=(f"lower_{i}", f"upper_{i}"), axis=(1, 0, 0)
            )
            reference |= {f"hinge_{i}": foot, f"slide_{i}": float(np.hypot(HEIGHT, TOP - BASE))}
            reach, drive = 0.0, f"slide_{i}"
        else:
            joints[f"knee_{i}"] = RevoluteJoint(
                connects=(f"lower_{i}", f"upper_{i}"),
                frames=(at(FIRST, 0, 0), Frame()),
                axis=(0, -1, 0),
            )
            hip, knee = knees(np.array([TOP - BASE, HEIGHT]))
            reference |= {f"hinge_{i}": hip, f"knee_{i}": knee}
            reach, drive = SECOND, f"hinge_{i}"
        joints[f"ball_{i}"] = SphericalJoint(
            connects=(f"upper_{i}", "platform"), frames=(at(reach, 0, 0), at(*(TOP * e)))
        )
        drives.append(drive)
    return Mechanism(
        name=f"3-{lower}",
        bodies=bodies,
        joints=joints,
        actuators=tuple(drives),
        tools={"centre": Tool(body="platform", task=task)},
        reference=reference,
    )


def three_cpr() -> Mechanism:
    """A 3-CPR: cylindrical joints along the sides of a triangle, slides, hinges along the same
    sides."""
    bodies, joints, reference = {"platform": PART}, {}, {}
    lean = float(np.arctan2(HEIGHT, TOP - BASE))
    for i, azimuth in enumerate(2 * np.pi / 3 * np.arange(3), start=1):
        e, turned = np.array([np.cos(azimuth), np.sin(azimuth), 0]), (0.0, 0.0, float(azimuth))
        bodies |= {f"lower_{i}": PART, f"upper_{i}": PART}
        joints |= {
            f"foot_{i}": CylindricalJoint(
                connects=("ground", f"lower_{i}"),
                frames=(at(*(BASE * e), rotation=turned), Frame()),
                axis=(0, -1, 0),
            ),
            f"slide_{i}": PrismaticJoint(connects=(f"lower_{i}", f"upper_{i}"), axis=(1, 0, 0)),
            f"hinge_{i}": RevoluteJoint(
                connects=(f"upper_{i}", "platform"),
                frames=(Frame(), at(*(TOP * e), rotation=turned)),
                axis=(0, -1, 0),
            ),
        }
        reference |= {
            f"foot_{i}.angle": lean,
            f"slide_{i}": float(np.hypot(HEIGHT, TOP - BASE)),
            f"hinge_{i}": -lean,
        }
    return Mechanism(
        name="3-CPR",
        bodies=bodies,
        joints=joints,
        actuators=("slide_1", "slide_2", "slide_3"),
        tools={"centre": Tool(body="platform")},
        reference=reference,
    )


def turned(mechanism: Mechanism, by: tuple[float, float, float]) -> Mechanism:
    """Return a mechanism on a ground that is turned, with its weight, by a rotation vector."""
    R, joints = Rotation.from_rotvec(by), {}

    def on_ground(frame: Frame) -> Frame:
        rotation = R * Rotation.from_rotvec(frame.rotation)
        return at(*R.apply(frame.position), rotation=tuple(rotation.as_rotvec().tolist()))

    for name, joint in mechanism.pairs.items():
        parts = zip(joint.connects, joint.frames, strict=True)
        frames = tuple(on_ground(frame) if body == "ground" else frame for body, frame in parts)
        joints[name] = joint.model_copy(update={"frames": frames})
    gravity = tuple(R.apply(mechanism.gravity).tolist())
    return mechanism.model_copy(update={"joints": joints, "gravity": gravity})


def knees(foot: np.ndarray) -> tuple[float, float]:
    """Return the angles of a leg of two links whose end is at a point (2) of its plane, knee
    outside."""
    square = foot @ foot
    knee = np.arccos((square - FIRST**2 - SECOND**2) / (2 * FIRST * SECOND))
    hip = np.arctan2(foot[1], foot[0]) - np.arctan2(
        SECOND * np.sin(knee), FIRST + SECOND * np.cos(knee)
    )
    return float(hip), float(knee)


def pose_of_three_legs(z: float, azimuth: float, tilt: float) -> tuple[np.ndarray, np.ndarray]:
    """Return position and orientation of the platform of three legs in planes 120 degrees apart.

    The legs' ends stay in their planes where the torsion is zero and, for tilt t and azimuth f,
    x = -h (1 - cos t) cos 2 f / 2,  y = h (1 - cos t) sin 2 f / 2  (Bonev et al. 2002).
    """
    shift = TOP * (1 - np.cos(tilt)) / 2
    turn, lean = rotation_z(azimuth), rotation_y(tilt)
    place = np.array([-shift * np.cos(2 * azimuth), shift * np.sin(2 * azimuth), z])
    return place, turn @ lean @ turn.T


def rotation_z(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def rotation_y(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
