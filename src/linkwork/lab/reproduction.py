"""The paper's study of the 3-PRR robot again: a prescribed motion, its forces, and the motion back
from the forces.

    platform's centre    x = x_c + R (cos phi, sin phi),   phi = -pi/2 + 2 pi s(t)
    platform's angle     theta = theta_c + A sin(2 pi s(t))
    motion law           s = 35 tau^4 - 84 tau^5 + 70 tau^6 - 20 tau^7,   tau = t / T

Independent engines stand in for the paper's multibody program. Source: the paper, section 4,
figures 4-7; the paper gives its motion as a picture only, so this one is chosen.
"""

from __future__ import annotations

import platform
from importlib.metadata import version
from inspect import signature
from math import pi, sqrt
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from linkwork import paths
from linkwork.lab import engines, overlays
from linkwork.lab.comparison import (
    NOC,
    PRESCRIBED,
    RTOL,
    TITLES,
    Comparison,
    Curve,
    compare,
    largest_differences,
)
from linkwork.mechanism import Mechanism
from linkwork.robot import Motion, Robot, State
from linkwork.robots import prr3
from linkwork.scene.colours import BLUE
from linkwork.views.drawing import plot_mechanism
from linkwork.views.film import film
from linkwork.views.pages import PageTable, duration, page, picture, short
from linkwork.views.style import new_figure, styled, svg

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CENTRE = (0.5, sqrt(3) / 6)  # x_c, the middle of the base triangle [m]
RADIUS = 0.08  # R [m]
ANGLE, SWING = pi / 2, 0.3  # theta_c, A [rad]
DURATION = 1.0  # T [s]
SAMPLES = 4001
POSES = 6
ORDER = ("exudyn", "pinocchio", "mujoco")
CAPTIONS = {
    "robot": "The robot along its motion, the latest pose in full. Orange: the actuated "
    "sliders; the arrows are the axes of the platform's frame.",
    "figure-4-forces": "Figure 4. Forces of the three actuators that make the platform follow "
    "the prescribed motion, by inverse dynamics.",
    "figure-5-path": "Figure 5. Path of the platform's centre under these forces (left; the dot "
    "marks where it starts and ends), and how far the other results are from "
    "Linkwork's over time (right).",
    "figure-6-accelerations": "Figure 6. Accelerations of the actuated joints under these "
    "forces, and the differences from Linkwork's result.",
    "figure-7-positions": "Figure 7. Positions of the actuated joints under these forces, and "
    "the differences from Linkwork's result.",
}
METHODS = {
    NOC: (
        f"independent coordinates, Dormand–Prince 5(4) at rtol {short(RTOL, 1)}, loops closed by "
        "projection"
    ),
    "exudyn": "all bodies free, joints by multipliers, generalised-α of order 2",
    "pinocchio": "spanning tree, loops by multipliers, Runge–Kutta of order 4",
    "mujoco": "spanning tree, loops by soft constraints made stiff, Runge–Kutta of order 4",
}


def study() -> Comparison:
    """Carry out the study: the motion, the forces, and the motion again by Linkwork and by all
    installed engines."""
    robot, installed = Robot(prr3()), engines.available()
    return compare(robot, prescribed_motion(robot), [name for name in ORDER if name in installed])


def absent(comparison: Comparison) -> dict[str, str]:
    """Return why an engine is not shown, by its title."""
    shown = {curve.source for curve in comparison.engines}
    reason = "not installed; pip install 'linkwork[engines]' adds it"
    return {
        TITLES[name]: comparison.failures.get(name, reason) for name in ORDER if name not in shown
    }


def prescribed_motion(robot: Robot, samples: int = SAMPLES) -> Motion:
    """Lead the platform once around the circle while its angle swings, from rest to rest."""
    circle = paths.circle(CENTRE, RADIUS, start=-pi / 2)
    start = robot.assemble(tool=[CENTRE[0], CENTRE[1] - RADIUS, ANGLE])
    return robot.follow(
        paths.together(circle, paths.swing(ANGLE, SWING)), DURATION, samples=samples, guess=start
    )


def figures(comparison: Comparison) -> dict[str, Figure]:
    """Draw the figures of the study by name, numbered as in the paper."""
    return {
        "robot": robot_figure(comparison),
        "figure-4-forces": overlays.forces_figure(comparison),
        "figure-5-path": overlays.path_figure(comparison),
        "figure-6-accelerations": overlays.series_figure(
            comparison, "accelerations", "acceleration", "m/s²", "rad/s²"
        ),
        "figure-7-positions": overlays.series_figure(
            comparison, "positions", "position", "m", "rad"
        ),
    }


def robot_figure(comparison: Comparison) -> Figure:
    """Draw the robot in poses along its motion, and the path of its tool."""
    path = comparison[PRESCRIBED].tool[:, :2]
    with styled():
        figure = new_figure(5.4, 5.0)
        axes = figure.subplots()
        plot_mechanism(
            comparison.robot, poses_along(comparison.robot, comparison[PRESCRIBED]), axes
        )
        axes.plot(*path[:: overlays.POINTS // 50].T, color="white", lw=3, zorder=5)
        axes.plot(*path[:: overlays.POINTS // 50].T, color=BLUE, lw=1.3, zorder=5)
    return figure


def poses_along(robot: Robot, curve: Curve) -> State:
    """Return states at equal distances along the first two thirds of the tool's path."""
    way = np.concatenate(
        [[0], np.cumsum(np.linalg.norm(np.diff(curve.tool[:, :2], axis=0), axis=1))]
    )
    places = np.searchsorted(way, np.linspace(0, 2 / 3, POSES) * way[-1])
    return robot.state(curve.positions[places])


def write(comparison: Comparison, folder: Path) -> list[Path]:
    """Write report.html, reproduction.nc and the figures into a folder, which is made; return their
    paths."""
    folder.mkdir(parents=True, exist_ok=True)
    drawn = {name: svg(figure) for name, figure in figures(comparison).items()}
    report, data = folder / "report.html", folder / "reproduction.nc"
    report.write_text(render(comparison, drawn), encoding="utf-8")
    comparison.dataset.to_netcdf(data, engine="scipy")
    pictures = [folder / f"{name}.svg" for name in drawn]
    for path, drawing in zip(pictures, drawn.values(), strict=True):
        path.write_text(drawing, encoding="utf-8")
    return [report, data, *pictures]


def render(comparison: Comparison, drawn: dict[str, str]) -> str:
    """Return the report as a page; `drawn` holds the figures as SVG by name."""
    # How far the direct dynamics lead from the motion that the forces were found for.
    robot, noc = comparison.robot, comparison[NOC]
    returned = largest_differences(robot, noc, comparison[PRESCRIBED])
    # What the template names: the equations, pictures and film, tables, and what was asked for.
    return page(
        "reproduction.html",
        package="linkwork.lab",
        name=robot.mechanism.name,
        robot=robot,
        equations=robot.equations,
        operations=robot.kernel("motion").operations,
        pictures={name: picture(name, CAPTIONS[name], drawing) for name, drawing in drawn.items()},
        film=film(robot, comparison.time, robot.state(noc.positions)),
        bodies=bodies_table(robot.mechanism),
        differences=differences_table(comparison),
        runs=runs_table(comparison),
        engines=comparison.engines,
        absent=absent(comparison),
        tool_difference={
            curve.source: largest_differences(robot, curve, noc)["tool", "m"]
            for curve in comparison.engines
        },
        returned=returned["tool", "m"],
        forces=np.abs(comparison.forces).max(axis=0),
        spline_error=comparison.spline_error.max(),
        noc=noc,
        wall_time=duration(noc.seconds),
        samples=len(comparison.time),
        lengths={name: parameter.default for name, parameter in signature(prr3).parameters.items()},
        motion={
            "x": CENTRE[0],
            "y": CENTRE[1],
            "R": RADIUS,
            "angle": ANGLE,
            "A": SWING,
            "T": DURATION,
        },
        made_by=f"Linkwork {version('linkwork')}, NumPy {np.__version__}, Python "
        f"{platform.python_version()} on {platform.system()} {platform.machine()}",
    )


def bodies_table(mechanism: Mechanism) -> PageTable:
    """Return masses and inertias; bodies alike share a row."""
    alike: dict[tuple[float, float], list[str]] = {}
    for name, body in mechanism.bodies.items():
        alike.setdefault((body.mass, body.inertia.zz), []).append(name)
    rows = [
        (", ".join(names), short(mass, 6), short(inertia, 4))
        for (mass, inertia), names in alike.items()
    ]
    caption = (
        "Bodies: mass, and moment of inertia about the mass centre (the middle of a link, the "
        "centre of the platform)."
    )
    return PageTable(caption, ("bodies", "mass [kg]", "inertia [kg m²]"), rows)


def differences_table(comparison: Comparison) -> PageTable:
    """Return the largest differences of all sources from Linkwork's forward dynamics."""
    aside = {PRESCRIBED: "Prescribed motion (forward after inverse dynamics)"}
    found = {
        aside.get(curve.source, curve.title): largest_differences(
            comparison.robot, curve, comparison[NOC]
        )
        for curve in comparison.curves
        if curve.source != NOC
    }
    keys = list(next(iter(found.values())))
    rows = [(title, *(short(values[key]) for key in keys)) for title, values in found.items()]
    caption = (
        "Largest differences from Linkwork's forward dynamics over the run. The first row is "
        "how well forward dynamics undoes inverse dynamics; joint positions are those of all "
        "nine joints, accelerations those of the actuated ones."
    )
    return PageTable(
        caption, ("source", *(f"{quantity} [{unit}]" for quantity, unit in keys)), rows
    )


def runs_table(comparison: Comparison) -> PageTable:
    """Return how each source computed the run, what it took and how well its loops stayed
    closed."""
    rows = []
    for curve in comparison.curves[1:]:
        size = short(1e3 * comparison.time[-1] / curve.steps, 3) if curve.steps else "–"
        rows.append(
            (
                f"{curve.title}: {METHODS[curve.source]}",
                f"{curve.steps:,}",
                size,
                duration(curve.seconds),
                short(curve.closure_error),
            )
        )
    caption = (
        "The runs. The largest gap of any loop is the closure error. Times are of this machine: "
        "Linkwork's from call to result, the engines' of the integration alone, with the calls "
        "of the function that gives them the forces."
    )
    return PageTable(
        caption, ("run", "steps", "mean step [ms]", "wall time", "closure error [m]"), rows
    )


def summary(comparison: Comparison) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Return a short table for the terminal: differences from Linkwork in positions, accelerations
    and path."""
    rows = []
    for curve in comparison.curves:
        values = largest_differences(comparison.robot, curve, comparison[NOC])
        shown = (values["joint position", "m"], values["acceleration", "m/s²"], values["tool", "m"])
        entries = ["–"] * 3 if curve.source == NOC else [short(value) for value in shown]
        rows.append((curve.title, *entries, short(curve.closure_error), duration(curve.seconds)))
    return ("source", "slides [m]", "accel. [m/s²]", "path [m]", "closure [m]", "time"), rows
