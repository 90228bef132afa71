"""Exact equations of motion of mechanisms with closed loops, compiled to machine code.

    import linkwork as lw

    robot = lw.Robot(lw.robots.prr3())
    run = robot.simulate(robot.home, [5.0, 0.0, 0.0], duration=1.0)

Every name below is imported when it is first used, so that `import linkwork` costs next to nothing.
"""

from importlib import import_module
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from linkwork import (
        analysis,
        control,
        design,
        equations,
        export,
        formats,
        gym,
        jax,
        kernels,
        lab,
        math,
        mechanism,
        motions,
        paths,
        robots,
        simulation,
        sweeps,
        views,
    )
    from linkwork.errors import LinkworkError
    from linkwork.mechanism import (
        Body,
        Box,
        Bristle,
        Capsule,
        Combination,
        Contact,
        Cylinder,
        CylindricalJoint,
        Displacement,
        DistanceTo,
        Ellipsoid,
        FixedJoint,
        Frame,
        FreeJoint,
        Friction,
        GearJoint,
        GearTeeth,
        HeightField,
        Inertia,
        JournalBearing,
        Limits,
        Mechanism,
        MechanismError,
        MeshFile,
        PlanarJoint,
        Plane,
        Points,
        PointSpring,
        Polygon,
        PrismaticJoint,
        RevoluteJoint,
        RodJoint,
        ScrewJoint,
        SlackSpring,
        SliderCrank,
        Sliding,
        SlidingBearing,
        Sphere,
        SphericalJoint,
        Spring,
        Stop,
        Thrust,
        Tool,
        TurnAbout,
        UniversalJoint,
    )
    from linkwork.robot import (
        Ensemble,
        Motion,
        Reactions,
        Robot,
        SingularError,
        State,
        UnreachableError,
    )
    from linkwork.simulation import Run, Sampled, Signal, Status

    __version__: str

__all__ = [
    "Body",
    "Box",
    "Bristle",
    "Capsule",
    "Combination",
    "Contact",
    "Cylinder",
    "CylindricalJoint",
    "Displacement",
    "DistanceTo",
    "Ellipsoid",
    "Ensemble",
    "FixedJoint",
    "Frame",
    "FreeJoint",
    "Friction",
    "GearJoint",
    "GearTeeth",
    "HeightField",
    "Inertia",
    "JournalBearing",
    "Limits",
    "LinkworkError",
    "Mechanism",
    "MechanismError",
    "MeshFile",
    "Motion",
    "PlanarJoint",
    "Plane",
    "PointSpring",
    "Points",
    "Polygon",
    "PrismaticJoint",
    "Reactions",
    "RevoluteJoint",
    "Robot",
    "RodJoint",
    "Run",
    "Sampled",
    "ScrewJoint",
    "Signal",
    "SingularError",
    "SlackSpring",
    "SliderCrank",
    "Sliding",
    "SlidingBearing",
    "Sphere",
    "SphericalJoint",
    "Spring",
    "State",
    "Status",
    "Stop",
    "Thrust",
    "Tool",
    "TurnAbout",
    "UniversalJoint",
    "UnreachableError",
    "__version__",
    "analysis",
    "control",
    "design",
    "equations",
    "export",
    "formats",
    "gym",
    "jax",
    "kernels",
    "lab",
    "math",
    "mechanism",
    "motions",
    "paths",
    "robots",
    "simulation",
    "sweeps",
    "views",
]

_HOMES = ("errors", "mechanism", "simulation", "robot")  # of the classes
_MOVED = ("engines", "textbook")  # to `lab`


def __getattr__(name: str) -> Any:
    if name == "__version__":
        value = version("linkwork")
    elif name not in __all__ and name not in _MOVED:
        raise AttributeError(f"module 'linkwork' has no attribute {name!r}")
    elif name[0].isupper():
        homes = (import_module(f"linkwork.{home}") for home in _HOMES)
        value = next(getattr(home, name) for home in homes if hasattr(home, name))
    else:
        value = import_module(f"linkwork.{name}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
