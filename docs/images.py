"""Draw the pictures of the README, of the pages and of the catalogue: python docs/images.py"""

import re
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from linkwork import Robot, analysis, motions, robots
from linkwork.lab.overlays import summary_figure
from linkwork.lab.reproduction import robot_figure, study
from linkwork.views import plot_mechanism, plot_timed_path, plot_workspace, save_figure
from linkwork.views.style import svg

FOLDER = Path(__file__).parent / "images"
CATALOGUE = FOLDER / "catalogue"


def main() -> None:
    """Write all pictures."""
    comparison = study()
    for name, figure in {
        "reproduction": summary_figure(comparison),
        "prr3": robot_figure(comparison),
    }.items():
        (FOLDER / f"{name}.svg").write_text(svg(figure), encoding="utf-8")
    save_figure(workspace(comparison.robot), FOLDER / "workspace.svg")
    save_figure(singularities(Robot(robots.five_bar())), FOLDER / "singularities.svg")
    save_figure(cycle(Robot(robots.delta())), FOLDER / "cycle.svg")
    CATALOGUE.mkdir(exist_ok=True)
    for name in robots.__all__:
        (CATALOGUE / f"{name}.svg").write_text(
            portrait(Robot(getattr(robots, name)())), encoding="utf-8"
        )


def workspace(robot: Robot) -> Axes:
    """Draw the conditioning of the 3-PRR robot over its workspace, and the robot upon it."""
    angle = np.pi / 2
    grid = {"x": np.linspace(0.2, 0.8, 301), "y": np.linspace(-0.1, 0.5, 301), "angle": angle}
    axes = plot_workspace(analysis.workspace(robot, grid))
    return plot_mechanism(robot, robot.assemble(tool=[0.5, 0.29, angle]), axes)


def singularities(robot: Robot) -> Axes:
    """Draw where the five-bar is actuator-singular, and the robot upon it."""
    grid = {"x": np.linspace(-0.34, 0.64, 393), "y": np.linspace(-0.6, 0.6, 481)}
    return plot_mechanism(
        robot, robot.home, plot_workspace(analysis.workspace(robot, grid), "det_A")
    )


def cycle(robot: Robot) -> Figure:
    """Draw a pick-and-place cycle of the Delta robot over time."""
    x, y, z = robot.tool_pose(robot.home)[:3]
    limits = motions.AxisLimits(speed=1.5, acceleration=30.0, jerk=1500.0)
    ends = [x - 0.12, y, z - 0.03], [x + 0.12, y, z - 0.03]
    return plot_timed_path(motions.pick_and_place(*ends, [0, 0, 0.06], limits, blend=0.4), robot)


def portrait(robot: Robot) -> str:
    """Return a robot in its reference configuration as SVG, its driven joints named; lengths to
    1/100 pt, no point twice."""
    driven = [
        name
        for name, joint in robot.mechanism.joints.items()
        if set(joint.rates(name)) & set(robot.actuators)
    ]
    drawing = rounded(svg(plot_mechanism(robot, robot.home, names=driven).figure, cropped=True))
    return shared(re.sub(r"(L [^\n]+\n)\1+", r"\1", drawing))


def rounded(drawing: str) -> str:
    """Return an SVG with the lengths of its lines to 1/100 pt."""
    return re.sub(r' d="[^"]*"', lambda path: re.sub(r"(\.\d\d)\d+", r"\1", path[0]), drawing)


def shared(drawing: str) -> str:
    """Return an SVG in which each style stands once, as a class."""
    classes = {
        style: f"s{k}"
        for k, style in enumerate(dict.fromkeys(re.findall(r' style="([^"]*)"', drawing)))
    }
    rules = "\n".join(f".{name} {{{style}}}" for style, name in classes.items())
    drawing = re.sub(r' style="([^"]*)"', lambda style: f' class="{classes[style[1]]}"', drawing)
    return drawing.replace("<defs>", f"<defs>\n<style>\n{rules}\n</style>", 1)


if __name__ == "__main__":
    main()
