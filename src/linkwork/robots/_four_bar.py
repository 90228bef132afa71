"""The planar four-bar, and the ladder of N four-bars of the IFToMM benchmark library."""

from __future__ import annotations

from math import pi

from linkwork.mechanism import Body, Frame, Inertia, Mechanism, RevoluteJoint, Tool
from linkwork.robots.uniform import require_kinds


def four_bar(
    ground: float = 1.1,
    crank: float = 0.5,
    coupler: float = 1.2,
    rocker: float = 0.75,
    masses: tuple[float, float, float] = (0.5, 1.0, 0.75),
    centres: tuple[float, float, float] = (0.25, 0.6, 0.375),
    inertias: tuple[float, float, float] = (0.333, 0.537, 0.4),
    gravity: tuple[float, float, float] = (0.0, -9.81, 0.0),
) -> Mechanism:
    """Describe a planar four-bar linkage, driven at the crank.

    Args:
        ground, crank, coupler, rocker: lengths [m]; the fixed pivots lie at (0, 0) and (ground, 0).
        masses: of crank, coupler and rocker [kg].
        centres: distance of the mass centres from the pivots crank_pivot, crank_pin and
            rocker_pivot [m].
        inertias: about the mass centres, about z [kg m^2].
        gravity: acceleration of gravity in the ground's axes [m/s^2].

    Source: RigidBodyDynamics.jl, example "Four-bar linkage" (its lengths and masses; gravity there
    is along -z of a frame whose z lies in the plane).
    """
    require_kinds(four_bar, locals())
    # Bodies, each along its own x axis.
    names = ("crank", "coupler", "rocker")
    bodies = {
        name: Body(mass=mass, centre_of_mass=(centre, 0, 0), inertia=Inertia(zz=inertia))
        for name, mass, centre, inertia in zip(names, masses, centres, inertias, strict=True)
    }
    # Four hinges, the last of which closes the loop.
    joints = {
        "crank_pivot": RevoluteJoint(connects=("ground", "crank")),
        "crank_pin": RevoluteJoint(
            connects=("crank", "coupler"), frames=(Frame.planar(crank), Frame())
        ),
        "rocker_pivot": RevoluteJoint(
            connects=("ground", "rocker"), frames=(Frame.planar(ground), Frame())
        ),
        "rocker_pin": RevoluteJoint(
            connects=("coupler", "rocker"), frames=(Frame.planar(coupler), Frame.planar(rocker))
        ),
    }
    return Mechanism(
        name="four-bar",
        gravity=gravity,
        bodies=bodies,
        joints=joints,
        actuators=("crank_pivot",),
        tools={"coupler_point": Tool(body="coupler", frame=Frame.planar(coupler / 2))},
        reference={
            "crank_pivot": 1.67132743315,
            "crank_pin": -1.4596067104,
            "rocker_pivot": 1.5400928489,
            "rocker_pin": 1.32837212614,
        },
    )


def n_four_bar(loops: int = 2, length: float = 1.0, mass: float = 1.0) -> Mechanism:
    """Describe N four-bars side by side: N + 1 cranks of equal length on fixed pivots, neighbours
    joined by couplers.

    All 2N + 1 links are uniform rods. The cranks stay parallel; where they lie along the couplers'
    line the freedoms jump from 1 to N + 1.

    Args:
        loops: N.
        length: of every rod and between neighbouring pivots [m].
        mass: of every rod [kg].

    Source: IFToMM library of computational benchmark problems, A02, N-four-bar mechanism.
    """
    require_kinds(n_four_bar, locals())
    rod = Body(
        mass=mass, centre_of_mass=(length / 2, 0, 0), inertia=Inertia(zz=mass * length**2 / 12)
    )
    bodies, joints, reference = {}, {}, {}
    for i in range(loops + 1):
        bodies[f"crank_{i}"] = rod
        joints[f"pivot_{i}"] = RevoluteJoint(
            connects=("ground", f"crank_{i}"), frames=(Frame.planar(i * length), Frame())
        )
        reference[f"pivot_{i}"] = pi / 2
    for i in range(1, loops + 1):
        bodies[f"coupler_{i}"] = rod
        tips = (Frame.planar(length), Frame())
        joints[f"pin_{i}"] = RevoluteJoint(connects=(f"crank_{i - 1}", f"coupler_{i}"), frames=tips)
        joints[f"top_{i}"] = RevoluteJoint(
            connects=(f"coupler_{i}", f"crank_{i}"),
            frames=(Frame.planar(length), Frame.planar(length)),
        )
        reference |= {f"pin_{i}": -pi / 2, f"top_{i}": pi / 2}
    return Mechanism(
        name=f"{loops}-four-bar",
        gravity=(0.0, -9.81, 0.0),
        bodies=bodies,
        joints=joints,
        actuators=("pivot_0",),
        tools={"tip": Tool(body="crank_0", frame=Frame.planar(length))},
        reference=reference,
    )
