"""Charts: the motion does not depend on the independent rates; runs through singular poses, to
bifurcations and over them."""

from __future__ import annotations

import numpy as np
import pytest

import linkwork as lw
from linkwork.control import Sampler
from linkwork.equations.reference import unit
from linkwork.robots import bricard, five_bar, four_bar, n_four_bar, prr3

from tests.catalogue import built
from tests.equations.evaluation import close
from tests.oracle.published import N_FOUR_BAR
from tests.robot.oracle_state import Seen

TIGHT = {"rtol": 1e-10, "atol": 1e-12}


def positions(run: lw.Run) -> np.ndarray:
    return run["joint_position"].values


def energy(run: lw.Run) -> np.ndarray:
    return run["kinetic_energy"].values + run["potential_energy"].values


def require_smooth(run: lw.Run) -> None:
    """Assert that coordinates (angles and slides) move as the rates say from each saved time to the
    next: nothing jumps.

    Hermite's rule with the accelerations:  dq = h (w_0 + w_1) / 2 + h^2 (w_0' - w_1') / 12  up to
    h^5 / 720 q'''''.
    """
    h = np.diff(run.dataset["time"].values)[:, None]
    w, a = run["joint_rate"].values, run["joint_acceleration"].values
    step = h * (w[1:] + w[:-1]) / 2 + h**2 * (a[:-1] - a[1:]) / 12
    assert np.abs(np.diff(positions(run), axis=0) - step).max() < 1e-4


# One state in several charts


@pytest.fixture(scope="module")
def five():
    return lw.Robot(five_bar(gravity=(0, -9.81, 0)))


@pytest.mark.parametrize("names", [("motor_2", "elbow_1"), ("elbow_2", "elbow_1")])
def test_a_state_in_another_chart_is_the_same_state(five, names):
    state = five.home.with_rates([0.3, -0.2])
    other = five.in_chart(state, names)
    assert other.independent == names
    chosen = [five.rates.index(name) for name in names]
    A = five.rate_map(state)[chosen]  # v_other = A v
    close(other.rates, A @ state.rates, 1e-13)
    for same in (five.joint_rates, five.twists, five.body_poses, five.energy, five.tool_pose):
        for found, expected in zip(flat(same(other)), flat(same(state)), strict=True):
            close(found, expected, 1e-12)
    close(A.T @ five.mass_matrix(other) @ A, five.mass_matrix(state), 1e-12)
    close(A.T @ five.gravity(other), five.gravity(state), 1e-12)
    close(five.twist_map(other) @ A, five.twist_map(state), 1e-12)
    close(five.actuation(other) @ A, np.eye(2), 1e-12)
    forces = np.array([2.0, -1.0])
    found, expected = five.forward_dynamics(other, forces), five.forward_dynamics(state, forces)
    close(five.joint_accelerations(other, found), five.joint_accelerations(state, expected), 1e-11)
    close(five.inverse_dynamics(other, found), forces, 1e-11)
    assert np.allclose(five.in_chart(other, five.independent).rates, state.rates, atol=1e-13)


def flat(values) -> list[np.ndarray]:
    if isinstance(values, dict):
        return [part for pose in values.values() for part in pose]
    return list(values) if isinstance(values, tuple) else [values]


def test_stacks_change_their_chart_too(five):
    stack = five.state(np.stack([five.home.positions] * 2), [[0.3, -0.2], [0.0, 1.0]])
    other = five.in_chart(stack, ["motor_2", "elbow_1"])
    close(five.joint_rates(other), five.joint_rates(stack), 1e-13)


@pytest.mark.parametrize(
    ("names", "sentence"),
    [
        (("elbow_9", "motor_1"), "there is no rate of the tree 'elbow_9'"),
        (("tip", "motor_1"), "there is no rate of the tree 'tip'"),
        (("elbow_1",), "the rates elbow_1 do not determine the motion here"),
        (("elbow_1", "elbow_1"), "the rates elbow_1, elbow_1 do not determine the motion here"),
    ],
)
def test_rates_that_are_no_chart(five, names, sentence):
    with pytest.raises(lw.LinkworkError, match=sentence):
        five.in_chart(five.home, names)


@pytest.mark.parametrize("dead_centre", [0.0, np.pi])
def test_rates_that_others_follow_ten_thousand_times_as_fast_are_no_chart(dead_centre):
    """At an angle d from a dead centre the slide moves by r (1 +- r / l) d per radian of the crank:
    nearly nothing."""
    for angle, determined in ((1e-3, True), (1e-4, False)):
        robot = lw.Robot(lw.robots.slider_crank(crank=0.1, rod=0.3))
        state = robot.assemble({"crank": dead_centre + angle}, rates=[1.0])
        if determined:
            rate = robot.in_chart(state, ("slide",)).rates[0]
            assert abs(rate) == pytest.approx(0.1 * angle * (1 + np.cos(dead_centre) / 3), rel=1e-5)
        else:
            with pytest.raises(lw.LinkworkError, match="the rates slide do not determine"):
                robot.in_chart(state, ("slide",))


def test_a_chart_is_refused_where_it_is_singular_also_when_it_is_known_from_elsewhere(five):
    """Where leg 2 is stretched, the rates of leg 1 do not determine the motion."""
    stretched = five.assemble({"elbow_2": 0.0, "motor_2": 1.9})
    for _ in range(2):
        with pytest.raises(
            lw.LinkworkError, match="motor_1, elbow_1 do not determine the motion here"
        ):
            five.in_chart(stretched, ["motor_1", "elbow_1"])
        five.in_chart(five.home, ["motor_1", "elbow_1"])


# Runs


@pytest.mark.long
def test_runs_in_forced_charts_agree_to_the_tolerance():
    """A free five-bar passes its singular poses, whatever rates it starts in; the differences fall
    with the tolerance."""
    charts = [(), ("elbow_1", "elbow_2"), ("elbow_2", "motor_2")]
    robots = [lw.Robot(five_bar(), independent=names) for names in charts]
    assert [robot.independent for robot in robots] == [robots[0].actuators, *charts[1:]]
    start = robots[0].assemble({"motor_1": 2.105, "motor_2": 1.034}).positions
    states = [robot.state(start, {"motor_1": 3.0, "motor_2": -2.0}) for robot in robots]
    spread = {}
    for tolerance in (1e-8, 1e-10):
        options = {"rtol": tolerance, "atol": tolerance / 100}
        runs = [
            robot.simulate(state, duration=2.0, **options)
            for robot, state in zip(robots, states, strict=True)
        ]
        for run in runs:
            assert run.status is lw.Status.FINISHED
            assert "; from " in run.attrs["charts"]
            require_smooth(run)
            assert np.ptp(energy(run)) < 500 * tolerance * energy(run)[0]
        spread[tolerance] = np.ptp([positions(run)[-1] for run in runs], axis=0).max()
    assert spread[1e-10] < 1e-6
    assert spread[1e-10] < spread[1e-8] / 20


def test_a_run_may_start_in_any_chart():
    robot = lw.Robot(five_bar())
    state = robot.home.with_rates([3.0, -2.0])
    other = robot.in_chart(state, ["elbow_1", "elbow_2"])
    runs = [robot.simulate(start, [0.01, 0.0], duration=0.5, **TIGHT) for start in (state, other)]
    close(positions(runs[0])[-1], positions(runs[1])[-1], 1e-8)


@pytest.mark.parametrize("duration", [1.203, 1.297, 1.429])
def test_a_run_ends_when_it_is_asked_to_whatever_its_charts(duration):
    """To the last digit: where it changed charts at t, t + (T - t) is not T."""
    robot, u = built("rrr3"), [0.5, 0.5, 0.5]
    start = robot.home.with_rates([0.3, 0.3, 0.3])
    run = robot.simulate(start, u, duration=duration, method="rk4", step=1e-3, samples=3)
    assert "; from" in run.attrs["charts"]
    assert run.time[-1] == run.attrs["final_time"] == duration


@pytest.mark.long
def test_a_run_that_came_to_the_robot_s_own_rates_is_resumed_in_them():
    """Runs of the 3-RRS start in others: in these, the same steps would have other errors."""
    robot, step = built("rrs3"), 2.0**-9
    start, end = robot.home.with_rates([7.3, 5.9, 0.6]), 64 * step
    whole, half = (
        robot.simulate(start, duration=duration, method="rk4", step=step)
        for duration in (end + 16 * step, end)
    )
    assert half.attrs["final_rates"] == "motor_1, motor_2, motor_3"
    resumed = robot.resume(half, duration=16 * step, method="rk4", step=step)
    assert resumed.attrs["charts"] == "from 0.125 s: motor_1, motor_2, motor_3"
    close(resumed.attrs["final_q"], whole.attrs["final_q"], 1e-11)
    stepper = robot.stepper(half, step)
    stepper.step(steps=16)
    close(stepper.q, resumed.attrs["final_q"], 1e-15)


@pytest.mark.parametrize(
    ("name", "rates", "before"), [("rrs3", [7.3, 5.9, 0.6], 64), ("rrr3", [5.0, 5.0, -5.0], 100)]
)
def test_fixed_steps_behind_a_change_of_rates_are_resumed_bit_for_bit(name, rates, before):
    """In the same order of elimination, also by a robot that does not know it yet."""
    robot, step, behind = built(name), 2.0**-9, 24
    options = {"method": "rk4", "step": step}
    start = robot.home.with_rates(rates)
    whole, half = (
        robot.simulate(start, duration=count * step, **options)
        for count in (before + behind, before)
    )
    assert "; from" in half.attrs["charts"]
    for own in (robot, lw.Robot(robot.mechanism)):
        resumed = own.resume(half, duration=behind * step, **options)
        for name in ("final_q", "final_v", "final_chart"):
            assert np.array_equal(resumed.attrs[name], whole.attrs[name])


def test_a_run_under_a_lowered_bound_is_resumed_under_it(tmp_path):
    """All bars of two four-bars near one line: nothing is better there, until it is behind them."""
    robot = lw.Robot(lw.robots.n_four_bar(2))
    start, options = robot.home.with_rates([-1.0]), {"method": "rk4", "step": 1e-3}
    whole = robot.simulate(start, duration=0.711, **options)
    bound, _, short, _ = whole.attrs["final_lowered"]
    assert bound == 0.0125 and short == 8e-3
    stepper = robot.stepper(start, 1e-3)
    for count in (700, 706, 708, 710):
        half = robot.simulate(start, duration=count * 1e-3, **options)
        stepper.step(steps=count - round(stepper.time / 1e-3))
        for run in (half, lw.Run.load(half.save(tmp_path / "half.nc")), stepper.run):
            resumed = robot.resume(run, duration=0.711 - count * 1e-3, **options)
            other = robot.stepper(run, 1e-3)
            other.step(steps=711 - count)
            for name in ("final_q", "final_v", "final_chart", "final_lowered"):
                assert np.array_equal(resumed.attrs[name], whole.attrs[name])
                assert np.array_equal(other.run.attrs[name], whole.attrs[name])


@pytest.mark.parametrize("told", ["{}", "[1]", '{"independent": [0]}'])
def test_a_run_that_tells_no_chart_of_the_robot_is_not_resumed(told):
    robot = built("five_bar")
    run = robot.simulate(robot.home, duration=0.01)
    attrs = dict(run.attrs) | {"final_chart": told}
    foreign = lw.Run(run.variables, run.coords, attrs, run.status, run.message, run.statistics)
    with pytest.raises(lw.LinkworkError, match="the run belongs to another robot"):
        robot.resume(foreign, duration=0.1)


@pytest.mark.parametrize("name", ["rrs3", "stewart", "hexaglide"])
def test_steps_that_close_loops_contract_quadratically_whatever_the_lengths_of_quaternions(name):
    robot = built(name)
    step, size = robot.chart.kernel("closure_step"), robot.home.q.size
    q, gaps = robot.home.q + 1e-4 * np.random.default_rng(0).normal(size=size), []
    for _ in range(3):
        q, gap = step(q)
        gaps.append(gap.item())
    assert gaps[1] < 10 * gaps[0] ** 2 and gaps[2] < 10 * gaps[1] ** 2 + 1e-15


@pytest.mark.long
@pytest.mark.parametrize(("name", "rtol"), [("hexaglide", 1e-4), ("rrs3", 1e-6), ("stewart", 1e-6)])
def test_loops_are_closed_where_a_run_ends_however_long_its_steps_are(name, rtol):
    """Also where the platform's turns follow from the legs, and steps change the length of its
    quaternion."""
    robot = built(name)
    rates = np.random.default_rng(0).normal(size=(4, robot.mobility))
    for each, duration in zip(rates, (0.06, 0.12, 0.2, 0.27), strict=True):
        start = robot.home.with_rates(each)
        run = robot.simulate(start, duration=duration, rtol=rtol, atol=0.01 * rtol)
        q = unit(robot.equations.tree, run.attrs["final_q"])
        assert np.abs(run.attrs["final_q"] - q).max() < 2e-13
        assert robot.chart.kernel("closure_step")(q)[1] < 2e-13 * robot.size


def test_the_paper_s_robot_under_one_force_passes_its_singular_poses():
    """The work of the force is the change of energy."""
    robot = lw.Robot(prr3())
    run = robot.simulate(robot.home, [5.0, 0.0, 0.0], duration=1.0, **TIGHT)
    assert run.status is lw.Status.FINISHED
    assert "; from " in run.attrs["charts"]
    require_smooth(run)
    work = 5 * (positions(run)[:, 0] - positions(run)[0, 0])
    close(energy(run) - energy(run)[0], work, 1e-8)
    assert run.closure_error < 1e-12


def test_dead_centres_of_the_independent_rate_are_passed_in_another_chart():
    """The rocker turns back where crank and coupler lie in line; the crank knows nothing of
    that."""
    by_crank, by_rocker = (
        lw.Robot(four_bar(crank=0.3), independent=names) for names in ((), ("rocker_pivot",))
    )
    assert (by_crank.independent, by_rocker.independent) == (("crank_pivot",), ("rocker_pivot",))
    times = np.linspace(0, 1, 501)
    runs = []
    for robot in (by_crank, by_rocker):
        state = robot.state(by_crank.home.positions, {"crank_pivot": 12.0})
        runs.append(robot.simulate(state, duration=1.0, save_at=times, **TIGHT))
        assert runs[-1].status is lw.Status.FINISHED
        require_smooth(runs[-1])
    close(positions(runs[1]), positions(runs[0]), 1e-7)
    assert np.ptp(positions(runs[0])[:, 0]) > 2 * np.pi
    assert "crank_pivot" in runs[1].attrs["charts"]


# Redundant rows


def test_bricard_keeps_its_energy_and_the_row_that_was_dropped():
    """Over ten seconds the row that is left out stays closed; the oracle measures it."""
    robot = lw.Robot(bricard())
    assert len(robot.redundant) == 1
    run = robot.simulate(robot.home, duration=10.0, save_at=np.linspace(0, 10, 21), **TIGHT)
    assert run.status is lw.Status.FINISHED
    assert np.ptp(energy(run)) < 1e-8 * np.abs(energy(run)).max()
    assert run.closure_error < 1e-12
    short = [robot.simulate(robot.home, duration=1.0, samples=n, **TIGHT) for n in (None, 2)]
    assert np.array_equal(*(each.final.q for each in short))  # what is saved changes no run
    for index in (7, 20):
        rates = dict(zip(robot.rates, run["joint_rate"].values[index], strict=True))
        state = robot.state(positions(run)[index], {"hinge_2": rates["hinge_2"]})
        Seen.of(robot, state).agree([0.0], 1e-9)


def test_a_structure_that_can_only_tremble_is_stopped_by_the_row_that_was_dropped():
    """Two bars of 1 m stretched between pins 2 m apart: their middle can start to move across, but
    not go on."""
    bar = lw.Body(mass=1, centre_of_mass=(0.5, 0, 0), inertia=lw.Inertia(zz=0.1))
    joints = {
        "a": lw.RevoluteJoint(connects=("ground", "left")),
        "b": lw.RevoluteJoint(connects=("left", "right"), frames=(lw.Frame.planar(1), lw.Frame())),
        "c": lw.RevoluteJoint(
            connects=("right", "ground"), frames=(lw.Frame.planar(1), lw.Frame.planar(2))
        ),
    }
    robot = lw.Robot(lw.Mechanism(bodies={"left": bar, "right": bar}, joints=joints))
    assert (robot.mobility, robot.gruebler, len(robot.redundant)) == (1, 0, 1)
    run = robot.simulate(robot.home.with_rates([0.1]), duration=1.0)
    assert run.status is lw.Status.CLOSURE_LOST
    assert "the loops do not close any more" in run.message
    assert run.dataset["time"].values[-1] < 1e-3
    assert run["closure_error"].max() <= 1e-13


# Bifurcations


@pytest.fixture(scope="module")
def ladder():
    return lw.Robot(n_four_bar(2))


def test_a_run_stops_at_a_bifurcation_and_says_so(ladder):
    """All bars in one line at t = 0.714 s: the freedoms jump from one to three."""
    run = ladder.simulate(ladder.home.with_rates([-1.0]), duration=10.0, **TIGHT)
    assert run.status is lw.Status.SINGULAR
    assert "branches of motion meet (a bifurcation)" in run.message
    assert "on_singular='step_over' continues" in run.message
    cranks = positions(run)[:, :3]
    assert 0 < cranks[-1, 0] < 1e-3
    close(cranks, cranks[:, :1] * np.ones(3), 1e-10)


def test_no_way_over_a_bifurcation_is_sought_while_a_controller_is_sampled(ladder):
    still = Sampler(lambda t, state: {}, rate=100.0)
    start, options = ladder.home.with_rates([-1.0]), {"duration": 10.0, **TIGHT}
    run = ladder.simulate(start, still, on_singular="step_over", **options)
    assert run.status is lw.Status.SINGULAR
    assert run.message.endswith(
        "no way over it is sought while a controller is called at a fixed rate."
    )


def test_stepping_over_bifurcations_keeps_the_smooth_branch(ladder):
    """Position and velocity of the first tip at t = 1, 2, 5 and 10 s as published; all cranks stay
    parallel."""
    times = [0.0, *N_FOUR_BAR]
    start = ladder.home.with_rates([-1.0])
    run = ladder.simulate(start, duration=10.0, on_singular="step_over", save_at=times, **TIGHT)
    assert run.status is lw.Status.FINISHED
    angle, rate = positions(run)[1:, 0], run["joint_rate"].values[1:, 0]
    close(np.transpose([np.cos(angle), np.sin(angle)]), list(N_FOUR_BAR.values()), 1e-6)
    close(
        rate[-1] * np.array([-np.sin(angle[-1]), np.cos(angle[-1])]),
        [1.423051470189, -0.494868845467],
        1e-6,
    )
    assert np.isclose(angle[-1], -30.179800860, atol=1e-6)
    cranks = positions(run)[:, [ladder.coordinates.index(f"pivot_{i}") for i in range(3)]]
    close(cranks, cranks[:, :1] * np.ones(3), 1e-8)
    assert np.ptp(energy(run)) < 1e-7 * np.abs(energy(run)).max()


@pytest.mark.parametrize("tolerance", [1e-4, 1e-6, 1e-8, 1e-10])
def test_a_folding_four_bar_never_jumps_unseen(tolerance):
    """A parallelogram folds flat twice a turn: the run stops there, or steps over and stays a
    parallelogram."""
    mechanism = four_bar(ground=1.0, crank=0.5, coupler=1.0, rocker=0.5).model_copy(
        update={
            "reference": {
                "crank_pivot": 1.2,
                "crank_pin": -1.2,
                "rocker_pivot": 1.2,
                "rocker_pin": 1.2,
            }
        }
    )
    robot = lw.Robot(mechanism)
    for on_singular in ("stop", "step_over"):
        run = robot.simulate(
            robot.home.with_rates([-3.0]),
            duration=2.0,
            rtol=tolerance,
            atol=tolerance / 100,
            on_singular=on_singular,
        )
        crank, _, rocker, _ = positions(run).T
        close(rocker, crank, max(1e-9, 10 * tolerance))
        if run.status is lw.Status.SINGULAR:
            assert 0 < crank[-1] < 0.1 or on_singular == "step_over"
            assert "bifurcation" in run.message
        else:
            assert on_singular == "step_over"
            assert crank[-1] < -2 * np.pi


@pytest.mark.parametrize("longer", [1e-3, -1e-3, 1e-4, -1e-4])
def test_a_nearly_folding_four_bar_takes_the_turn_that_its_lengths_leave_it(longer):
    """A coupler too long by a little stops the crank before the line of centres, one too short the
    rocker (Grashof)."""
    mechanism = four_bar(ground=1.0, crank=0.5, coupler=1.0 + longer, rocker=0.5, gravity=(0, 0, 0))
    reference = {"crank_pivot": 1.2, "crank_pin": -1.2, "rocker_pivot": 1.2, "rocker_pin": 1.2}
    robot = lw.Robot(mechanism.model_copy(update={"reference": reference}))
    for on_singular in ("stop", "step_over"):
        run = robot.simulate(robot.home.with_rates([-3.0]), duration=1.0, on_singular=on_singular)
        assert run.status is lw.Status.FINISHED
        require_smooth(run)
        assert np.ptp(energy(run)) < 1e-6 * energy(run)[0]
        crank, _, rocker, _ = positions(run).T
        held, passing = (crank, rocker) if longer > 0 else (rocker, crank)
        assert held.min() > 0
        assert passing[-1] < -1


@pytest.mark.parametrize("tolerance", [1e-8, 1e-10])
def test_a_branch_that_is_not_there_is_not_stepped_onto(tolerance):
    """A coupler too long by 1e-8 m folds almost; the parallelogram's branch beyond is wrong by more
    than the tolerance."""
    mechanism = four_bar(ground=1.0, crank=0.5, coupler=1.0 + 1e-8, rocker=0.5, gravity=(0, 0, 0))
    reference = {"crank_pivot": 1.2, "crank_pin": -1.2, "rocker_pivot": 1.2, "rocker_pin": 1.2}
    robot = lw.Robot(mechanism.model_copy(update={"reference": reference}))
    options = {"rtol": tolerance, "atol": tolerance / 100, "on_singular": "step_over"}
    run = robot.simulate(robot.home.with_rates([-3.0]), duration=1.0, **options)
    assert positions(run)[:, 0].min() > 0
    assert run.status is lw.Status.SINGULAR or positions(run)[-1, 0] > 1


# Units


def small_prr3(scale: float) -> lw.Robot:
    """Return the paper's robot with all lengths scaled; masses stay, moments of inertia go with the
    square."""
    lengths = {"l1": 0.3 * scale, "l2": 0.15 * scale, "l3": scale}
    inertias = {"slider_inertia": 1.71e-5, "link_inertia": 9.09e-4, "platform_inertia": 5.076e-3}
    return lw.Robot(prr3(**lengths, **{name: value * scale**2 for name, value in inertias.items()}))


def test_a_small_robot_moves_as_a_large_one():
    """All lengths times 0.01: the same free motion, a hundredth as large, through the same singular
    poses."""
    rates, ends = np.random.default_rng(4).normal(size=3), []
    for scale in (1.0, 0.01):
        robot = small_prr3(scale)
        run = robot.simulate(
            robot.home.with_rates(scale * rates), duration=1.5, rtol=1e-9, atol=1e-11
        )
        assert run.status is lw.Status.FINISHED, run.message
        unit = np.array([scale if robot.unit(name) == "m" else 1.0 for name in robot.coordinates])
        ends.append(positions(run)[-1] / unit)
    close(ends[1], ends[0], 1e-4)
