"""The Unimation Puma 560 arm: an open chain of six revolute joints, with rotors and friction.

    link i  has the axes of Denavit & Hartenberg's frame i:                                 joint_i
            A_i = Rz(q_i) Tz(d_i) Tx(a_i) Rx(alpha_i)
    rotor   the inertia G^2 J moves with the joint's rate;
            friction G^2 B (viscous) and |G| T_c (Coulomb)

Two of the published inertia tensors are no solid's, and are given here in a form with exactly the
same motion:
- link 1 only turns about its y axis, so of the published diag(0, 0.35, 0) only the 0.35 counts;
- of link 3's tensor a part k (1 - z z'), z the axis of joint 3, acts just as well in link 2: k =
  0.004 kg m^2 is moved.
"""

from __future__ import annotations

from math import cos, pi, radians, sin

from linkwork.mechanism import (
    Body,
    Frame,
    Friction,
    Inertia,
    Limits,
    Mechanism,
    RevoluteJoint,
    Tool,
)
from linkwork.robots.uniform import require_kinds, require_sizes, vector

d = (0.672, 0.0, 0.15005, 0.4318, 0.0, 0.0)  # [m]
a = (0.0, 0.4318, 0.0203, 0.0, 0.0, 0.0)  # [m]
alpha = (pi / 2, 0.0, -pi / 2, pi / 2, -pi / 2, 0.0)  # [rad]
MASSES = (0.0, 17.4, 4.8, 0.82, 0.34, 0.09)  # [kg]
CENTRES = (  # mass centres in the links' frames [m]
    (0.0, 0.0, 0.0),
    (-0.3638, 0.006, 0.2275),
    (-0.0203, -0.0141, 0.070),
    (0.0, 0.019, 0.0),
    (0.0, 0.0, 0.0),
    (0.0, 0.0, 0.032),
)
k = 0.004
TENSORS = (  # xx, yy, zz about the mass centres [kg m^2]
    (0.175, 0.35, 0.175),
    (0.13 - k, 0.524 - k, 0.539),
    (0.066 + k, 0.086, 0.0125 + k),
    (1.8e-3, 1.3e-3, 1.8e-3),
    (0.3e-3, 0.4e-3, 0.3e-3),
    (0.15e-3, 0.15e-3, 0.04e-3),
)
J = (200e-6, 200e-6, 200e-6, 33e-6, 33e-6, 33e-6)  # rotors [kg m^2]
G = (-62.6111, 107.815, -53.7063, 76.0364, 71.923, 76.686)  # gear ratios
# Viscous friction at the motors [N m s/rad].
B = (
    1.48e-3,
    0.817e-3,
    1.38e-3,
    71.2e-6,
    82.6e-6,
    36.7e-6,
)
T_c = (  # Coulomb friction at the motors, forwards and backwards [N m]
    (0.395, 0.435),
    (0.126, 0.071),
    (0.132, 0.105),
    (11.2e-3, 16.9e-3),
    (9.26e-3, 14.5e-3),
    (3.96e-3, 10.5e-3),
)
LIMITS = ((-160, 160), (-45, 225), (-225, 45), (-110, 170), (-100, 100), (-266, 266))  # [degrees]


def puma560(
    base: float = d[0], gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)
) -> Mechanism:
    """Describe the Puma 560: an arm of six revolute joints, with rotors and friction.

    z points up; at zero the upper arm lies along x and the forearm stands upright. The published
    Coulomb friction differs between the directions; the mean of the two is taken.

    Args:
        base: d_1, height of the shoulder above the ground [m].
        gravity: acceleration of gravity in the ground's axes [m/s^2].

    Returns:
        The mechanism: joints joint_1..6 (all actuated, by torques at the joints, not at the
            motors); its tool is the hand,
        the frame of link 6. The reference is q = (0, pi/4, -pi, 0, pi/4, 0), a nominal pose for
        work on a table.

    Raises:
        MechanismError: a height that is not above zero.

    Source: Armstrong, Khatib & Burdick, The explicit dynamic model and inertial parameters of the
    PUMA 560 arm, ICRA 1986; Corke & Armstrong-Helouvry, A search for consensus among model
    parameters reported for the PUMA 560 robot, ICRA 1994, in the numbers of Corke's Robotics
    Toolbox.
    """
    require_kinds(puma560, locals())
    require_sizes(base=base)
    names = ["ground", *(f"link_{i}" for i in range(1, 7))]
    bodies = {
        name: Body(mass=mass, centre_of_mass=centre, inertia=Inertia(xx=xx, yy=yy, zz=zz))
        for name, mass, centre, (xx, yy, zz) in zip(
            names[1:], MASSES, CENTRES, TENSORS, strict=True
        )
    }
    return Mechanism(
        name="Puma 560",
        gravity=gravity,
        bodies=bodies,
        joints={f"joint_{i + 1}": joint(i, (base, *d[1:])[i], names) for i in range(6)},
        actuators=tuple(f"joint_{i}" for i in range(1, 7)),
        tools={"hand": Tool(body="link_6")},
        reference={"joint_2": pi / 4, "joint_3": -pi, "joint_5": pi / 4},
    )


def joint(i: int, offset: float, names: list[str]) -> RevoluteJoint:
    """Return the joint before link i + 1; its second frame is (Tz(d) Tx(a) Rx(alpha))^-1 in the
    link."""
    position = vector((-a[i], -offset * sin(alpha[i]), -offset * cos(alpha[i])))
    lower, upper = LIMITS[i]
    return RevoluteJoint(
        connects=(names[i], names[i + 1]),
        frames=(Frame(), Frame(position=position, rotation=(-alpha[i], 0.0, 0.0))),
        friction=Friction(viscous=G[i] ** 2 * B[i], coulomb=abs(G[i]) * sum(T_c[i]) / 2),
        limits=Limits(lower=radians(lower), upper=radians(upper)),
        rotor_inertia=G[i] ** 2 * J[i],
    )
