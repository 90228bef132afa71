"""What the tool reaches, against closed solutions: areas, volumes, and where legs and platforms
line up."""

from itertools import pairwise

import numpy as np
import pytest

import linkwork as lw
from linkwork.errors import LinkworkError
from linkwork.viewer import Viewer
from linkwork.viewer.reach import reach_of
from linkwork.views.volume import surface

from tests.catalogue import built
from tests.viewer.browser import until


def gantry(limits: float) -> lw.Robot:
    """Return three slides along x, y and z, each between limits [m]."""
    names = ("ground", "x", "y", "z")
    joints = {
        own: lw.PrismaticJoint(
            connects=(before, own),
            axis=tuple(np.eye(3)[k]),
            limits=lw.Limits(lower=-limits, upper=limits),
        )
        for k, (before, own) in enumerate(pairwise(names))
    }
    bodies = {name: lw.Body(mass=1.0) for name in names[1:]}
    tools = {"tip": lw.Tool(body="z", frame=lw.Frame(position=(0.0, 0.0, 0.5)))}
    mechanism = lw.Mechanism(bodies=bodies, joints=joints, actuators=names[1:], tools=tools)
    return lw.Robot(mechanism)


def test_a_gantry_reaches_a_box():
    robot = gantry(0.3)
    found = reach_of(robot, robot.home, 1.0)
    low, high = found.corners.min(axis=0), found.corners.max(axis=0)
    middle = np.array([0, 0, 0.5])
    assert not found.cut and not len(found.singular_triangles)
    assert low == pytest.approx(middle - 0.3, abs=0.03)
    assert high == pytest.approx(middle + 0.3, abs=0.03)


def test_a_five_bar_is_singular_where_its_two_outer_links_line_up():
    robot = built("five_bar")
    found = reach_of(robot, robot.home, 0.6)
    assert not found.cut and len(found.singular_lines) > 50
    middles = found.singular_lines.mean(axis=1)[::10]
    kept = 0
    for x, y, z in middles:
        assert z == 0
        try:
            state = robot.assemble(tool=[x, y], guess=robot.home)
        except LinkworkError:
            continue
        kept += 1
        assert abs(lw.analysis.singularity(robot, state).actuator) < 0.05
    assert kept > len(middles) / 2


@pytest.mark.long
def test_singular_faces_of_a_delta_lie_between_poses_of_both_signs():
    robot = built("delta")
    found = reach_of(robot, robot.home, 1.2)
    centres = found.singular_corners.reshape(-1, 4, 3).mean(axis=1)
    assert 50 < len(centres) < 2000
    assert found.triangles.max() == len(found.corners) - 1


def test_a_tool_that_is_led_by_angles_shows_no_reach():
    robot = built("agile_wrist")
    with pytest.raises(LinkworkError, match="two or three of x, y, z"):
        reach_of(robot, robot.home, 1.0)


def test_a_surface_tells_what_lies_beyond_it():
    inside = np.zeros((4, 3, 3), bool)
    inside[1:, 1, 1] = True
    found = surface(inside, [np.arange(4.0), np.arange(3.0), np.arange(3.0)])
    ways = found.beyond - found.points
    assert (np.abs(ways).sum(axis=1) == 1).all() and len(ways) == 14
    assert inside[tuple(found.points.T)].all()
    assert [4, 1, 1] in found.beyond.tolist() and [0, 1, 1] in found.beyond.tolist()


def test_the_page_shows_it_and_hides_it():
    with Viewer(built("five_bar")) as viewer:
        viewer.show_reach()
        until(lambda: len(viewer.stage.reach) == 2 and not viewer.busy)
        assert viewer.session.notice == ""
        viewer.hide_reach()
        until(lambda: not viewer.stage.reach)
