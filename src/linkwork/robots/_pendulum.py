"""The simple pendulum and its chains: point masses on massless rods, hinge to hinge, in the
vertical xy plane.

mass i at the end of rod i; rod i at the absolute angle q_1 + ... + q_i from the x axis, length l_i
hinge_i one mass:  l q'' = -g cos q
"""

from __future__ import annotations

from linkwork.mechanism import Body, Frame, Inertia, Mechanism, MechanismError, RevoluteJoint, Tool
from linkwork.robots.uniform import require_kinds, require_sizes


def pendulum(
    lengths: tuple[float, ...] = (1.0,),
    masses: tuple[float, ...] = (1.0,),
    gravity: tuple[float, float, float] = (0.0, -9.81, 0.0),
) -> Mechanism:
    """Describe a pendulum: one point mass on a massless rod, or a chain of as many as there are
    lengths.

    Args:
        lengths: of the rods, from the fixed hinge on [m].
        masses: at the rods' ends [kg].
        gravity: acceleration of gravity in the ground's axes [m/s^2].

    Returns:
        The mechanism: joints hinge_1.. (all actuated), bodies rod_1..; its tool is the last mass.
            In the reference it lies
        along the x axis: where the benchmark's pendulum starts from rest.

    Raises:
        MechanismError: no length, not as many masses as lengths, a length or mass that is not above
            zero.

    Source: IFToMM library of computational benchmark problems, A01, simple pendulum (one mass of 1
    kg at 1 m).
    """
    require_kinds(pendulum, locals())
    if not 0 < len(lengths) == len(masses):
        raise MechanismError(
            f"{len(lengths)} lengths and {len(masses)} masses; give one mass at the end of each rod"
        )
    require_sizes(**{f"lengths[{i}]": length for i, length in enumerate(lengths)})
    names = ["ground", *(f"rod_{i}" for i in range(1, len(lengths) + 1))]
    starts = (0.0, *lengths[:-1])
    return Mechanism(
        name="pendulum" if len(lengths) == 1 else f"pendulum of {len(lengths)} masses",
        gravity=gravity,
        bodies={
            name: Body(mass=mass, centre_of_mass=(length, 0, 0), inertia=Inertia(zz=0.0))
            for name, length, mass in zip(names[1:], lengths, masses, strict=True)
        },
        joints={
            f"hinge_{i + 1}": RevoluteJoint(
                connects=(names[i], names[i + 1]), frames=(Frame.planar(start), Frame())
            )
            for i, start in enumerate(starts)
        },
        actuators=tuple(f"hinge_{i}" for i in range(1, len(names))),
        tools={"mass": Tool(body=names[-1], frame=Frame.planar(lengths[-1]))},
    )


def double_pendulum(
    lengths: tuple[float, float] = (1.0, 1.0),
    masses: tuple[float, float] = (1.0, 1.0),
    gravity: tuple[float, float, float] = (0.0, -9.81, 0.0),
) -> Mechanism:
    """Describe the double pendulum of two point masses.

    Args:
        lengths: of the two rods [m].
        masses: at their ends [kg].
        gravity: acceleration of gravity in the ground's axes [m/s^2].

    Returns:
        The mechanism of `pendulum`: joints hinge_1 and hinge_2, the second angle relative to the
            first rod.

    Raises:
        MechanismError: as `pendulum`.

    Source: Landau & Lifshitz, Mechanics, sec. 5, problem 1; dimensions ours.
    """
    require_kinds(double_pendulum, locals())
    return pendulum(lengths, masses, gravity).model_copy(update={"name": "double pendulum"})
