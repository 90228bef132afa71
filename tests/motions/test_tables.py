"""Motions written as tables are read back to the last digit, and bad tables are refused by line."""

import warnings

import numpy as np
import pytest

from linkwork import Body, Inertia, LinkworkError, Mechanism, RevoluteJoint, Robot, motions
from linkwork.errors import ModelWarning
from linkwork.views import plot_timed_path

from tests.catalogue import built
from tests.robot.mixed_freedoms import three_legs

LIMITS = motions.AxisLimits(speed=0.5, acceleration=3.0, jerk=40.0)


@pytest.fixture(scope="module")
def robot():
    return built("prr3")


@pytest.fixture(scope="module")
def timed(robot):
    return motions.point_to_point(robot.home, {"slide_1": 0.2}, LIMITS, law="quintic")


def test_a_timed_path_comes_back_as_it_was(timed, tmp_path):
    """A quintic has the values, rates and accelerations of its samples, so it is found again."""
    again = motions.read_csv(motions.write_csv(tmp_path / "a.csv", timed, samples=11))
    t = np.linspace(0, timed.duration, 301)
    assert again.names == timed.names
    for found, wanted in zip(again.sample(t), timed.sample(t), strict=True):
        assert found == pytest.approx(wanted, abs=1e-11)


def test_a_motion_is_written_with_its_forces(robot, timed, tmp_path):
    motion = motions.follow(robot, timed, samples=41)
    forces = robot.inverse_dynamics(motion)
    path = motions.write_csv(tmp_path / "b.csv", motion, robot, forces=forces)
    header, *rows = path.read_text().splitlines()
    assert header.startswith("time,slide_1,slide_1',slide_1''") and header.endswith(",u slide_3")
    assert float(rows[7].rpartition(",")[2]) == forces.values[7, 2]
    again = motions.read_csv(path, robot.actuators)
    assert motions.follow(robot, again, samples=41).positions == pytest.approx(
        motion.positions, abs=1e-10
    )


def test_values_alone_are_read_as_a_spline_and_with_rates_as_cubics(tmp_path):
    path, t = tmp_path / "c.csv", np.linspace(1, 2, 41)
    path.write_text("time,a\n" + "\n".join(f"{x!r},{x**3!r}" for x in t.tolist()))
    s = np.linspace(0, 1, 77)
    assert motions.read_csv(path).sample(s)[0][:, 0] == pytest.approx((1 + s) ** 3, abs=1e-12)
    rows = [f"{x!r},{x**3!r},{3 * x**2!r}" for x in t[::10].tolist()]
    path.write_text("time,a,a'\n" + "\n\n".join(rows))
    assert motions.read_csv(path).sample(s)[1][:, 0] == pytest.approx(3 * (1 + s) ** 2, abs=1e-12)


def test_an_angle_told_within_one_turn_is_warned_of(tmp_path):
    """The same table with the whole turns, and one of few rows that goes on for more than one, are
    read in silence."""
    t = np.linspace(0, 2, 41)
    ways = {"whole": 2 + 3 * t, "within": (2 + 3 * t + np.pi) % (2 * np.pi) - np.pi}
    for name, way in ways.items():
        rows = zip(t.tolist(), way.tolist(), strict=True)
        (tmp_path / f"{name}.csv").write_text(
            "time,a\n" + "\n".join(f"{x!r},{y!r}" for x, y in rows)
        )
    with pytest.warns(ModelWarning, match=r"a leaps by -6\.133 between 0\.35 s and 0\.4 s") as told:
        motions.read_csv(tmp_path / "within.csv")
    assert [warned.filename for warned in told] == [__file__]
    far = motions.point_to_point({"a": 0.0}, {"a": 6.5}, LIMITS, law="quintic")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        motions.read_csv(tmp_path / "whole.csv")
        for rows in (2, 3, 4, 5, 6, 11):
            motions.read_csv(motions.write_csv(tmp_path / "far.csv", far, samples=rows))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "give a first line"),
        ("t,a\n0,1\n1,2", "'time' among them"),
        ("time,a,a\n0,1,1", "each once"),
        ("time,a\n0,1\n1", "line 3: it has 1 values; give 2"),
        ("time,a\n0,1\n1,x", "line 3: a is 'x'; give a finite number"),
        ("time,a\n0,1\n1,nan", "line 3: a is 'nan'"),
        ("time,a\n0,1", "1 rows of numbers"),
        ("time,a\n0,1\n0,2", "times have to increase"),
        ("time\n0\n1", "no column of a coordinate"),
    ],
)
def test_bad_tables_are_refused(text, said, tmp_path):
    (tmp_path / "bad.csv").write_text(text)
    with pytest.raises(LinkworkError, match=said):
        motions.read_csv(tmp_path / "bad.csv")


def test_names_with_marks_in_them_are_read_and_so_is_a_table_with_remarks(tmp_path):
    text = "# by hand\ntime,blau links,d'Alembert,a,a',u a\n0,1,2,3,0,9\n , ,\n1,2,3,4,0,9\n"
    (tmp_path / "names.csv").write_text(text)
    assert motions.read_csv(tmp_path / "names.csv").names == ("blau links", "d'Alembert", "a")


@pytest.mark.parametrize(("name", "column"), [("time", "time"), ("b'", "b'"), ("u b", "u b")])
def test_joints_that_are_called_like_another_column_are_refused(name, column, tmp_path):
    """One column would take the place of the other."""
    bar = Body(mass=1.0, inertia=Inertia(zz=0.1))
    joints = {
        "b": RevoluteJoint(connects=("ground", "one")),
        name: RevoluteJoint(connects=("one", "two")),
    }
    robot = Robot(Mechanism(bodies={"one": bar, "two": bar}, joints=joints, actuators=("b", name)))
    timed = motions.point_to_point({"b": 0.0, name: 0.0}, {"b": 1.0, name: 2.0}, LIMITS)
    motion = motions.follow(robot, timed, samples=5)
    with pytest.raises(LinkworkError, match=f"would be called [\"']{column}[\"']: a joint has"):
        motions.write_csv(tmp_path / "f.csv", motion, robot, forces=robot.inverse_dynamics(motion))
    assert not (tmp_path / "f.csv").exists()


def test_what_cannot_be_written_is_refused(robot, timed, tmp_path):
    motion = motions.follow(robot, timed, samples=5)
    forces = robot.inverse_dynamics(motions.follow(robot, timed, samples=6))
    pose = motions.point_to_point([0.4, 0.3, 1.2], [0.5, 0.3, 1.2], LIMITS)
    for call, said in (
        (lambda: motions.write_csv(tmp_path / "d.csv", motion), "give robot="),
        (
            lambda: motions.write_csv(tmp_path / "d.csv", motion, robot, forces=forces),
            "at the times",
        ),
        (lambda: motions.write_csv(tmp_path / "d.csv", 3), "what is written is 3"),
        (
            lambda: motions.write_csv(tmp_path / "d.csv", motion, robot, forces=forces.values),
            "the forces are array",
        ),
        (lambda: motions.read_csv(tmp_path / "none.csv", "slide_1"), "give a list of names"),
        (lambda: motions.read_csv(tmp_path / "none.csv", 3), "names is 3; give a list of names"),
        (lambda: motions.write_csv(tmp_path / "no" / "d.csv", timed), "cannot be written"),
        (lambda: motions.write_csv(tmp_path / "d.csv", pose), "say which by robot="),
        (lambda: motions.read_csv(tmp_path / "none.csv"), "cannot be read"),
        (lambda: plot_timed_path(3), "what is drawn is 3"),
    ):
        with pytest.raises(LinkworkError, match=said):
            call()
    assert motions.write_csv(tmp_path / "d.csv", pose, robot).read_text().startswith("time,x,x'")


def test_coordinates_of_a_tool_bear_the_names_of_its_task(tmp_path):
    """The fourth of a robot that turns about the vertical is rz, and 1/s the unit of a direction's
    rate."""
    table = built("par4")
    path = motions.point_to_point([0, 0, -0.65, 0], [0.05, 0, -0.65, 0.3], LIMITS)
    header = motions.write_csv(tmp_path / "e.csv", path, table).read_text().splitlines()[0]
    assert header.endswith(",z,z',z'',rz,rz',rz''")
    legend = plot_timed_path(path, table).axes[0].get_legend()
    assert legend.get_texts()[3].get_text() == "rz"
    read = motions.read_csv(tmp_path / "e.csv")
    led = motions.follow(table, read, samples=11, what=table.task)
    assert led.tool == pytest.approx(motions.follow(table, path, samples=11).tool, abs=1e-5)
    with pytest.raises(LinkworkError, match="the 4 coordinates of the path are those of a tool"):
        motions.write_csv(tmp_path / "e.csv", path)
    pointing = Robot(three_legs("RRS", task=("z", "direction_x", "direction_y")))
    path = motions.point_to_point([0.5, 0, 0], [0.48, 0.1, 0], LIMITS)
    labels = [axes.get_ylabel() for axes in plot_timed_path(path, pointing).axes[:2]]
    assert labels == ["coordinate\n[m, 1]", "speed\n[m/s, 1/s]"]


def test_a_timed_path_is_drawn_with_all_its_derivatives(robot, timed):
    figure = plot_timed_path(timed, robot)
    labels = [axes.get_ylabel() for axes in figure.axes]
    assert labels == ["coordinate\n[m]", "speed\n[m/s]", "acceleration\n[m/s²]", "jerk\n[m/s³]"]
    line = figure.axes[2].lines[len(timed.passed)]
    assert line.get_ydata() == pytest.approx(timed.sample(line.get_xdata())[2][:, 0], abs=1e-12)


def test_accelerations_without_rates_are_not_taken_for_rates(tmp_path):
    path, t = tmp_path / "f.csv", np.linspace(0, 1, 21)
    path.write_text("time,a,a''\n" + "\n".join(f"{x!r},{x**2!r},2" for x in t.tolist()))
    values, rates, _ = motions.read_csv(path).sample(np.linspace(0, 1, 77))
    assert values[:, 0] == pytest.approx(np.linspace(0, 1, 77) ** 2, abs=1e-12)
    assert rates[:, 0] == pytest.approx(2 * np.linspace(0, 1, 77), abs=1e-11)
