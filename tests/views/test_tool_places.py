"""Pictures of tools whose pose is told relative to a moving body: their path is where they are."""

import numpy as np
import pytest

import linkwork as lw
from linkwork.views import plot_motion
from linkwork.views.film import film


@pytest.fixture(scope="module")
def led():
    """Return an arm of two links of 0.5 m and 0.4 m, states along a motion, and the tip's places
    (K, 2)."""
    link = lw.Body(mass=1.0, centre_of_mass=(0.2, 0, 0), inertia=lw.Inertia(zz=0.02))
    elbow = lw.Frame(position=(0.5, 0, 0)), lw.Frame()
    tip = lw.Tool(body="fore", frame=lw.Frame(position=(0.4, 0, 0)), relative_to="upper")
    robot = lw.Robot(
        lw.Mechanism(
            bodies={"upper": link, "fore": link},
            joints={
                "shoulder": lw.RevoluteJoint(connects=("ground", "upper")),
                "elbow": lw.RevoluteJoint(connects=("upper", "fore"), frames=elbow),
            },
            actuators=("shoulder", "elbow"),
            tools={"tip": tip},
        )
    )
    a, b = np.linspace(0.2, 1.4, 21), np.linspace(0.5, -0.3, 21)
    places = np.stack(
        [0.5 * np.cos(a) + 0.4 * np.cos(a + b), 0.5 * np.sin(a) + 0.4 * np.sin(a + b)], axis=1
    )
    return robot, robot.assemble({"shoulder": a, "elbow": b}), places


def test_the_path_of_a_film_is_that_of_the_tool_in_the_ground(led):
    robot, states, places = led
    fixed = film(robot, np.linspace(0, 1, 21), states).fixed
    path = next(part for part in fixed if part.width == 1.5 and len(part.points) == 21)
    np.testing.assert_allclose(path.points[:, :2], places, atol=1e-12)


def test_the_path_of_a_stroboscopic_picture_is_that_of_the_tool_in_the_ground(led):
    robot, states, places = led
    axes = plot_motion(robot, states)
    drawn = np.asarray(axes.get_lines()[-1].get_xydata())
    np.testing.assert_allclose(drawn, places, atol=1e-12)
