"""Andrews' squeezer: seven bodies in a plane, driven at K1, closed at the point P where four bodies
meet.

With e(a) = (cos a, sin a) and n(a) = (sin a, -cos a):

    K1  about O = (0, 0) at the angle beta, length rr                                beta, actuated
    K2  on K1's pin, at the angle beta + Theta:   P = rr e(beta) - d e(beta + Theta)          Theta
    K3  about B, at the angle gamma:              P = B + ss n(gamma),                        gamma
        its point D = B + sd e(gamma) + sc n(gamma) hangs on C by a spring
    K5  about A, at the angle delta, and          K4 on it, at Phi + delta:              delta, Phi
                                                  P = A + zt e(delta) + e n(Phi + delta)
    K7  about A, at the angle epsilon, and        K6 on it, at Omega + epsilon:      epsilon, Omega
                                                  P = A + u n(epsilon) + zf e(Omega + epsilon)

The joints bear the names of the published angles, and their coordinates are these angles: q =
(beta, Theta, gamma, Phi, delta, Omega, epsilon). The joints P_3, P_4, P_6 of K3, K4, K6 to K2 close
the three loops.
"""

from __future__ import annotations

from math import atan2, cos, isfinite, remainder, sin, tau

from linkwork.mechanism import (
    Body,
    Frame,
    Inertia,
    Mechanism,
    MechanismError,
    PointSpring,
    RevoluteJoint,
    Tool,
)
from linkwork.robots.plane import Point, meet
from linkwork.robots.uniform import require_kinds

ANGLES = ("beta", "Theta", "gamma", "Phi", "delta", "Omega", "epsilon")

A, B, C = (-0.06934, -0.00227), (-0.03635, 0.03273), (0.014, 0.072)  # fixed points [m]
MASSES = (0.04325, 0.00365, 0.02373, 0.00706, 0.07050, 0.00706, 0.05498)  # of K1 .. K7 [kg]
# About the mass centres [kg m^2].
INERTIAS = (
    2.194e-6,
    4.410e-7,
    5.255e-6,
    5.667e-7,
    1.169e-5,
    5.667e-7,
    1.912e-5,
)
rr, d, ss, e, zt, u, zf = 0.007, 0.028, 0.035, 0.02, 0.04, 0.04, 0.02  # lengths between joints [m]
sc, sd = 0.018, 0.02  # the spring's point on K3 [m]
ra, da, sa, sb, ea, ta, tb, ua, ub, fa = (  # places of the mass centres [m]
    *(0.00092, 0.0115, 0.01874, 0.01043, 0.01421),
    *(0.02308, 0.00916, 0.01228, 0.00449, 0.01421),
)


def andrews(
    beta: float = -0.0617138900142764496358948458001,
    stiffness: float = 4530.0,
    rest_length: float = 0.07785,
    gravity: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Mechanism:
    """Describe Andrews' squeezer: seven bodies in a plane, three loops and a spring, driven at the
    crank K1.

    The published motion starts from rest and is driven by 0.033 N m for 0.03 s.

    Args:
        beta: angle of K1 in the reference [rad]; -0.0617... makes Theta zero, the IFToMM problem
            A03 starts at -0.0620.
        stiffness: of the spring between C and D [N/m].
        rest_length: of the spring [m].
        gravity: acceleration of gravity in the ground's axes [m/s^2]; the published motion has
            none.

    Returns:
        The mechanism: joints named by their angles beta (actuated), Theta, gamma, Phi, delta,
            Omega, epsilon, and P_3, P_4,
        P_6; its tool is the point P on K2. The reference is the published branch.

    Raises:
        MechanismError: an angle that is not finite; the crank can stand anywhere.

    Source: Schiehlen (ed.), Multibody Systems Handbook, 1990; Hairer & Wanner, Solving Ordinary
    Differential Equations II, sec. VII.7; data of the IVP test set (Mazzia & Magherini, 2008),
    which is IFToMM problem A03 too.
    """
    require_kinds(andrews, locals())
    # Bodies with their mass centres in the axes of the original paper's figure.
    centres = (
        (ra, 0.0),
        (-da, 0.0),
        (sb, -sa),
        (0.0, ea - e),
        (ta, tb),
        (zf - fa, 0.0),
        (-ub, -ua),
    )
    bodies = {
        f"K{i}": Body(mass=mass, centre_of_mass=(x, y, 0.0), inertia=Inertia(zz=inertia))
        for i, (mass, inertia, (x, y)) in enumerate(
            zip(MASSES, INERTIAS, centres, strict=True), start=1
        )
    }
    # Seven hinges in the tree and to ground; three more that meet at P.
    P = {"K2": (-d, 0.0), "K3": (0.0, -ss), "K4": (0.0, -e), "K6": (zf, 0.0)}
    joints = {
        "beta": hinge("ground", "K1"),
        "Theta": hinge("K1", "K2", (rr, 0.0)),
        "gamma": hinge("ground", "K3", B),
        "Phi": hinge("K5", "K4", (zt, 0.0)),
        "delta": hinge("ground", "K5", A),
        "Omega": hinge("K7", "K6", (0.0, -u)),
        "epsilon": hinge("ground", "K7", A),
    }
    joints |= {f"P_{body[1]}": hinge("K2", body, P["K2"], P[body]) for body in ("K3", "K4", "K6")}
    # The spring that the squeezer works against.
    spring = PointSpring(
        connects=("ground", "K3"),
        points=((*C, 0.0), (sd, -sc, 0.0)),
        stiffness=stiffness,
        rest_length=rest_length,
    )
    return Mechanism(
        name="Andrews' squeezer",
        gravity=gravity,
        bodies=bodies,
        joints=joints,
        springs={"CD": spring},
        actuators=("beta",),
        tools={"P": Tool(body="K2", frame=Frame.planar(-d, 0.0))},
        reference=closed(beta),
    )


def hinge(first: str, second: str, p: Point = (0.0, 0.0), q: Point = (0.0, 0.0)) -> RevoluteJoint:
    """Return a revolute joint at the point p of the first and q of the second body [m], all frames
    parallel at zero."""
    return RevoluteJoint(connects=(first, second), frames=(Frame.planar(*p), Frame.planar(*q)))


def closed(beta: float) -> dict[str, float]:
    """Return all joint coordinates on the published branch [rad]: P from K1 and B, then the two
    dyads from P and A."""
    if not isfinite(beta):
        raise MechanismError(f"is {beta}; give a finite angle [rad]", ("beta",))
    pin = rr * cos(beta), rr * sin(beta)
    P = meet(pin, d, B, ss, 1, "links K2 and K3")
    Theta = remainder(atan2(pin[1] - P[1], pin[0] - P[0]) - beta, tau)
    gamma = atan2(P[0] - B[0], B[1] - P[1])
    knee = meet(A, zt, P, e, 1, "links K5 and K4")
    delta = atan2(knee[1] - A[1], knee[0] - A[0])
    fourth = atan2(P[0] - knee[0], knee[1] - P[1])
    knee = meet(A, u, P, zf, -1, "links K7 and K6")
    epsilon = atan2(knee[0] - A[0], A[1] - knee[1])
    sixth = atan2(P[1] - knee[1], P[0] - knee[0])
    angles = (beta, Theta, gamma, fourth - delta, delta, sixth - epsilon, epsilon)
    closing = {
        "P_3": gamma - beta - Theta,
        "P_4": fourth - beta - Theta,
        "P_6": sixth - beta - Theta,
    }
    return dict(zip(ANGLES, angles, strict=True)) | closing
