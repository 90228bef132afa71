"""Runs with numbers of their own, as pictures, scenes and the viewer show them."""

from __future__ import annotations

import numpy as np
import pytest

import linkwork as lw
from linkwork.analysis import along
from linkwork.scene.colours import BLUE
from linkwork.viewer.session import Session
from linkwork.views import plot_motion, run_report, write_gltf, write_report, write_video
from linkwork.views.gltf import keys_of

from tests.views.test_gltf import Reader

LENGTHS = {"hinge_2.frames.0.position.x": 2.0, "mass.frame.position.x": 0.3}


@pytest.fixture(scope="module")
def robot():
    return lw.Robot("double_pendulum").free(*LENGTHS, "rod_1.mass")


def moved(robot: lw.Robot, **parameters: float) -> lw.Run:
    return robot.simulate(robot.home, duration=0.3, samples=7, parameters=parameters)


@pytest.fixture(scope="module")
def longer(robot):
    return moved(robot, **LENGTHS)


def test_what_is_drawn_has_the_numbers_of_the_run(robot, longer, tmp_path, monkeypatch):
    """The path of the tool is what the run tells of it, in pictures and scenes; a report is of the
    robot with these numbers."""
    told = longer.smooth["tool_pose"].values[:, :2]
    axes = plot_motion(robot, longer)
    path = [line for line in axes.lines if line.get_color() == BLUE][-1]
    np.testing.assert_allclose(path.get_xydata(), told, atol=1e-9)
    own = robot.with_parameters(LENGTHS)
    files = [write_gltf(each, longer, tmp_path / "x.glb").read_bytes() for each in (robot, own)]
    assert files[0] == files[1]
    read = Reader(tmp_path / "x.glb")
    mesh = read.nodes[read.names["path of the tool"]]["mesh"]
    places = read.told["meshes"][mesh]["primitives"][0]["attributes"]["POSITION"]
    chosen = [np.argmin(abs(longer.smooth.time - t)) for t in keys_of(own, longer, 30.0)[0]]
    np.testing.assert_allclose(read.numbers(places)[:, :2], told[chosen], atol=1e-6)
    monkeypatch.setattr(run_report, "render", lambda robot, *_: f"{robot.parameters}")
    page = write_report(robot, longer, tmp_path / "x.html")
    assert page.read_text() == f"{own.parameters}"


def test_runs_of_other_lengths_are_not_laid_over_each_other(robot, longer, tmp_path):
    """Those of other masses are, for they are seen alike."""
    plain, heavier = moved(robot), moved(robot, **{"rod_1.mass": 3.0})
    write_video(robot, plain, tmp_path / "x.gif", over=heavier)
    said = "other lengths than the robot that is shown"
    for run, over in ((plain, longer), (longer, plain)):
        with pytest.raises(lw.LinkworkError, match=said):
            write_video(robot, run, tmp_path / "x.gif", over=over)
        with pytest.raises(lw.LinkworkError, match=said):
            write_report(robot, run, tmp_path / "x.html", over=over)
    session = Session(robot)
    session.load(heavier)
    with pytest.raises(lw.LinkworkError, match=said):
        session.lay_over(longer)


def test_runs_of_other_numbers_that_are_not_free_are_shown_with_them(robot, longer, tmp_path):
    files = [
        write_gltf(each, longer, tmp_path / "x.glb").read_bytes()
        for each in (lw.Robot("double_pendulum"), robot)
    ]
    assert files[0] == files[1]


def test_runs_whose_loops_close_with_their_own_lengths_alone_are_shown_and_measured():
    robot = lw.Robot("prr3").free("wrist_1.frames.0.position.x")
    name, value = next(iter(robot.parameters.items()))
    other = robot.with_parameters({name: value + 0.02})
    run = robot.simulate(other.home, duration=0.1, samples=5, parameters=other.parameters)
    plot_motion(robot, run)
    found, meant = along(robot, run), along(other, run)
    np.testing.assert_array_equal(found["conditioning"].values, meant["conditioning"].values)
