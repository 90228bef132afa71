"""The report of a run: complete, self-contained, escaped, right in its numbers; also of runs that
hold little."""

import re

import numpy as np
import pytest

import linkwork as lw
from linkwork.views import write_report
from linkwork.views.pages import short
from linkwork.views.run_report import bodies_table, energy_table, joints_table, peaks_table, render

from tests.catalogue import built
from tests.views.pages import Reader

EVIL = '<img src=x onerror="alert(1)">'


@pytest.fixture(scope="module")
def html(robot, run):
    return render(robot, run)


@pytest.mark.long
def test_the_page_is_self_contained_and_small(html):
    page = Reader(html)
    assert page.open == []
    assert not {"link", "img", "iframe", "object", "base"} & set(page.tags)
    assert all(reference.startswith("#") for reference in page.references)
    assert {reference[1:] for reference in page.references} <= set(page.identifiers)
    assert len(page.identifiers) == len(set(page.identifiers))
    assert set(re.findall(r"https?://[^\s\"'<]*", html)) <= {
        "http://www.w3.org/2000/svg",
        "http://www.w3.org/1999/xlink",
    }
    assert len(html.encode()) < 1_000_000


def test_the_page_tells_whose_run_it_is_how_it_went_and_how_it_was_computed(html, robot, run):
    text = Reader(html).text
    for words in (
        run.message,
        "planar mechanism of 7 bodies and 9 joints with 2 loops and mobility 3",
        "driven at slide_1, slide_2, slide_3",
        "Sharp-Smart 7(6), relative tolerance 1.0·10⁻⁸",
        f"{run.steps:,} taken",
        "Closure of the loops",
        "wrist_3",
        "linkwork: 1",
    ):
        assert words in text
    assert lw.Mechanism.parse(robot.mechanism.text) == robot.mechanism
    assert html.count("<canvas") == 1


def test_gaps_of_loops_are_told_in_the_unit_that_runs_have_them_in(html, run):
    assert run.variables["closure_error"].attrs["units"] == "own lengths, rad"
    gaps = re.findall(r"[^<>]*largest gap[^<>]*", html)
    assert len(gaps) == 3
    assert all("own length" in gap and "m, rad" not in gap for gap in gaps)


def test_peaks_are_those_of_the_motion():
    """A point on a massless rod of 1 m falls from the horizontal: at the lowest point its rate is
    sqrt(2 g / l)."""
    robot = built("pendulum")
    run = robot.simulate(robot.state([0.0]), duration=2.0, save_at=np.linspace(0, 2, 2001))
    table = peaks_table(run.dataset, "joint_rate")
    assert table is not None
    row = dict(zip(table.header, table.rows[0], strict=True))
    assert row["joint rate"] == "hinge_1 [rad/s]"
    assert row["least"] == short(-np.sqrt(2 * 9.81), 4)
    energy = energy_table(run.dataset)
    assert energy is not None
    kinetic = next(row for row in energy.rows if row[0] == "kinetic energy")
    assert kinetic[-1] == short(9.81 * robot.mechanism.bodies["rod_1"].mass, 4)


def test_the_units_of_the_bodies_table_are_those_by_which_its_numbers_grow():
    """Of a body ten times as long and three times as heavy, a number in [kg^a m^b] is 3^a 10^b
    times as large."""
    exponents = {"kg": (1, 0), "m": (0, 1), "kg m²": (1, 2)}

    def numbers(mass, length):
        tensor = dict.fromkeys(("xx", "yy", "zz"), 0.5 * mass * length**2)
        body = lw.Body(
            mass=mass,
            centre_of_mass=(0.3 * length, 0.1 * length, 0.2 * length),
            inertia=lw.Inertia(**tensor, xy=0.1 * mass * length**2),
        )
        joint = lw.RevoluteJoint(connects=("ground", "body"))
        table = bodies_table(lw.Mechanism(bodies={"body": body}, joints={"joint": joint}))
        units = [title.partition("[")[2].rstrip("]") for title in table.header[1:]]
        return units, [float(entry.split(", ")[0]) for entry in table.rows[0][1:]]

    (units, before), (_, after) = numbers(2.0, 1.0), numbers(6.0, 10.0)
    assert len(units) == 4
    for unit, x, y in zip(units, before, after, strict=True):
        masses, lengths = exponents[unit]
        assert y == pytest.approx(3**masses * 10**lengths * x), unit


def test_moments_that_a_planar_body_does_not_give_are_no_zeros_and_minus_signs_are_alike():
    moments = [lw.Inertia(zz=0.5), lw.Inertia(xx=1.0, yy=1.0, zz=0.5), lw.Inertia(zz=0.0)]
    for moment, told in zip(moments, ("–, –, 0.5", "1, 1, 0.5", "0, 0, 0"), strict=True):
        body = lw.Body(mass=1.0, centre_of_mass=(-1, 0, 0), inertia=moment)
        hinge = lw.RevoluteJoint(connects=("ground", "arm"), limits=lw.Limits(lower=-0.5))
        arm = lw.Mechanism(bodies={"arm": body}, joints={"hinge": hinge})
        assert bodies_table(arm).rows[0][2:4] == ("−1, 0, 0", told)
    assert joints_table(lw.Robot(arm)).rows[0][-1] == "angle ≥ −0.5"


def test_names_with_markup_are_escaped(tmp_path):
    plain = lw.robots.pendulum()
    (joint,), (body,) = plain.joints.values(), plain.bodies.values()
    evil = lw.Mechanism(
        name=EVIL,
        bodies={"b": body},
        joints={"j": joint.model_copy(update={"connects": ("ground", "b")})},
        actuators=("j",),
    )
    robot = lw.Robot(evil)
    run = robot.simulate(robot.home, duration=0.1, save_at=[0, 0.1])
    run.save(tmp_path / "run.nc")
    page = render(robot, lw.Run.load(tmp_path / "run.nc"))
    assert "<img" not in page
    assert "&lt;img src=x onerror=" in page


@pytest.mark.long
def test_runs_of_few_samples_are_reported(robot):
    for save_at, words in (([], "The run holds no samples"), ([0.01], "1 saved time ")):
        page = render(robot, robot.simulate(robot.home, duration=0.01, save_at=save_at))
        assert "<canvas" not in page
        assert words in Reader(page).text


@pytest.mark.long
def test_runs_that_ended_early_say_so():
    robot = built("n_four_bar")
    run = robot.simulate(robot.home.with_rates([1.0]), duration=4.0, save_at=np.linspace(0, 4, 41))
    assert not run.success
    text = Reader(render(robot, run)).text
    assert "The run did not reach its end" in text and run.message in text


def test_of_many_joints_the_driven_ones_are_shown():
    robot = built("stewart")
    run = robot.simulate(robot.home, duration=0.01, save_at=[0, 0.01])
    table = peaks_table(run.dataset, "joint_position")
    assert table is not None
    assert [row[0] for row in table.rows] == [f"leg_{i} [m]" for i in range(1, 7)]


def test_parameters_and_fixed_steps_are_told():
    robot = built("pendulum").free("rod_1.mass").with_parameters({"rod_1.mass": 2.5})
    run = robot.simulate(robot.home, duration=0.1, method="rk4", step=0.01)
    text = Reader(render(robot, run)).text
    assert "Runge-Kutta 4, steps of 0.01 s" in text
    assert "rod_1.mass = 2.5" in text


@pytest.mark.long
def test_what_cannot_be_reported_is_refused(run, robot, tmp_path):
    with pytest.raises(lw.LinkworkError, match="the run is not one of the robot"):
        write_report(built("five_bar"), run, tmp_path / "x.html")
    with pytest.raises(lw.LinkworkError, match=r"a report is written as .html, not as 'x.pdf'"):
        write_report(robot, run, tmp_path / "x.pdf")
    with pytest.raises(lw.LinkworkError, match="cannot be written: no such file or directory"):
        write_report(robot, run, tmp_path / "no" / "x.html")
