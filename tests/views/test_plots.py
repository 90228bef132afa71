"""Plots of runs: what is drawn, with which units, and the same bytes every time."""

import re

import numpy as np
import pytest
import xarray

import linkwork as lw
from linkwork.views import plot_phase, plot_run
from linkwork.views.plots import WIDTH
from linkwork.views.style import COLOURS, svg

from tests.catalogue import built


def units(figure):
    return [re.search(r"\[(.*)\]", axes.get_ylabel())[1] for axes in figure.axes]


def test_every_axis_has_a_unit_and_lengths_are_apart_from_angles(run):
    figure = plot_run(run)
    assert units(figure) == ["m", "rad", "m", "rad", "m/s", "rad/s", "N"]
    assert figure.axes[-1].get_xlabel() == "time [s]"


def test_curves_are_the_runs_numbers_by_name(run):
    axes = plot_run(run, ["joint_position"]).axes[1]
    names = [line.get_label() for line in axes.lines]
    assert names == ["pivot_1", "pivot_2", "pivot_3", "wrist_1", "wrist_2", "wrist_3"]
    for name, line in zip(names, axes.lines, strict=True):
        np.testing.assert_array_equal(
            line.get_ydata(), run.dataset["joint_position"].sel(coordinate=name)
        )
        np.testing.assert_array_equal(line.get_xdata(), run.dataset["time"])


def test_torques_and_scalars_have_their_own_units(arm):
    run = arm.simulate(arm.home, [4.0, 1.0], duration=0.1)
    assert units(plot_run(run, ["actuator_force", "kinetic_energy", "joint_acceleration"])) == [
        "N m",
        "J",
        "rad/s^2",
    ]


def test_joints_of_many_freedoms_have_units_of_lengths_angles_and_quaternions():
    robot = built("spatial_slider_crank")
    run = robot.simulate(robot.home, [1.0], duration=0.02)
    figure = plot_run(run, ["joint_position", "joint_rate", "joint_acceleration", "actuator_force"])
    assert units(figure) == ["rad", "m", "1", "rad/s", "m/s", "rad/s^2", "m/s^2", "N m"]
    assert [line.get_label() for line in figure.axes[2].lines] == [
        "ball.qw",
        "ball.qx",
        "ball.qy",
        "ball.qz",
    ]
    assert [line.get_label() for line in figure.axes[3].lines][-3:] == [
        "ball.wx",
        "ball.wy",
        "ball.wz",
    ]


def test_one_quantity_may_be_named_by_itself(run):
    assert units(plot_run(run, "joint_rate")) == units(plot_run(run, ["joint_rate"]))
    assert units(run.plot("tool_pose")) == ["m", "rad"]
    with pytest.raises(lw.LinkworkError, match="the run holds no 'heat' over time"):
        plot_run(run, "heat")


def test_a_run_of_which_nothing_was_saved_is_drawn_empty(robot):
    run = robot.simulate(robot.home, duration=0.01, save_at=[])
    figure = plot_run(run)
    assert len(figure.axes) == 7
    assert all(line.get_xydata().shape == (0, 2) for axes in figure.axes for line in axes.lines)
    svg(figure)


def test_many_names_widen_the_figure(robot):
    run = built("stewart").simulate(built("stewart").home, duration=0.001, save_at=[0, 0.001])
    figure = plot_run(run, "joint_position")
    svg(figure)
    assert min(axes.get_position().width * figure.get_figwidth() for axes in figure.axes) > 4.0
    assert plot_run(run, "actuator_force").get_figwidth() == WIDTH


def test_quantities_that_the_run_does_not_hold_are_refused(run):
    with pytest.raises(
        lw.LinkworkError, match="the run holds no 'heat' over time; it holds joint_position"
    ):
        plot_run(run, ["heat"])
    with pytest.raises(lw.LinkworkError, match="there is nothing to draw"):
        plot_run(run, [])


def test_svg_is_the_same_every_time_and_keeps_text_as_text(run):
    first, second = (svg(plot_run(run, ["actuator_force"])) for _ in range(2))
    assert first == second
    assert ">slide_1</text>" in first
    assert "<metadata" not in first
    assert "http" not in first.replace("http://www.w3.org/", "")


def luminance(colour):
    """Return the relative luminance of a colour (WCAG 2)."""
    parts = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts]
    return float(np.dot([0.2126, 0.7152, 0.0722], linear))


def test_colours_stand_out_from_white():
    assert len(set(COLOURS)) == len(COLOURS)
    assert all(1.05 / (luminance(colour) + 0.05) > 2 for colour in COLOURS)


def test_a_run_that_was_written_and_read_again_is_drawn_alike(run, tmp_path):
    run.save(tmp_path / "run.nc")
    again = lw.Run.load(tmp_path / "run.nc")
    assert isinstance(again.dataset, xarray.Dataset)
    assert svg(plot_run(again)) == svg(plot_run(run))


def resting(scale=1.0):
    """Return the dataset of a pendulum that hangs still but for rounding, from a start of its own
    size."""
    noise = 1e-16 * np.random.default_rng(3).standard_normal((50, 1))
    time = np.linspace(0.0, 2.0, 50)
    axes = {"coordinate": ["slide"], "rate": ["slide"]}
    kind = {"unit_of_each": "m"}
    data = xarray.Dataset(
        {
            "joint_position": (("time", "coordinate"), scale * (0.15951 + noise), {"units": "m"}),
            "joint_rate": (("time", "rate"), scale * noise, {"units": "m/s"}),
        },
        {"time": time, **axes},
    )
    data["coordinate"].attrs, data["rate"].attrs = kind, {"unit_of_each": "m/s"}
    return data


@pytest.mark.parametrize("scale", [1.0, 1e-9, 1e6])
def test_rounding_is_no_motion(scale):
    """Joints at rest are seen at rest, whatever the size of the robot; a motion that is 1e-8 of it
    is seen."""
    data = resting(scale)
    position, rate = plot_run(data, ["joint_position", "joint_rate"]).axes
    for axes, middle, size in ((position, 0.15951, 0.15951), (rate, 0.0, 0.15951 / 2)):
        low, high = axes.get_ylim()
        assert (low + high) / 2 == pytest.approx(scale * middle, abs=1e-12 * scale)
        assert high - low == pytest.approx(0.1 * size * scale, rel=1e-6)
    data["joint_rate"].values[:, 0] = 1e-9 * scale * np.sin(data["time"].values)
    (rate,) = plot_run(data, ["joint_rate"]).axes
    assert np.ptp(rate.get_ylim()) == pytest.approx(1.1e-9 * scale, rel=0.1)


def test_legends_name_the_lines_by_their_looks_and_no_two_look_alike():
    """A platform on six legs has 33 rates of turns: more than there are colours."""
    hexapod = built("stewart")
    run = hexapod.simulate(hexapod.home, duration=0.02, save_at=np.linspace(0, 0.02, 5))
    for axes in plot_run(run, ["joint_position", "joint_rate"]).axes:
        lines, named = axes.lines, axes.get_legend().legend_handles
        looks = [look_of(line) for line in lines]
        assert looks == [look_of(handle) for handle in named]
        assert len(set(looks)) == len(lines)
        texts = [text.get_text() for text in axes.get_legend().texts]
        assert texts == [line.get_label() for line in lines]


def look_of(line) -> tuple:
    return line.get_color(), str(line._unscaled_dash_pattern), line.get_marker()


def test_runs_of_a_phase_portrait_are_named():
    arm = built("pendulum")
    runs = [arm.simulate(arm.home, duration=d) for d in (0.1, 0.2)]
    (legend,) = plot_phase(runs).legends
    assert [text.get_text() for text in legend.texts] == ["run 1", "run 2"]
    assert not plot_phase(runs[0]).legends
