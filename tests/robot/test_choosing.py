"""Charts are built on what is there, not on rounding errors."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import linkwork as lw
from linkwork.equations.chart_choice import LEAST
from linkwork.equations.reference import unit
from linkwork.model.closing import settled
from linkwork.runs.next_chart import choices

from tests.catalogue import built
from tests.oracle.maximal import MaximalOracle
from tests.robot.oracle_state import Seen

TIGHT = {"rtol": 1e-10, "atol": 1e-12}


def held_by_a_rod(noise: float) -> lw.Mechanism:
    """Return a chain of three hinges whose end a rod holds: its first ball lies on the first
    hinge's axis, up to noise."""

    def body(mass: float) -> lw.Body:
        return lw.Body(
            mass=mass, centre_of_mass=(0, 0, -0.2), inertia=lw.Inertia(xx=0.02, yy=0.02, zz=0.01)
        )

    def at(*position: float) -> lw.Frame:
        return lw.Frame(position=position)

    below, ball = at(0, 0, -0.4), at(noise, 0.1, -2 * noise)
    joints = {
        "a": lw.RevoluteJoint(connects=("ground", "one"), axis=(0, 1, 0)),
        "b": lw.RevoluteJoint(connects=("one", "two"), axis=(0, 1, 0), frames=(below, lw.Frame())),
        "c": lw.RevoluteJoint(
            connects=("two", "three"), axis=(0, 1, 0), frames=(below, lw.Frame())
        ),
        "rod": lw.RodJoint(
            connects=("ground", "three"), length=0.75, frames=(ball, at(0.1, 0.05, 0))
        ),
    }
    return lw.Mechanism(
        bodies={"one": body(2), "two": body(1), "three": body(0.5)},
        joints=joints,
        actuators=("a", "b"),
        reference={"a": 0.2, "b": -0.7, "c": 0.5},
        gravity=(0, 0, -9.81),
    )


@pytest.mark.sample(2)
@pytest.mark.parametrize("noise", [3e-15, -2e-14, 1e-13])
def test_what_is_zero_up_to_rounding_determines_nothing(noise):
    """The rod does not hold the first hinge, whose turns move its ball by `noise` only: no chart
    may depend on it."""
    robot, exact = lw.Robot(held_by_a_rod(noise)), lw.Robot(held_by_a_rod(0.0))
    with pytest.raises(
        lw.LinkworkError, match="the rates b, c do not determine the motion here; b, a do"
    ):
        robot.in_chart(robot.home, ("b", "c"))
    other = robot.in_chart(robot.home.with_rates([0.4, -0.3]), ("a", "c"))
    Seen.of(robot, robot.in_chart(other, robot.independent)).agree([1.0, -2.0], 1e-9)
    runs = [
        one.simulate(one.home.with_rates([1.0, 3.0]), duration=1.0, **TIGHT)
        for one in (robot, exact)
    ]
    assert all(run.status is lw.Status.FINISHED for run in runs)
    ends = [run["joint_position"].values[-1] for run in runs]
    assert np.allclose(*ends, atol=1e-7)
    assert runs[0].attrs["charts"] == runs[1].attrs["charts"]


def changes(run: lw.Run) -> list[tuple[float, tuple[str, ...], tuple[str, ...]]]:
    """Return when a run changed its independent rates: the time, those that it left, and those that
    it took."""
    told = [each.split(": ") for each in run.attrs["charts"].split("; ")]
    times = [float(begun.split()[1]) for begun, _ in told]
    rates = [tuple(names.split(", ")) for _, names in told]
    return list(zip(times[1:], rates, rates[1:], strict=False))


def determined(robot: lw.Robot, positions: np.ndarray, names: tuple[str, ...]) -> float:
    """Return the least singular value of the oracle's constraints with these rates locked: 0 where
    the mechanism can move."""
    oracle = MaximalOracle(robot.mechanism, dict(zip(robot.coordinates, positions, strict=True)))
    rows = oracle.rows(oracle.poses(oracle.near), oracle._rest)
    locked = rows.F[[robot.rates.index(name) for name in names]]
    return float(np.linalg.svd(np.vstack([rows.A, locked]), compute_uv=False)[-1])


@pytest.mark.sample(3)
@pytest.mark.parametrize(
    ("name", "seed"), [("agile_wrist", 1), ("agile_wrist", 2), ("orthoglide", 2), ("delta", 4)]
)
def test_no_chart_is_left_for_rates_that_determine_the_motion_worse(name, seed):
    """On the way to a singular pose every choice is weak, and a bad one is not changed for a worse
    one."""
    robot = built(name)
    start = robot.home.with_rates(2.0 * np.random.default_rng(seed).normal(size=robot.mobility))
    taken = changes(robot.simulate(start, duration=1.0))
    times = [time for time, *_ in taken]
    run = robot.simulate(start, duration=times[-1], save_at=times)
    for q, (time, left, now) in zip(run["joint_position"].values, taken, strict=True):
        assert determined(robot, q, now) > determined(robot, q, left), (time, left, now)


@pytest.mark.parametrize("name", ["five_bar", "rrr3"])
def test_a_chart_that_is_chosen_is_strong_there(name):
    """Also that in which runs start, where it is taken again for its order of elimination."""
    robot, random = built(name), np.random.default_rng(5)
    tree, home = robot.equations.tree, robot.home.q
    q = unit(tree, home + 0.6 * tree.units * random.standard_normal((400, home.size)))
    q, gap = settled(robot.kernel("closure_step"), q, robot.p)
    q = q[gap < 1e-9]
    left = SimpleNamespace(order=None)
    regular, groups = choices(robot, left, q, robot.chart.constraint_jacobian(q))
    again = 0
    for members, chart in groups:
        (pivots,) = chart.kernel("pivots")(q[members[regular[members]]], chart.p)
        again += len(pivots) * (chart.order == robot.run_chart.order)
        assert pivots.min() > LEAST
    assert again > 20
