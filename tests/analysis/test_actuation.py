"""Between joints and motors of legs with loops: geometry by hand, other charts, energy, differences
and compiled C."""

import ctypes
import pickle
import shutil
import subprocess

import casadi as ca
import numpy as np
import pytest

from linkwork import LinkworkError, SingularError, analysis
from linkwork.analysis.loop_map import function, watched, weakest_of

from tests.analysis.legs import ankle, crank_angle, floating_knee, knee, two_knees
from tests.catalogue import built
from tests.processes import PATIENCE

ANKLE = ("ankle.angle_1", "ankle.angle_2")
POSES = np.random.default_rng(3).uniform(-0.25, 0.25, (12, 2))
SIDES = (1.0, -1.0)


@pytest.fixture(scope="module", params=[True, False], ids=["rods with mass", "massless rods"])
def model(request):
    return analysis.actuation(ankle(request.param), ANKLE)


@pytest.fixture(scope="module")
def moving(model):
    """States at given joint angles, with rates."""
    rates = np.random.default_rng(4).uniform(-2, 2, (12, 2))
    return model.at(POSES).with_rates(rates)


def test_motors_stand_where_the_geometry_says(model):
    states = model.at(POSES)
    wanted = [[crank_angle(side, *pose) for side in SIDES] for pose in POSES]
    assert model.coordinates(states) == pytest.approx(np.array(wanted), abs=1e-10)
    back = model.at(motors=wanted)
    assert model.coordinates(back, "joints") == pytest.approx(POSES, abs=1e-9)


def test_the_jacobian_is_that_of_the_closed_geometry(model):
    found, h = model.jacobian(model.at(POSES)), 1e-6
    for J, (pitch, roll) in zip(found, POSES, strict=True):
        for row, side in zip(J, SIDES, strict=True):
            by_pitch = crank_angle(side, pitch + h, roll) - crank_angle(side, pitch - h, roll)
            by_roll = crank_angle(side, pitch, roll + h) - crank_angle(side, pitch, roll - h)
            assert row == pytest.approx([by_pitch / (2 * h), by_roll / (2 * h)], abs=1e-8)
    one = model.at(POSES[3])
    assert (model.jacobian(one) == found[3]).all() or model.jacobian(one) == pytest.approx(
        found[3], abs=1e-13
    )


def test_the_jacobian_s_rate_is_its_derivative(model, moving):
    w, h = model.joint_rates(moving, moving.rates), 1e-5  # of these robots, v are the motors' rates
    ahead, behind = (model.jacobian(model.at(POSES + sign * h * w)) for sign in (1, -1))
    assert model.jacobian_rate(moving, w) == pytest.approx(model.jacobian_rate(moving), abs=1e-11)
    assert model.jacobian_rate(moving) == pytest.approx((ahead - behind) / (2 * h), abs=1e-6)


def test_rates_and_torques_go_both_ways_with_the_same_power(model, moving):
    random = np.random.default_rng(5)
    w, u = random.normal(size=(12, 2)), random.normal(size=(12, 2))
    motor_rates = model.motor_rates(moving, w)
    assert model.joint_rates(moving, motor_rates) == pytest.approx(w, abs=1e-12)
    torques = model.joint_torques(moving, u)
    assert model.motor_torques(moving, torques) == pytest.approx(u, abs=1e-12)
    assert np.einsum("ki,ki->k", torques, w) == pytest.approx(
        np.einsum("ki,ki->k", u, motor_rates), abs=1e-12
    )


def test_inertia_and_bias_at_the_motors_are_those_of_the_robot_in_its_own_rates(model, moving):
    robot = model.robot
    assert model.inertia(moving, "motors") == pytest.approx(robot.mass_matrix(moving), rel=1e-9)
    own = robot.coriolis(moving) + robot.gravity(moving) - robot.passive_forces(moving)
    assert model.bias(moving, "motors") == pytest.approx(own, abs=1e-9)


def test_inertia_at_the_joints_has_the_robot_s_energy(model, moving):
    w = model.joint_rates(moving, moving.rates)
    kinetic = np.einsum("ki,kij,kj->k", w, model.inertia(moving), w) / 2
    assert kinetic == pytest.approx(model.robot.energy(moving)[0], rel=1e-10)
    # Joint torques of motors that accelerate the robot are M w' + h.
    u = np.random.default_rng(6).normal(size=(12, 2))
    dw = model.robot.joint_accelerations(moving, model.robot.forward_dynamics(moving, u))
    places = [model.robot.rates.index(name) for name in ANKLE]
    needed = np.einsum("kij,kj->ki", model.inertia(moving), dw[:, places]) + model.bias(moving)
    assert needed == pytest.approx(model.joint_torques(moving, u), abs=1e-9)


def test_rods_count(moving):
    """Bodies of rods add to the inertia, and nothing to the geometry."""
    heavy, light = (analysis.actuation(ankle(kind), ANKLE) for kind in (True, False))
    at = [each.at(POSES) for each in (heavy, light)]
    assert heavy.jacobian(at[0]) == pytest.approx(light.jacobian(at[1]), abs=1e-10)
    more = heavy.inertia(at[0]) - light.inertia(at[1])
    assert (np.linalg.eigvalsh(more) > 0).all()


def test_limits_of_the_motors_bound_the_joints(model):
    state = model.at(POSES[0])
    V, U = np.array([3.0, 5.0]), np.array([20.0, 10.0])
    signs = np.array(np.meshgrid([-1, 1], [-1, 1])).reshape(2, -1).T
    speeds, torques = model.speed_limits(state, V), model.torque_limits(state, U)
    assert speeds.most == pytest.approx(np.abs(model.joint_rates(state, signs * V)).max(axis=0))
    assert torques.most == pytest.approx(np.abs(model.joint_torques(state, signs * U)).max(axis=0))
    for i in range(2):
        alone = np.eye(2)[i] * speeds.alone[i]
        assert (np.abs(model.motor_rates(state, alone)) / V).max() == pytest.approx(1)
        alone = np.eye(2)[i] * torques.alone[i]
        assert (np.abs(model.motor_torques(state, alone)) / U).max() == pytest.approx(1)


def test_gains_act_alike_on_both_sides(model):
    """The stiffness of a motor controller in the joints, by differences, held under load."""
    state, K, u_0 = model.at(POSES[1]), np.diag([40.0, 70.0]), np.array([3.0, -2.0])
    theta_0 = model.coordinates(state)

    def torques(pose):
        there = model.at(pose, guess=state)
        return model.joint_torques(there, u_0 - K @ (model.coordinates(there) - theta_0))

    h = 1e-5
    slopes = [(torques(POSES[1] + h * e) - torques(POSES[1] - h * e)) / (2 * h) for e in np.eye(2)]
    found = model.joint_gains(state, [40.0, 70.0], 2.0, torques=u_0)
    assert found.kp == pytest.approx(-np.array(slopes).T, abs=1e-5)
    back = model.motor_gains(state, found.kp, found.kd, torques=u_0)
    assert back.kp == pytest.approx(K, abs=1e-9)
    assert back.kd == pytest.approx(2 * np.eye(2), abs=1e-10)
    assert model.joint_gains(state, K).kp != pytest.approx(found.kp, abs=1e-3)


def test_a_pickled_model_says_the_same(model):
    again = pickle.loads(pickle.dumps(model))
    assert (again.joints, again.motors, again.others) == (model.joints, model.motors, model.others)
    state = again.at([0.1, -0.05])
    assert np.array_equal(again.jacobian(state), model.jacobian(model.at([0.1, -0.05])))


def test_a_four_bar_knee_on_a_hip():
    """The motor moves with the knee alone; the hip is held, or led as a joint of its own."""
    robot = knee()
    alone, both = (
        analysis.actuation(robot, ["knee"], ["motor"]),
        analysis.actuation(robot, ["hip", "knee"]),
    )
    assert alone.others == ("hip",)
    for angle in (-0.6, -0.3, 0.0):
        state, h = alone.at([angle]), 1e-5
        sides = [alone.coordinates(alone.at([angle + sign * h])) for sign in (1, -1)]
        J = alone.jacobian(state)
        assert J[0] == pytest.approx((sides[0] - sides[1]) / (2 * h), rel=1e-7)
        # The four-bar's closed Jacobian: the rod carries no moment, so both levers see one force.
        poses = robot.body_poses(state)
        crank, rod, shank = (poses[name][0][:2] for name in ("crank", "rod", "shank"))
        line = poses["rod"][1][:2, 0]
        levers = [
            arm[0] * line[1] - arm[1] * line[0] for arm in (rod + 0.3 * line - shank, rod - crank)
        ]
        assert J.item() == pytest.approx(levers[0] / levers[1], rel=1e-9)
        full = both.jacobian(state)
        assert full == pytest.approx(np.array([[1, 0], [0, J.item()]]), abs=1e-12)
        assert both.inertia(state)[1, 1] == pytest.approx(alone.inertia(state).item(), rel=1e-12)


CALLS = [
    ("jacobian", ()),
    ("jacobian_rate", ()),
    ("jacobian_rate", ([0.4, -0.9],)),
    ("motor_rates", ([0.4, -0.9],)),
    ("joint_rates", ([0.4, -0.9],)),
    ("joint_torques", ([0.4, -0.9],)),
    ("motor_torques", ([0.4, -0.9],)),
    ("inertia", ()),
    ("inertia", ("motors",)),
    ("bias", ()),
    ("bias", ("motors",)),
]


@pytest.mark.parametrize(("name", "given"), CALLS)
def test_one_state_s_short_way_gives_what_stacks_give(model, moving, name, given):
    call, state = getattr(model, name), moving.at(4)
    wanted = call(moving, *given)[4]
    arrays = [np.array(part) if isinstance(part, list) else part for part in given]
    for inputs in (given, arrays):
        assert call(state, *inputs) == pytest.approx(wanted, abs=1e-12)
    first = call(state, *arrays)
    kept = first.copy()
    call(moving.at(5), *arrays)
    assert (first == kept).all()  # a result is the caller's own
    assert call(moving.at(slice(4, 5)), *given).shape == (1, *wanted.shape)
    turned = model.robot.in_chart(state, ANKLE)  # the same motion, told in other rates
    assert call(turned, *given) == pytest.approx(wanted, abs=1e-10)


def test_the_short_way_takes_vectors_as_they_are(model, moving):
    state, u = moving.at(0), np.array([1.0, 2.0])
    wanted = model.joint_torques(state, u)
    spread = np.zeros(4)
    spread[::2] = u
    for given in (spread[::2], u.astype(np.float32), u.astype(int), u[::-1][::-1], (1, 2)):
        assert model.joint_torques(state, given) == pytest.approx(wanted, rel=1e-15)
    for wrong, said in (([np.nan, 1.0], "nan"), ([1.0, 2.0, 3.0], "shape"), (["a", 1], "numbers")):
        for given in (wrong, np.array(wrong)):
            with pytest.raises(LinkworkError, match=said):
                model.joint_torques(state, given)


def test_stacks_take_vectors_that_go_with_them(model, moving):
    u = np.random.default_rng(8).normal(size=(12, 2))
    wanted = [model.joint_torques(moving.at(k), u[k]) for k in range(12)]
    assert model.joint_torques(moving, u) == pytest.approx(np.array(wanted), abs=1e-12)
    assert model.joint_torques(moving, u.tolist()) == pytest.approx(np.array(wanted), abs=1e-12)
    shared = [model.joint_torques(moving.at(k), u[0]) for k in range(12)]
    assert model.joint_torques(moving, u[0]) == pytest.approx(np.array(shared), abs=1e-12)
    many = [model.joint_torques(moving.at(0), each) for each in u]
    assert model.joint_torques(moving.at(0), u) == pytest.approx(np.array(many), abs=1e-12)
    assert model.jacobian(moving.at(slice(0, 0))).shape == (0, 2, 2)
    u[5, 1] = np.nan
    for wrong, said in ((u, r"\[5, 1\] is nan"), (u[:7], "batches .* do not fit")):
        with pytest.raises(LinkworkError, match=said):
            model.joint_torques(moving, wrong)


def test_rates_of_the_motors_are_read_without_eliminating_the_loops_again(model, moving):
    """By J, as the elimination in the robot's own rates gives them."""
    own = model.compiled.rates(moving)
    assert own == pytest.approx(model.joint_rates(moving, moving.rates), abs=1e-12)
    given = {"joint_bias": own, "jacobian_rate": own.take(model.compiled.places, axis=-1)}
    for name, rates in given.items():
        wanted = model.compiled.found(name, moving, rates)
        found = model.compiled.of_state[name](moving)
        assert found.reshape(wanted.shape) == pytest.approx(wanted, rel=1e-11, abs=1e-12)
        home = model.robot.chart.equations
        counted = [
            f.n_instructions() for f in (watched(model.map, name, home), function(model.map, name))
        ]
        assert counted[0] < counted[1] + 60


def test_rates_that_do_not_determine_those_of_the_joints_are_doubted():
    """At a dead point the motor's rate says nothing of the knee's: the short way gives nothing."""
    model = analysis.actuation(knee(), ["hip", "knee"], ["hip", "motor"])
    state = at_a_dead_point(analysis.actuation(knee(), ["knee"], ["motor"]))
    for name in ("joint_bias", "jacobian_rate"):
        assert model.compiled.of_state[name](model.robot.home) is not None
        assert model.compiled.of_state[name](state.with_rates([0.1, 0.0])) is None


def test_inertia_and_bias_at_the_motors_follow_from_those_at_the_joints(model, moving):
    J, turned = model.jacobian(moving), model.jacobian_rate(moving)
    w = model.joint_rates(moving, moving.rates)[..., None]
    inverse = np.linalg.inv(J)
    across = np.swapaxes(inverse, -1, -2)
    M, h = model.inertia(moving), model.bias(moving)[..., None]
    assert model.inertia(moving, "motors") == pytest.approx(across @ M @ inverse, rel=1e-10)
    wanted = across @ (h - M @ inverse @ turned @ w)
    assert model.bias(moving, "motors") == pytest.approx(wanted[..., 0], abs=1e-10)


def test_free_numbers_are_those_of_the_robot():
    freed = ankle().free("foot.mass")
    heavy = analysis.actuation(freed.with_parameters({"foot.mass": 5.0}), ANKLE)
    light = analysis.actuation(freed, ANKLE)
    states = [each.at(POSES[0]) for each in (heavy, light)]
    assert heavy.inertia(states[0])[0, 0] > light.inertia(states[1])[0, 0] + 1e-3
    again = analysis.actuation(ankle(), ANKLE)
    assert light.inertia(states[1]) == pytest.approx(again.inertia(again.at(POSES[0])), rel=1e-12)


@pytest.mark.long
@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
def test_the_exported_c_gives_the_same_numbers(tmp_path):
    model = analysis.actuation(ankle(True), ANKLE)
    state = model.at(POSES[2]).with_rates([0.7, -0.4])
    source = model.write_c(tmp_path / "leg.c")
    library = tmp_path / "leg.so"
    command = ["cc", "-O1", "-shared", "-fPIC", source, "-o", library, "-lm"]
    subprocess.run(command, check=True, timeout=PATIENCE)
    loaded = ctypes.CDLL(str(library))

    def call(name, *inputs, sizes):
        given = [np.ascontiguousarray(part, float) for part in (*inputs, np.zeros(1))]
        results = [np.zeros(size) for size in sizes]
        lists = [
            (ctypes.c_void_p * len(some))(*(a.ctypes.data for a in some))
            for some in (given, results)
        ]
        work = np.zeros(100_000)
        counts = ctypes.c_void_p(work.ctypes.data)
        assert getattr(loaded, name)(*lists, counts, counts, 0) == 0
        return results

    J, *_ = call("jacobian", state.q, sizes=(4, 1, 1))
    assert J.reshape(2, 2) == pytest.approx(model.jacobian(state), abs=1e-13)
    v = model.compiled.rates(state)
    w = model.joint_rates(state, state.rates)
    assert call("jacobian_rate", state.q, w, sizes=(4, 1, 1))[0].reshape(2, 2) == pytest.approx(
        model.jacobian_rate(state), abs=1e-12
    )
    M, *_ = call("joint_inertia", state.q, sizes=(4, 1, 1))
    h, *_ = call("joint_bias", state.q, v, sizes=(2, 1, 1))
    assert M.reshape(2, 2) == pytest.approx(model.inertia(state), abs=1e-13)
    assert h == pytest.approx(model.bias(state), abs=1e-12)
    u = np.array([3.0, -1.0])
    torques, *_ = call("motor_torques", state.q, u, sizes=(2, 1, 1))
    assert torques == pytest.approx(model.motor_torques(state, u), abs=1e-12)
    q = state.q + 1e-3  # opened, and closed again step by step at the joints that it has
    for _ in range(5):
        q, gap = call("closure_step", q, sizes=(len(q), 1))
    assert gap < 1e-13


@pytest.mark.long
def test_a_leg_under_a_free_base_is_that_of_a_fixed_one():
    """Maps, limits and gains do not ask where the base is; exported functions say the same."""
    free, fixed = (
        analysis.actuation(robot, ["knee"], ["motor"]) for robot in (floating_knee(), knee())
    )
    angle = [-0.42]
    here, there = free.at(angle), fixed.at(angle)
    assert free.jacobian(here) == pytest.approx(fixed.jacobian(there), rel=1e-10)
    assert free.jacobian_rate(here, [0.7]) == pytest.approx(
        fixed.jacobian_rate(there, [0.7]), rel=1e-10
    )
    for limits in ("speed_limits", "torque_limits"):
        ours, theirs = getattr(free, limits)(here, 3.0), getattr(fixed, limits)(there, 3.0)
        assert ours.alone == pytest.approx(theirs.alone, rel=1e-10)
        assert ours.most == pytest.approx(theirs.most, rel=1e-10)
    gains = [
        leg.joint_gains(s, 50.0, 2.0, torques=[4.0]) for leg, s in ((free, here), (fixed, there))
    ]
    assert gains[0].kp == pytest.approx(gains[1].kp, rel=1e-9)
    assert gains[0].kd == pytest.approx(gains[1].kd, rel=1e-10)
    exported = {function.name(): function for function in free.functions()}
    # In the base's axes, turned, the leg moves as in a plane.
    other = {function.name(): function for function in fixed.functions()}
    for name in ("jacobian", "jacobian_rate", "joint_inertia"):
        assert exported[name].n_instructions() < 1.1 * other[name].n_instructions()
    moving = here.with_rates(np.linspace(-1, 1, len(here.independent)))
    v = free.compiled.rates(moving)
    for name, wanted in (
        ("jacobian", free.jacobian(here)),
        ("motor_inertia", free.inertia(here, "motors")),
        ("joint_bias", free.bias(moving)),
        ("motor_bias", free.bias(moving, "motors")),
    ):
        given = [v] if name.endswith("bias") else []
        found = np.array(exported[name].call([here.q, *given, []])[0]).ravel()
        assert found == pytest.approx(np.ravel(wanted), rel=1e-11)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: analysis.actuation(3, ANKLE), "the robot is 3"),
        (lambda: analysis.actuation(ankle(), ANKLE[:1]), "1 joints and 2 motors"),
        (lambda: analysis.actuation(ankle(), ["a", "b"]), "no joint rate 'a'"),
        (lambda: analysis.actuation(ankle(), [ANKLE[0]] * 2), "each once"),
        (lambda: analysis.actuation(knee(), ["hip"], ["motor"]), "'motor' moves with"),
        (lambda: analysis.actuation(built("five_bar"), ["motor_1", "elbow_9"]), "'elbow_9'"),
        (
            lambda: analysis.actuation(knee(), ["knee", "upper"], ["hip", "motor"]),
            "does not move independently|closes a loop",
        ),
    ],
)
def test_refusals(call, said):
    with pytest.raises(LinkworkError, match=said):
        call()


def test_refusals_of_the_model(tmp_path):
    model = analysis.actuation(ankle(), ANKLE)
    home = model.robot.home
    for call, said in (
        (lambda: model.at(), "give the coordinates"),
        (lambda: model.at([0, 0], motors=[0, 0]), "give the coordinates"),
        (lambda: model.at([0, 0, 0]), "give ankle.angle_1, ankle.angle_2"),
        (lambda: model.at([0, np.nan]), "the coordinates"),
        (lambda: model.joint_torques(home, [1, 2, 3]), "give motor_left, motor_right"),
        (lambda: model.inertia(home, "feet"), "side is 'feet'"),
        (lambda: model.bias(home, np.array(["joints", "motors"])), r"side is array\("),
        (lambda: model.speed_limits(home, [1, 0]), "speed limits are"),
        (lambda: model.motor_gains(home, [1, 2, 3]), "kp has the shape"),
        (lambda: model.write_c(tmp_path / "leg.txt"), "C is written to a file .c"),
        (lambda: model.jacobian(built("five_bar").home), "state"),
    ):
        with pytest.raises(LinkworkError, match=said):
            call()


def test_at_a_dead_point_the_motor_holds_nothing():
    """The rod's line leads through the knee: the knee moves and the motor does not."""
    model = analysis.actuation(knee(), ["knee"], ["motor"])
    state = at_a_dead_point(model)
    assert abs(model.jacobian(state).item()) < 1e-8
    assert model.joint_torques(state, [1.0]) == pytest.approx([0.0], abs=1e-8)
    with pytest.raises(SingularError, match="motor do not hold knee in this pose"):
        model.motor_torques(state, [1.0])
    both = model.robot.state([model.robot.home.positions, state.positions])
    with pytest.raises(SingularError, match="motor do not hold knee in this pose"):
        model.motor_torques(both, [1.0])
    other = analysis.actuation(knee(), ["motor"], ["knee"])
    with pytest.raises(SingularError, match="motor do not determine the motors knee here"):
        other.jacobian(state)


def at_a_dead_point(model):
    """Return the state of a knee of `knee`, whose rod's line leads through it."""
    across = np.array([0.4, 0.0])
    # The crank's end on its circle, as far from the knee as rod and lever in a line.
    reach = 0.3 + np.hypot(0.05, 0.01)
    cosine = (0.3**2 + 0.06**2 - reach**2) / (2 * 0.3 * 0.06)
    P = np.array([0.1 + 0.06 * cosine, 0.06 * np.sqrt(1 - cosine**2)])
    along = (across - P) / np.linalg.norm(across - P)
    angle = np.arctan2(-along[1], -along[0]) - np.arctan2(0.01, -0.05)
    state = model.robot.home
    for part in np.linspace(state[model.joints[0]], (angle + np.pi) % (2 * np.pi) - np.pi, 20):
        state = model.at([part], guess=state)
    return state


def test_torques_watch_the_loops_that_they_follow_from():
    """A leg's torques are those of the leg alone where another leg, which hangs on the ground, is
    singular, and whatever the other's rates are."""
    legs, alone = two_knees(), analysis.actuation(knee(), ["hip", "knee"], ["hip", "motor"])
    model = analysis.actuation(legs, ["hip_1", "knee_1"], ["hip_1", "motor_1"])
    rates = legs.equations.tree.rates
    assert all(rates[place].endswith("_1") for place in model.map.felt)
    state = at_a_dead_point(analysis.actuation(legs, ["knee_2"], ["motor_2"]))
    v = dict(zip(legs.independent, [0.4, -0.7, 0.0, 0.0], strict=True))
    one = knee().home.with_rates({"hip": v["hip_1"], "motor": v["motor_1"]})
    for side in ("joints", "motors"):
        found = model.bias(state.with_rates(v), side)
        assert found == pytest.approx(alone.bias(one, side), rel=1e-10)


def test_rates_watch_the_loops_that_they_follow_from():
    """What is independent watches none, what depends on all of them all."""
    of = ankle().equations
    assert weakest_of(of, [*of.chart.independent]).is_one()
    both = ca.vertcat(weakest_of(of, [*of.chart.dependent]), of.elimination.pivot)
    found = np.array(ca.Function("pivots", [of.tree.q, of.p], [both])(of.reference + 0.1, []))
    assert found[0] != 1 and found[0] == found[1]
