"""Pictures of motions: poses at equal distances, paths of tools, phase portraits; and what is
refused."""

import io

import matplotlib
import numpy as np
import pytest

import linkwork as lw
from linkwork.lab.precision import plot_work_precision
from linkwork.scene.colours import BLUE
from linkwork.views import plot_motion, plot_phase, plot_run, save_figure
from linkwork.views.motion import spaced
from linkwork.views.space import on_screen
from linkwork.views.style import styled, svg

from tests.catalogue import built


@pytest.fixture(scope="module")
def swing():
    """Return a pendulum's run from 0.5 rad above the horizontal, at rest."""
    robot = built("pendulum")
    return robot.simulate(robot.state([0.5]), duration=1.0, save_at=np.linspace(0, 1, 101))


def test_poses_are_at_equal_distances_with_the_first_and_the_last():
    robot = built("prr3")
    s = np.linspace(0, 1, 101) ** 3  # slow at first
    states = robot.assemble(
        tool=np.column_stack([0.45 + 0.1 * s, np.full(101, 0.29), np.full(101, 1.2)])
    )
    found = spaced(robot, states, 5)
    np.testing.assert_allclose(s[found], [0, 0.25, 0.5, 0.75, 1.0], atol=0.03)
    assert spaced(robot, states, 1).tolist() == [100]


def test_the_tools_path_is_drawn(run, robot):
    axes = plot_motion(robot, run)
    path = [line for line in axes.lines if line.get_color() == BLUE][-1]
    told = run.variables["tool_pose"].values[:, :2]
    np.testing.assert_allclose(path.get_xydata(), told, atol=1e-12)
    assert not [
        line for line in plot_motion(robot, run, path=False).lines if line.get_color() == BLUE
    ]


def test_runs_motions_and_stacks_are_drawn_alike(robot):
    motion = robot.follow(lw.paths.circle([0.5, 0.29], 0.03, 1.2), 0.5, samples=41)
    assert svg(plot_motion(robot, motion).figure) == svg(plot_motion(robot, motion.state).figure)


def test_spatial_motions_are_drawn_in_space():
    robot = built("stewart")
    run = robot.simulate(robot.home, duration=0.1, save_at=np.linspace(0, 0.1, 5))
    assert hasattr(plot_motion(robot, run, poses=2), "get_zlim")


def test_a_path_that_leads_beyond_the_poses_is_within_the_picture():
    """One pose is drawn of an arm that goes all the way round."""
    robot = built("puma560")
    around = {"joint_1": np.linspace(0, 2 * np.pi, 41)}
    states = robot.assemble(around | {n: robot.home[n] for n in robot.coordinates[1:]})
    axes = plot_motion(robot, states, poses=1)
    low, high = np.transpose([axes.get_xlim(), axes.get_ylim(), axes.get_zlim()])
    places = robot.tool_pose(states)[:, :3]
    assert (low < places + 1e-9).all() and (places < high + 1e-9).all()
    seen, box = on_screen(axes, places), axes.figure.bbox
    assert (seen > box.min).all() and (seen < box.max).all()


def test_a_run_of_few_steps_is_drawn_with_a_smooth_path():
    robot = built("five_bar")
    run = robot.simulate(robot.home, [0.3, 0.2], duration=0.5)
    x, y = plot_motion(robot, run).lines[-1].get_data()
    assert len(run.time) < 20 < len(x)
    bends = np.abs(np.diff(np.unwrap(np.arctan2(np.diff(y), np.diff(x)))))[5:]
    assert bends.max() < 0.02


def test_a_run_of_one_sample_is_drawn_and_an_empty_one_refused(robot):
    one = robot.simulate(robot.home, duration=0.01, save_at=[0.01])
    plot_motion(robot, one)
    assert plot_run(one, "tool_pose").axes[0].lines[0].get_marker() == "o"
    svg(plot_phase(one))
    with pytest.raises(lw.LinkworkError, match="the run holds no sample"):
        plot_motion(robot, robot.simulate(robot.home, duration=0.01, save_at=[]))


def test_runs_of_other_robots_and_single_states_are_refused(run, robot):
    with pytest.raises(
        lw.LinkworkError,
        match=r"the run is not one of the robot 'five-bar.*': it has the joint 'slide_1'",
    ):
        plot_motion(built("five_bar"), run)
    longer = lw.Robot(lw.robots.prr3(l1=0.4))
    with pytest.raises(lw.LinkworkError, match="the run is not one of the robot '3-PRR'"):
        plot_motion(longer, run)
    with pytest.raises(lw.LinkworkError, match="is no motion"):
        plot_motion(robot, robot.home)
    with pytest.raises(lw.LinkworkError, match="poses is 0"):
        plot_motion(robot, run, poses=0)


def test_phase_portraits_hold_energy(swing):
    axes = plot_phase(swing).axes[0]
    angle, rate = axes.lines[0].get_data()
    length = 1.0  # of the pendulum, a point mass: rate^2 / 2 + g sin(angle) / l is constant
    energy = rate**2 / 2 + 9.81 * np.sin(angle) / length
    np.testing.assert_allclose(energy, energy[0], atol=1e-6)
    assert np.ptp(rate) > 1
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("position [rad]", "rate [rad/s]")


def test_a_phase_portrait_of_few_steps_is_drawn_between_them():
    arm = built("pendulum")
    run = arm.simulate(arm.home, duration=2.0)
    angle, rate = plot_phase(run).axes[0].lines[0].get_data()
    energy = rate**2 / 2 + 9.81 * np.sin(angle)
    assert len(run.time) < 100 < 500 < len(angle)
    np.testing.assert_allclose(energy, energy[0], atol=1e-6)
    assert angle[-1] == run["joint_position"][-1, 0]


def test_phase_portraits_of_several_runs_and_of_named_coordinates(run):
    figure = plot_phase([run, run], ["slide_2", "wrist_1"])
    assert [axes.get_title(loc="left") for axes in figure.axes] == ["slide_2", "wrist_1"]
    assert [axes.get_xlabel() for axes in figure.axes] == ["position [m]", "position [rad]"]
    assert [axes.get_title(loc="left") for axes in plot_phase(run).axes] == [
        "slide_1",
        "slide_2",
        "slide_3",
    ]
    with pytest.raises(lw.LinkworkError, match="holds no coordinate 'slide_9'"):
        plot_phase(run, "slide_9")
    with pytest.raises(lw.LinkworkError, match="there is no run"):
        plot_phase([])


def test_work_precision_diagrams_hold_the_numbers_given():
    curves = {
        "order 4": ([1, 2, 4], [1e-4, 6e-6, 4e-7], [0, 1e-12, 1e-13]),
        "order 5": ([1, 3], [1e-5, 0]),
    }
    figure = plot_work_precision(curves, unit="m", work="steps")
    errors, closure = figure.axes
    np.testing.assert_array_equal(errors.lines[0].get_xydata(), np.transpose(curves["order 4"][:2]))
    assert (errors.get_xscale(), errors.get_yscale(), errors.get_ylabel()) == (
        "log",
        "log",
        "error [m]",
    )
    assert closure.get_ylabel() == "closure error [m]" and len(closure.lines) == 1
    assert (
        errors.lines[1].get_ydata()[1] > 0
    )  # an error of zero has no logarithm; it is drawn at the bottom
    with pytest.raises(lw.LinkworkError, match="the curve 'a' is no pair"):
        plot_work_precision({"a": ([1, 2], [1])})
    with pytest.raises(lw.LinkworkError, match="the curve 'a' has work that is not positive"):
        plot_work_precision({"a": ([0, 2], [1, 1])})
    with pytest.raises(lw.LinkworkError, match="there are no curves"):
        plot_work_precision({})


@pytest.mark.sample(2)
@pytest.mark.parametrize("suffix", ["svg", "pdf", "png"])
def test_figures_are_written_the_same_every_time(run, tmp_path, suffix):
    paths = [
        save_figure(plot_run(run, "actuator_force").axes[0], tmp_path / f"{name}.{suffix}")
        for name in "ab"
    ]
    first, second = (path.read_bytes() for path in paths)
    assert first == second and len(first) > 1000


@pytest.mark.sample(1)
@pytest.mark.parametrize("settings", [{}, {"savefig.facecolor": "#ffe0e0"}])
def test_svg_is_what_savefig_writes(run, settings):
    """Drawn once instead of twice, where no setting of the user asks for more."""
    buffer, nothing = io.StringIO(), dict.fromkeys(("Date", "Creator", "Format", "Type"))
    with matplotlib.rc_context(settings):
        one, other = (plot_run(run, ["tool_pose", "actuator_force"]) for _ in range(2))
        with styled():
            one.savefig(buffer, format="svg", metadata=nothing)
        canvas, dpi = other.canvas, other.dpi
        assert svg(other) == buffer.getvalue()
    assert ("#ffe0e0" in buffer.getvalue()) == bool(settings)
    assert (other.canvas, other.dpi) == (canvas, dpi)


def test_figures_that_cannot_be_written_are_refused(run, tmp_path):
    figure = plot_run(run, "actuator_force")
    with pytest.raises(
        lw.LinkworkError, match=r"a figure is written as .svg, .pdf or .png, not as 'x.bmp'"
    ):
        save_figure(figure, tmp_path / "x.bmp")
    with pytest.raises(lw.LinkworkError, match="cannot be written: no such file or directory"):
        save_figure(figure, tmp_path / "no" / "x.svg")


def test_measures_along_a_motion_are_drawn_like_runs(run, robot):
    from linkwork import analysis

    figure = plot_run(analysis.along(robot, run))
    assert [axes.get_ylabel().split("\n")[0] for axes in figure.axes[:2]] == ["det A", "det B"]
