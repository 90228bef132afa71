"""Small legs with loops, and their geometry told by hand."""

from __future__ import annotations

from functools import cache

import numpy as np

import linkwork as lw

CRANK, HEIGHT, WIDTH, HEEL = 0.05, 0.3, 0.04, 0.06


def moments(xx, yy, zz):
    return lw.Inertia(xx=xx, yy=yy, zz=zz)


@cache
def ankle(heavy: bool = True) -> lw.Robot:
    """Return a foot on a universal joint (pitch about y, roll about x) that two motors on the
    shank move by cranks and rods.

    heavy: whether the rods are bodies; else they are massless.
    """
    at = lw.Frame
    sides = {"left": 1.0, "right": -1.0}
    bodies = {
        "foot": lw.Body(
            mass=1.2, centre_of_mass=(0.04, 0.01, -0.05), inertia=moments(0.002, 0.006, 0.007)
        )
    }
    joints: dict = {
        "ankle": lw.UniversalJoint(connects=("ground", "foot"), axes=((0, 1, 0), (1, 0, 0)))
    }
    length = float(np.linalg.norm(crank_end(1.0, 0.0) - heel(1.0, 0.0, 0.0)))
    for name, side in sides.items():
        bodies[f"crank_{name}"] = lw.Body(
            mass=0.2, centre_of_mass=(-0.02, 0, 0), inertia=moments(1e-5, 2e-4, 2e-4)
        )
        pivot = at(position=(0.0, side * WIDTH, HEIGHT))
        joints[f"motor_{name}"] = lw.RevoluteJoint(
            connects=("ground", f"crank_{name}"),
            frames=(pivot, at()),
            axis=(0, 1, 0),
            rotor_inertia=0.01,
            friction=lw.Friction(viscous=0.05),
        )
        ends = at(position=(-CRANK, 0, 0)), at(position=(-HEEL, side * WIDTH, 0))
        if heavy:
            bodies[f"rod_{name}"] = lw.Body(
                mass=0.15, centre_of_mass=(0, 0, -length / 2), inertia=moments(1e-3, 1e-3, 2e-6)
            )
            joints[f"upper_{name}"] = lw.UniversalJoint(
                connects=(f"crank_{name}", f"rod_{name}"),
                frames=(ends[0], at()),
                axes=((0, 1, 0), (1, 0, 0)),
            )
            joints[f"lower_{name}"] = lw.SphericalJoint(
                connects=(f"rod_{name}", "foot"), frames=(at(position=(0, 0, -length)), ends[1])
            )
        else:
            joints[f"rod_{name}"] = lw.RodJoint(
                connects=(f"crank_{name}", "foot"), frames=ends, length=length
            )
    return lw.Robot(
        lw.Mechanism(
            name="ankle",
            bodies=bodies,
            joints=joints,
            actuators=("motor_left", "motor_right"),
            reference={"motor_left": 0.0, "motor_right": 0.0},
        )
    )


def crank_end(side, theta):
    """Return the end of a crank, turned by theta about y."""
    return np.array([-CRANK * np.cos(theta), side * WIDTH, HEIGHT + CRANK * np.sin(theta)])


def heel(side, pitch, roll):
    """Return where a rod meets the foot: Ry(pitch) Rx(roll) (-HEEL, side WIDTH, 0)."""
    y, z = side * WIDTH * np.cos(roll), side * WIDTH * np.sin(roll)
    c, s = np.cos(pitch), np.sin(pitch)
    return np.array([-HEEL * c + z * s, y, HEEL * s + z * c])


def crank_angle(side, pitch, roll):
    """Return theta in closed form: the rod's length gives a cos theta + b sin theta = c."""
    x, y, z = heel(side, pitch, roll)
    length = np.linalg.norm(crank_end(side, 0.0) - heel(side, 0.0, 0.0))
    up, across = HEIGHT - z, side * WIDTH - y
    c = length**2 - CRANK**2 - x**2 - up**2 - across**2
    a, b = 2 * CRANK * x, 2 * CRANK * up
    return np.arctan2(b, a) - np.arccos(c / np.hypot(a, b))


@cache
def knee() -> lw.Robot:
    """Return a shank on a knee that a motor on the thigh turns through a four-bar, the thigh on a
    hip."""
    bar = lw.Frame.planar
    return lw.Robot(
        lw.Mechanism(
            name="knee",
            gravity=(0, -9.81, 0),
            bodies={
                "thigh": lw.Body(mass=3.0, centre_of_mass=(0.2, 0, 0), inertia=lw.Inertia(zz=0.05)),
                "shank": lw.Body(mass=2.0, centre_of_mass=(0.2, 0, 0), inertia=lw.Inertia(zz=0.03)),
                "crank": lw.Body(
                    mass=0.3, centre_of_mass=(0.02, 0, 0), inertia=lw.Inertia(zz=3e-4)
                ),
                "rod": lw.Body(mass=0.4, centre_of_mass=(0.15, 0, 0), inertia=lw.Inertia(zz=4e-3)),
            },
            joints={
                "hip": lw.RevoluteJoint(connects=("ground", "thigh")),
                "knee": lw.RevoluteJoint(connects=("thigh", "shank"), frames=(bar(0.4), bar())),
                "motor": lw.RevoluteJoint(
                    connects=("thigh", "crank"), frames=(bar(0.1), bar()), rotor_inertia=0.02
                ),
                "upper": lw.RevoluteJoint(connects=("crank", "rod"), frames=(bar(0.06), bar())),
                "lower": lw.RevoluteJoint(
                    connects=("rod", "shank"), frames=(bar(0.3), bar(-0.05, 0.01))
                ),
            },
            actuators=("hip", "motor"),
            reference={"hip": -1.5, "motor": 1.6, "knee": -0.3},
        )
    )


@cache
def two_knees() -> lw.Robot:
    """Return two legs of `knee`, each on a hip of its own."""
    one = knee().mechanism
    bodies, joints = {}, {}
    for side in ("1", "2"):
        own = {name: f"{name}_{side}" for name in one.bodies} | {"ground": "ground"}
        bodies |= {own[name]: body for name, body in one.bodies.items()}
        joints |= {
            f"{name}_{side}": joint.model_copy(
                update={"connects": tuple(own[body] for body in joint.connects)}
            )
            for name, joint in one.pairs.items()
        }
    return lw.Robot(
        lw.Mechanism(
            name="knees",
            gravity=one.gravity,
            bodies=bodies,
            joints=joints,
            actuators=("hip_1", "motor_1", "hip_2", "motor_2"),
            reference={f"{name}_{side}": x for name, x in one.reference.items() for side in "12"},
        )
    )


@cache
def spinning_ankle() -> lw.Robot:
    """Return the ankle with balls at both ends of its rods, which turn about themselves and are
    thick, so that this is felt."""
    mechanism = ankle().mechanism
    joints: dict = dict(mechanism.joints)
    bodies = dict(mechanism.bodies)
    for side in ("left", "right"):
        rod = bodies[f"rod_{side}"]
        bodies[f"rod_{side}"] = rod.model_copy(update={"inertia": moments(1e-3, 1e-3, 8e-4)})
        upper = joints[f"upper_{side}"]
        joints[f"upper_{side}"] = lw.SphericalJoint(connects=upper.connects, frames=upper.frames)
    return lw.Robot(mechanism.model_copy(update={"bodies": bodies, "joints": joints}))


@cache
def floating_knee() -> lw.Robot:
    """Return the leg of `knee` under a pelvis that moves freely, whose joint's frames are turned
    and off their bodies' origins."""
    leg, at = knee().mechanism, lw.Frame
    pelvis = lw.Body(mass=4.0, centre_of_mass=(0.02, 0.01, -0.03), inertia=moments(0.1, 0.2, 0.15))
    frames = (
        at(position=(0.1, 0.2, 0.3), rotation=(0.3, -0.2, 0.5)),
        at(position=(-0.05, 0.04, 0.1), rotation=(0.1, 0.6, -0.4)),
    )
    bodies = {"pelvis": pelvis}
    for name, body in leg.bodies.items():
        zz = body.inertia.zz
        bodies[name] = body.model_copy(update={"inertia": moments(0.3 * zz, 0.9 * zz, zz)})
    joints: dict = {"base": lw.FreeJoint(connects=("ground", "pelvis"), frames=frames)}
    hip = leg.joints["hip"].model_copy(update={"connects": ("pelvis", "thigh")})
    return lw.Robot(
        leg.model_copy(update={"bodies": bodies, "joints": joints | {**leg.joints, "hip": hip}})
    )
