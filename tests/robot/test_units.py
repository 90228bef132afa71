"""Robots in micrometres and nanograms, or a million times larger: poses, runs and ensembles follow
the scaling laws."""

import numpy as np
import pytest

import linkwork as lw
from linkwork.model.task import asked_of
from linkwork.runs.passage import CLOSURE

from tests.catalogue import built
from tests.oracle.scaling import Scale
from tests.products import sampled

SCALES = [(1e-6, 1e-9), (1e6, 1e6)]
NAMES = ["prr3", "slider_crank", "bennett"]


def scaled(name, L, M):
    scale = Scale(getattr(lw.robots, name)(), L, M)
    return scale, lw.Robot(scale.mechanism)


@pytest.mark.parametrize(("name", "factors"), sampled(NAMES, SCALES))
def test_a_run_takes_the_same_steps_to_the_same_motion(name, factors):
    L, M = factors
    plain, (scale, robot) = built(name), scaled(name, L, M)
    time = np.linspace(0, 0.3, 4)
    expected, found = (one.simulate(one.home, duration=0.3, save_at=time) for one in (plain, robot))
    assert found.status is expected.status
    assert (found.steps, found.rejected) == (expected.steps, expected.rejected)
    motion = found.dataset.joint_position.values / scale.coordinates()
    assert np.allclose(motion, expected["joint_position"].values, rtol=0, atol=1e-12)
    assert found.closure_error < 2 * CLOSURE
    assert found.error_estimate == pytest.approx(expected.error_estimate, rel=0.05)


@pytest.mark.parametrize(("L", "M"), SCALES)
def test_the_estimated_error_of_a_length_is_counted_as_the_run_allows_it(L, M):
    """A mass at 1 from where its spring rests, x = cos 2t; mostly atol counts."""
    slide = lw.PrismaticJoint(connects=("ground", "mass"), spring=lw.Spring(stiffness=4.0))
    body = lw.Body(mass=1.0, inertia=lw.Inertia(xx=1.0, yy=1.0, zz=1.0))
    mechanism = lw.Mechanism(
        bodies={"mass": body}, joints={"slide": slide}, actuators=("slide",), gravity=(0, 0, 0)
    )
    scale = Scale(mechanism, L, M)
    robot, options = lw.Robot(scale.mechanism), {"duration": 10.0, "rtol": 1e-9, "atol": 1e-6}
    run = robot.simulate(robot.state([L]), **options)
    t, x = run.coords["time"].values, run.variables["joint_position"].values[:, 0] / L
    off = (
        np.abs(x - np.cos(2 * t)).max(),
        np.abs(run.variables["joint_rate"].values[:, 0] / L + 2 * np.sin(2 * t)).max(),
    )
    assert 0.5 < run.error_estimate / (max(off) / 1e-6) < 2
    together = robot.ensemble(robot.state([L]), np.zeros((1, 1)), **options)
    last = (
        together.final.positions[0, 0] / L - np.cos(20.0),
        together.final.rates[0, 0] / L + 2 * np.sin(20.0),
    )
    assert 0.5 < together.error_estimate[0] / (np.abs(last).max() / 1e-6) < 2


@pytest.mark.parametrize(("L", "M"), SCALES)
def test_an_ensemble_takes_the_same_steps(L, M):
    plain, (scale, robot) = built("prr3"), scaled("prr3", L, M)
    forces = np.array([[1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 1.5]])
    expected = plain.ensemble(plain.home, forces, duration=0.2, save_at=[0.1, 0.2])
    found = robot.ensemble(
        robot.home, forces * scale.forces(robot.actuators), duration=0.2, save_at=[0.1, 0.2]
    )
    assert found.steps.tolist() == expected.steps.tolist()
    last, as_expected = (part.dataset.joint_position.values[:, -1] for part in (found, expected))
    assert np.allclose(last / scale.coordinates(), as_expected, rtol=0, atol=1e-12)
    assert np.allclose(found.error_estimate, expected.error_estimate, rtol=0.05)


@pytest.mark.parametrize(("L", "M"), SCALES)
def test_a_pose_of_the_tool_is_assembled_and_a_state_closed(L, M):
    plain, (scale, robot) = built("prr3"), scaled("prr3", L, M)
    pose = plain.tool_pose(plain.home) + np.array([0.02, -0.01, 0.05])
    expected = plain.assemble(tool=pose)
    found = robot.assemble(tool=pose * [L, L, 1.0])
    assert np.allclose(
        found.positions / scale.coordinates(), expected.positions, rtol=0, atol=1e-10
    )
    rounded = np.round(expected.positions, 7) * scale.coordinates()
    assert robot.closure_error(robot.state(rounded)) < 1e-12


@pytest.mark.parametrize(("L", "M"), SCALES)
def test_a_gap_is_one_of_the_robots_own_length(L, M):
    scale, robot = scaled("prr3", L, M)
    off = built("prr3").home.positions + 1e-3 * np.arange(9.0)
    with pytest.raises(lw.LinkworkError, match="more than the tolerance 1e-06"):
        robot.state(off * scale.coordinates())


@pytest.mark.parametrize(("L", "M"), [*SCALES, (1e-9, 1.0)])
def test_slides_and_turns_that_drive_together_share_the_forces(L, M):
    """Legs driven in their slides and one hinge: least weighted forces, and internal ones, by the
    scaling laws."""
    mechanism = lw.robots.rpr3(gravity=(0.0, -9.81, 0.0))
    mechanism = mechanism.model_copy(
        update={"actuators": (*mechanism.actuators, "pivot_1", "wrist_2")}
    )
    scale = Scale(mechanism, L, M)
    plain, robot = lw.Robot(mechanism), lw.Robot(scale.mechanism)
    forces = scale.forces(robot.actuators)
    weights = np.array([1.0, 2.0, 0.5, 3.0, 1.5])
    states = [one.home for one in (plain, robot)]
    accelerations = np.array([0.3, -0.4, 0.2])
    for names in (plain.independent, ("pivot_1", "pivot_2", "pivot_3")):
        expected, found = (
            one.in_chart(state, names) for one, state in zip((plain, robot), states, strict=True)
        )
        u = plain.inverse_dynamics(expected, accelerations, weights=weights)
        own = robot.inverse_dynamics(
            found, accelerations * scale.accelerations(names), weights=weights / forces**2
        )
        assert np.allclose(own / forces, u, rtol=1e-9, atol=1e-9 * abs(u).max())
        assert np.allclose(
            plain.actuation(expected).T @ u,
            plain.gravity(expected) + plain.mass_matrix(expected) @ accelerations,
        )
        assert robot.internal_forces(found).shape == (5, 2)
        push = (
            robot.actuation(found).T @ robot.internal_forces(found) / scale.forces(names)[:, None]
        )
        assert abs(push).max() < 1e-9 * abs(robot.internal_forces(found) / forces[:, None]).max()
        assert np.allclose(robot.internal_forces(found).T @ robot.internal_forces(found), np.eye(2))


@pytest.mark.parametrize("L", [1e-9, 1.0, 1e9])
def test_a_limit_is_passed_by_more_than_rounding_whatever_the_units(L):
    slide = lw.PrismaticJoint(
        connects=("ground", "mass"), limits=lw.Limits(lower=0.0, upper=0.3 * L)
    )
    body = lw.Body(mass=1.0, centre_of_mass=(0.5 * L, 0, 0))
    robot = lw.Robot(
        lw.Mechanism(bodies={"mass": body}, joints={"slide": slide}, actuators=("slide",))
    )
    for at in (0.3 * (1 + 1e-14), -1e-14):
        assert robot.limits_passed(robot.state([at * L])) == ()
    for at in (0.3 + 1e-9, -1e-9):
        assert len(robot.limits_passed(robot.state([at * L]))) == 1


@pytest.mark.parametrize(
    ("name", "factors"),
    [("prr3", SCALES[0]), ("prr3", SCALES[1]), ("rrr3", SCALES[0]), ("stewart", SCALES[1])],
)
def test_working_modes_are_told_as_far_from_their_edges(name, factors):
    """The determinants over their sizes have no unit."""
    plain, (_, robot) = built(name), scaled(name, *factors)
    found = [told_modes(one) for one in (plain, robot)]
    assert found[0].size and np.allclose(*found, rtol=1e-9, atol=0)


def told_modes(robot):
    """Return the determinants at home over their sizes."""
    leader = robot.leader_of_tool(asked_of(robot, np.size(robot.tool_pose(robot.home))), kept=True)
    return leader.modes.parts(leader.matrix(leader.outputs(robot.home.q[None])))


@pytest.mark.parametrize(("L", "M"), SCALES)
def test_joints_of_poses_are_exported_at_any_size(L, M, tmp_path):
    _, robot = scaled("prr3", L, M)
    written = lw.export.c(robot, functions=["tool_to_joints"])
    assert any("tool_to_joints" in text for text in written.files.values())
