"""Draw the pictures of the README and of the catalogue's page: python docs/images.py"""

import re
from pathlib import Path

from linkwork import Robot, robots
from linkwork.views import plot_mechanism
from linkwork.views.overlays import summary_figure
from linkwork.views.reproduction import robot_figure, study
from linkwork.views.style import svg

FOLDER = Path(__file__).parent / "images"
CATALOGUE = FOLDER / "catalogue"


def main() -> None:
    """Write all pictures."""
    comparison = study()
    for name, figure in {"reproduction": summary_figure(comparison), "prr3": robot_figure(comparison)}.items():
        (FOLDER / f"{name}.svg").write_text(svg(figure), encoding="utf-8")
    CATALOGUE.mkdir(exist_ok=True)
    for name in robots.__all__:
        (CATALOGUE / f"{name}.svg").write_text(portrait(Robot(getattr(robots, name)())), encoding="utf-8")


def portrait(robot: Robot) -> str:
    """Return a robot in its reference configuration as SVG, its driven joints named; lengths to 1/100 pt."""
    driven = [name for name, joint in robot.mechanism.joints.items() if set(joint.rates(name)) & set(robot.actuators)]
    drawing = svg(plot_mechanism(robot, robot.home, names=driven).figure, cropped=True)
    return re.sub(r' d="[^"]*"', lambda path: re.sub(r"(\.\d\d)\d+", r"\1", path[0]), drawing)


if __name__ == "__main__":
    main()
