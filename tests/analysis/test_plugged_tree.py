"""Trees without loops in MuJoCo, with a callback or a plug-in in C: their accelerations are those
of the closed robots."""

from __future__ import annotations

import shutil
import subprocess
import sys
from copy import copy
from functools import cache

import numpy as np
import pytest

import linkwork as lw
from linkwork import LinkworkError, analysis

from tests.analysis.legs import ankle, floating_knee, knee, spinning_ankle
from tests.catalogue import built
from tests.processes import PATIENCE
from tests.products import sampled

mujoco = pytest.importorskip("mujoco")
from tests.analysis.plugged import Plugged  # noqa: E402

needs_compiler = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")

ANKLE = ("ankle.angle_1", "ankle.angle_2")
LEGS = {
    "ankle": lambda: analysis.actuation(ankle(), ANKLE),
    "ankle of massless rods": lambda: analysis.actuation(ankle(False), ANKLE),
    "ankle of rods that spin": lambda: analysis.actuation(spinning_ankle(), ANKLE),
    "knee": lambda: analysis.actuation(knee(), ["knee"], ["motor"]),
    "floating knee": lambda: analysis.actuation(floating_knee(), ["hip", "knee"]),
    "five-bar": lambda: analysis.actuation(built("five_bar"), ["motor_1", "elbow_1"]),
}


@cache
def leg_of(name):
    """Return an actuation model and its tree."""
    leg = LEGS[name]()
    return leg, leg.tree()


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    ("plugin", "name"),
    [
        pytest.param(plugin, name, marks=needs_compiler if plugin else ())
        for plugin, name in sampled((False, True), tuple(LEGS))
    ],
)
def test_the_tree_accelerates_as_the_closed_robot(name, plugin, tmp_path):
    engine, random = Plugged(*leg_of(name), tmp_path, plugin), np.random.default_rng(2)
    assert engine.model.neq == 0
    assert engine.model.nv == engine.robot.mobility - len(engine.robot.spins)
    for state in engine.states(5):
        u = random.normal(size=engine.model.nu) * 5
        wanted = engine.closed(state, u)
        found = engine.forward(state, u)
        assert abs(found - wanted).max() < 1e-11 * abs(wanted).max()
        # The motors' tendons stand and move as the motors do.
        rates = dict(zip(engine.robot.rates, engine.robot.joint_rates(state), strict=True))
        for k, motor in enumerate(engine.actuators):
            gap = engine.data.actuator_length[k] - float(state[motor])
            assert abs(np.sin(gap / 2)) < 1e-11
            assert engine.data.actuator_velocity[k] == pytest.approx(rates[motor], abs=1e-11)


def test_without_the_callback_the_tree_moves_otherwise(tmp_path):
    engine = Plugged(*leg_of("ankle"), tmp_path)
    state = next(engine.states(1))
    wanted = engine.closed(state, np.ones(2))
    engine.callback = None
    assert abs(engine.forward(state, 1.0) - wanted).max() > 0.1 * abs(wanted).max()


@pytest.mark.sample(2)
@pytest.mark.parametrize("plugin", [False, pytest.param(True, marks=needs_compiler)])
@pytest.mark.parametrize("name", ["floating knee", "ankle of rods that spin"])
def test_a_run_of_the_tree_is_that_of_the_robot(name, plugin, tmp_path):
    """MuJoCo's Runge-Kutta steps of a millisecond beside the robot's own run."""
    engine = Plugged(*leg_of(name), tmp_path, plugin)
    state = next(engine.states(1, seed=5))
    engine.forward(state)
    for _ in range(300):
        engine.called(mujoco.mj_step, engine.model, engine.data)
    run = engine.robot.simulate(state, duration=0.3, rtol=1e-10, atol=1e-10)
    last = run.final
    assert engine.data.time == pytest.approx(0.3)
    wanted = engine.qpos(last)
    if name == "floating knee":
        wanted[3:7] *= np.sign(wanted[3:7] @ engine.data.qpos[3:7])
    assert engine.data.qpos == pytest.approx(wanted, abs=1e-7)


@pytest.mark.sample(3)
@pytest.mark.parametrize("plugin", [False, pytest.param(True, marks=needs_compiler)])
@pytest.mark.parametrize("solver", ["mjSOL_NEWTON", "mjSOL_PGS"])
def test_constraints_of_the_engine_feel_the_inertia_of_the_loops(plugin, solver, tmp_path):
    """A joint's limit that is passed: M (a - a_smooth) is its force, with the closed robot's M."""
    engine = Plugged(*leg_of("ankle"), tmp_path, plugin)
    engine.model.opt.solver = int(getattr(mujoco.mjtSolver, solver))
    engine.model.jnt_limited[:] = True
    engine.model.jnt_range[:] = [[-0.01, 0.01]] * 2
    state = next(engine.states(1))
    engine.forward(state)
    assert engine.data.nefc
    pushed = engine.data.qacc - engine.data.qacc_smooth
    M = engine.leg.inertia(state)
    assert M @ pushed == pytest.approx(engine.data.qfrc_constraint, rel=1e-6)
    whole = np.zeros((2, 2))
    mujoco.mj_fullM(engine.model, engine.data, whole)
    assert whole == pytest.approx(M, rel=1e-12)


@pytest.mark.parametrize("plugin", [False, pytest.param(True, marks=needs_compiler)])
def test_stages_that_are_left_out_and_other_data_do_not_count_twice(plugin, tmp_path):
    engine = Plugged(*leg_of("knee"), tmp_path, plugin)
    one, two = engine.states(2)
    first = engine.forward(one, 1.0)
    for stage in ("mjSTAGE_POS", "mjSTAGE_NONE", "mjSTAGE_POS"):
        skipped = int(getattr(mujoco.mjtStage, stage))
        engine.called(mujoco.mj_forwardSkip, engine.model, engine.data, skipped, 0)
        assert engine.data.qacc == pytest.approx(first, rel=1e-13)
    other, kept = mujoco.MjData(engine.model), engine.data
    engine.data = other
    assert engine.forward(two, 1.0) == pytest.approx(engine.closed(two, np.ones(2)), rel=1e-11)
    engine.data = kept
    assert engine.forward(one, 1.0) == pytest.approx(first, rel=1e-13)
    copied = mujoco.MjData(engine.model)
    mujoco.mj_copyData(copied, engine.model, other)
    engine.data = copied
    assert engine.forward(two, 1.0) == pytest.approx(engine.closed(two, np.ones(2)), rel=1e-11)


def test_loops_are_led_far_and_what_cannot_be_closed_is_told(tmp_path):
    engine = Plugged(*leg_of("five-bar"), tmp_path)
    home, turned = engine.robot.home, 1.3
    far = engine.leg.at([float(home["motor_1"]) - turned, float(home["elbow_1"])])
    state = engine.robot.in_chart(far, engine.tree.joints).with_rates([0.4, -0.3])
    found = engine.forward(state)
    a = engine.robot.forward_dynamics(state, [0.0, 0.0])
    assert found == pytest.approx(a, rel=1e-10)
    engine.data.qpos[:] = float(home["motor_1"]), 1.0  # the arm's end is too far out
    with pytest.warns(UserWarning, match="loops cannot be closed"):
        engine.called(mujoco.mj_forward, engine.model, engine.data)
    assert np.isnan(engine.data.qacc).all()


def test_copies_of_a_model_are_known_and_other_models_left_alone(tmp_path):
    engine = Plugged(*leg_of("ankle"), tmp_path)
    state = next(engine.states(1))
    wanted = engine.forward(state, 1.0)
    engine.model = copy(engine.model)
    engine.data = mujoco.MjData(engine.model)
    assert (engine.forward(state, 1.0) == wanted).all()
    other = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><body><joint name='a'/><geom size='.1'/></body></worldbody></mujoco>"
    )
    data = mujoco.MjData(other)
    engine.called(mujoco.mj_forward, other, data)
    assert not data.qfrc_passive.any()


def test_servos_at_the_motors_are_those_of_the_description(tmp_path):
    """A position servo's law acts on the motor's own angle."""
    law = {"type": "servo", "gain": 20.0, "bias_position": -20.0, "bias_rate": -0.5}
    drives = {"motor": law}
    robot = lw.Robot(knee().mechanism.model_copy(update={"drives": drives}))
    tree = analysis.actuation(robot, ["knee"], ["motor"]).tree()
    tree.write_mjcf(tmp_path / "leg.xml")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "leg.xml"))
    data = mujoco.MjData(model)
    data.qvel[:] = [0.3, -0.8]
    names = [model.actuator(k).name for k in range(model.nu)]
    data.ctrl[names.index("motor")] = 1.7
    mujoco.set_mjcb_passive(tree.callback(model))
    try:
        mujoco.mj_forward(model, data)
    finally:
        mujoco.set_mjcb_passive(None)
    leg = analysis.actuation(robot, ["knee"], ["motor"])
    rate = leg.motor_rates(robot.home, [-0.8]).item()
    wanted = 20 * (1.7 - float(robot.home["motor"])) - 0.5 * rate
    assert data.actuator_force[names.index("motor")] == pytest.approx(wanted, rel=1e-10)


def footed_knee():
    """The leg of `knee` with a foot on its shank."""
    mechanism = knee().mechanism
    foot = lw.RevoluteJoint(connects=("shank", "foot"), frames=(lw.Frame.planar(0.4), lw.Frame()))
    body = lw.Body(mass=0.5, inertia=lw.Inertia(zz=0.01))
    return lw.Robot(
        mechanism.model_copy(
            update={
                "bodies": {**mechanism.bodies, "foot": body},
                "joints": {**mechanism.joints, "foot": foot},
            }
        )
    )


def test_refusals(tmp_path, monkeypatch):
    leg, tree = leg_of("ankle")
    other = mujoco.MjModel.from_xml_string("<mujoco/>")
    model = Plugged(*leg_of("knee"), tmp_path).model
    footless = analysis.actuation(footed_knee(), ["hip", "motor"], ["hip", "knee"])
    half = analysis.actuation(
        ankle(), ["ankle.angle_1", "motor_left"], ["motor_right", "motor_left"]
    )
    arms = analysis.actuation(built("five_bar"), ["motor_1", "motor_2"], ["elbow_1", "elbow_2"])
    for call, said in (
        (footless.tree, "'foot' moves behind 'knee', which depends on the joints"),
        (half.tree, "'ankle.angle_1' is a freedom of a joint whose others depend on it"),
        (arms.tree, "couple 'motor_[12]' and 'motor_[12]', which are of two branches"),
        (lambda: tree.write_mjcf(tmp_path / "leg.urdf"), "to a file .xml in a folder"),
        (lambda: tree.write_plugin(tmp_path / "gone" / "leg.c"), "to a file .c in a folder"),
        (lambda: tree.callback(other), "the model has no joint 'ankle.angle_1'"),
        (lambda: tree.callback(model), "the model has no joint"),
        (lambda: tree.callback("leg.xml"), "the model is 'leg.xml'; give a mujoco.MjModel"),
    ):
        with pytest.raises(LinkworkError, match=said):
            call()
    monkeypatch.setenv("CC", "no_such_compiler")
    with pytest.raises(LinkworkError, match="there is no C compiler"):
        tree.build_plugin(tmp_path / "leg.so")
    monkeypatch.setattr("linkwork.analysis.mujoco_plugin.find_spec", lambda *_: None)
    with pytest.raises(LinkworkError, match="needs MuJoCo's headers"):
        tree.build_plugin(tmp_path / "leg.so")
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(LinkworkError, match="needs MuJoCo; install"):
        tree.callback(other)
    assert leg.motors == tree.motors


@needs_compiler
def test_what_the_compiler_says_is_told(tmp_path):
    from linkwork.analysis.mujoco_plugin import built as compiled

    with pytest.raises(LinkworkError, match=r"does not make the plug-in: .*error"):
        compiled("int x = ;", tmp_path / "leg.so")
    with pytest.raises(LinkworkError, match="which is no folder"):
        compiled("int x;", tmp_path / "gone" / "leg.so")


@needs_compiler
def test_the_plug_in_is_plain_c_of_its_own(tmp_path):
    """Strict C99 without a warning, which has nothing of CasADi's."""
    from linkwork.analysis.mujoco_plugin import engine

    _, tree = leg_of("ankle")
    source, include = tree.write_plugin(tmp_path / "leg.c"), engine()[0]
    assert "casadi" not in source.read_text()
    command = ["cc", "-std=c99", "-Wall", "-Wextra", "-Wshadow", "-Werror", "-fsyntax-only"]
    subprocess.run([*command, "-isystem", include, source], check=True, timeout=PATIENCE)


@needs_compiler
def test_a_library_is_told_by_its_whole_path(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    _, tree = leg_of("knee")
    assert tree.build_plugin("leg.so") == tmp_path.resolve() / "leg.so"
