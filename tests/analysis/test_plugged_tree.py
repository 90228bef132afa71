"""Trees without loops in MuJoCo, with a callback or a plug-in in C: their accelerations are those
of the closed robots."""

from __future__ import annotations

import shutil
import sys
from functools import cache
from importlib import util

import numpy as np
import pytest

import linkwork as lw
from linkwork import LinkworkError, analysis
from linkwork.formats import poses

from tests.analysis.legs import ankle, floating_knee, knee
from tests.catalogue import built

mujoco = pytest.importorskip("mujoco")
needs_compiler = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")

ANKLE = ("ankle.angle_1", "ankle.angle_2")
LEGS = {
    "ankle": lambda: analysis.actuation(ankle(), ANKLE),
    "ankle of massless rods": lambda: analysis.actuation(ankle(False), ANKLE),
    "knee": lambda: analysis.actuation(knee(), ["knee"], ["motor"]),
    "floating knee": lambda: analysis.actuation(floating_knee(), ["hip", "knee"]),
    "five-bar": lambda: analysis.actuation(built("five_bar"), ["motor_1", "elbow_1"]),
}


@cache
def leg_of(name):
    """Return an actuation model and its tree."""
    leg = LEGS[name]()
    return leg, leg.tree()


class Plugged:
    """A tree in MuJoCo, by a callback or a plug-in, beside its robot."""

    def __init__(self, name, folder, plugin=False):
        self.leg, self.tree = leg_of(name)
        self.robot = self.leg.robot
        path = folder / "leg.xml"
        if plugin:
            library = self.tree.build_plugin(folder / "leg.so")
            mujoco.mj_loadPluginLibrary(str(library))
        self.notes = self.tree.write_mjcf(path, plugin=plugin)
        self.model = mujoco.MjModel.from_xml_path(str(path))
        self.data = mujoco.MjData(self.model)
        self.callback = None if plugin else self.tree.callback(self.model)
        self.actuators = [self.model.actuator(k).name for k in range(self.model.nu)]

    def forward(self, state=None, u=0.0):
        """Evaluate MuJoCo's accelerations in a state, whose rates are in the tree's joints."""
        if state is not None:
            self.data.qpos[:] = self.qpos(state)
            self.data.qvel[:] = self.qvel(state)
        self.data.ctrl[:] = u
        self.called(mujoco.mj_forward, self.model, self.data)
        return self.data.qacc.copy()

    def called(self, function, *given):
        mujoco.set_mjcb_passive(self.callback)
        try:
            return function(*given)
        finally:
            mujoco.set_mjcb_passive(None)

    def joints(self):
        return [self.model.joint(k) for k in range(self.model.njnt)]

    def qpos(self, state):
        found = np.zeros(self.model.nq)
        for joint in self.joints():
            at = int(joint.qposadr[0])
            if joint.type[0] == mujoco.mjtJoint.mjJNT_FREE:
                p, R = self.robot.body_poses(state)[self.model.body(joint.bodyid[0]).name]
                found[at : at + 7] = *p, *poses.to_quaternion(R)
            else:
                found[at] = state[joint.name]
        return found

    def qvel(self, state, rates=None):
        """Return MuJoCo's rates, or their derivatives by differences along a motion."""
        found = np.zeros(self.model.nv)
        twists = dict(zip(self.robot.bodies, self.robot.twists(state), strict=True))
        rates = dict(zip(self.robot.rates, self.robot.joint_rates(state), strict=True))
        for joint in self.joints():
            at = int(joint.dofadr[0])
            if joint.type[0] == mujoco.mjtJoint.mjJNT_FREE:
                name = self.model.body(joint.bodyid[0]).name
                R, centre = self.robot.body_poses(state)[name][1], self.robot.mechanism.bodies[name]
                omega, v = twists[name][:3], twists[name][3:]
                found[at : at + 3] = v - np.cross(omega, R @ centre.centre_of_mass)
                found[at + 3 : at + 6] = R.T @ omega
            else:
                found[at] = rates[joint.name]
        return found

    def states(self, count, seed=1):
        """Return states about home, with rates of all independent joints."""
        random, home = np.random.default_rng(seed), self.robot.home
        single = [joint.name for joint in self.joints() if joint.type[0] != 0]
        for _ in range(count):
            state = self.robot.assemble(
                {name: float(home[name]) + random.uniform(-0.25, 0.25) for name in single}
            )
            if "base.x" in self.robot.coordinates:
                turn = random.normal(size=4)
                place = [*random.normal(size=3), *turn / np.linalg.norm(turn)]
                parts = ("x", "y", "z", "qw", "qx", "qy", "qz")
                moved = dict(zip(self.robot.coordinates, state.positions.tolist(), strict=True))
                moved |= {f"base.{part}": value for part, value in zip(parts, place, strict=True)}
                state = self.robot.state([moved[name] for name in self.robot.coordinates])
            yield state.with_rates(random.normal(size=len(state.independent)))

    def closed(self, state, u):
        """Return MuJoCo's accelerations as the closed robot has them: by a difference of its rates
        along the motion for bases, whose rates are told in turning axes."""
        forces = dict(zip(self.actuators, u, strict=True))
        a = self.robot.forward_dynamics(state, forces)
        all_a = dict(zip(self.robot.rates, self.robot.joint_accelerations(state, a), strict=True))
        found = np.zeros(self.model.nv)
        for joint in self.joints():
            at = int(joint.dofadr[0])
            if joint.type[0] == mujoco.mjtJoint.mjJNT_FREE:
                found[at : at + 6] = base_acceleration(self.robot, joint.name, state, all_a)
            else:
                found[at] = all_a[joint.name]
        return found


def base_acceleration(robot, name, state, a):
    """Return the acceleration of a free body's origin, in the ground, and R' alpha, from those of
    its joint: F2 sits at c in the body, F1 in ground."""
    near, far = (poses.of_frame(frame) for frame in robot.mechanism.joints[name].frames)
    body = robot.mechanism.joints[name].connects[1]
    R = robot.body_poses(state)[body][1]
    rates = dict(zip(robot.rates, robot.joint_rates(state), strict=True))
    omega = near[:3, :3] @ [rates[f"{name}.w{axis}"] for axis in "xyz"]
    alpha = near[:3, :3] @ [a[f"{name}.w{axis}"] for axis in "xyz"]
    there = near[:3, :3] @ [a[f"{name}.{axis}"] for axis in "xyz"]
    arm = R @ -far[:3, 3]  # from F2 to the body's origin
    origin = there + np.cross(alpha, arm) + np.cross(omega, np.cross(omega, arm))
    return [*origin, *(R.T @ alpha)]


@pytest.mark.parametrize("name", LEGS)
@pytest.mark.parametrize("plugin", [False, pytest.param(True, marks=needs_compiler)])
def test_the_tree_accelerates_as_the_closed_robot(name, plugin, tmp_path):
    engine, random = Plugged(name, tmp_path, plugin), np.random.default_rng(2)
    assert engine.model.neq == 0
    assert engine.model.nv == engine.robot.mobility
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
    engine = Plugged("ankle", tmp_path)
    state = next(engine.states(1))
    wanted = engine.closed(state, np.ones(2))
    engine.callback = None
    assert abs(engine.forward(state, 1.0) - wanted).max() > 0.1 * abs(wanted).max()


@pytest.mark.parametrize("plugin", [False, pytest.param(True, marks=needs_compiler)])
def test_a_second_of_the_tree_is_that_of_the_robot(plugin, tmp_path):
    """MuJoCo's Runge-Kutta steps of a millisecond beside the robot's own run."""
    engine = Plugged("floating knee", tmp_path, plugin)
    state = next(engine.states(1, seed=5))
    engine.forward(state)
    for _ in range(300):
        engine.called(mujoco.mj_step, engine.model, engine.data)
    run = engine.robot.simulate(state, duration=0.3, rtol=1e-10, atol=1e-10)
    last = run.final
    assert engine.data.time == pytest.approx(0.3)
    wanted = engine.qpos(last)
    turned = np.sign(wanted[3:7] @ engine.data.qpos[3:7])
    wanted[3:7] *= turned
    assert engine.data.qpos == pytest.approx(wanted, abs=1e-7)


@pytest.mark.parametrize("plugin", [False, pytest.param(True, marks=needs_compiler)])
@pytest.mark.parametrize("solver", ["mjSOL_NEWTON", "mjSOL_PGS"])
def test_constraints_of_the_engine_feel_the_inertia_of_the_loops(plugin, solver, tmp_path):
    """A joint's limit that is passed: M (a - a_smooth) is its force, with the closed robot's M."""
    engine = Plugged("ankle", tmp_path, plugin)
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
    engine = Plugged("knee", tmp_path, plugin)
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
    engine = Plugged("five-bar", tmp_path)
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


def spinning_ankle():
    """The ankle with balls at both ends of its rods, which then turn about themselves."""
    mechanism = ankle().mechanism
    joints = dict(mechanism.joints)
    for side in ("left", "right"):
        upper = joints[f"upper_{side}"]
        joints[f"upper_{side}"] = lw.SphericalJoint(connects=upper.connects, frames=upper.frames)
    return lw.Robot(mechanism.model_copy(update={"joints": joints}))


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
    model = Plugged("knee", tmp_path).model
    footless = analysis.actuation(footed_knee(), ["hip", "motor"], ["hip", "knee"])
    arms = analysis.actuation(built("five_bar"), ["motor_1", "motor_2"], ["elbow_1", "elbow_2"])
    for call, said in (
        (lambda: analysis.actuation(spinning_ankle(), ANKLE).tree(), "turns about itself"),
        (footless.tree, "'foot' moves behind 'knee', which depends on the joints"),
        (arms.tree, "couple 'motor_[12]' and 'motor_[12]', which are of two branches"),
        (lambda: tree.write_mjcf(tmp_path / "leg.urdf"), "to a file .xml in a folder"),
        (lambda: tree.write_plugin(tmp_path / "gone" / "leg.c"), "to a file .c in a folder"),
        (lambda: tree.callback(other), "the model has no joint 'ankle.angle_1'"),
        (lambda: tree.callback(model), "the model has no joint"),
    ):
        with pytest.raises(LinkworkError, match=said):
            call()
    monkeypatch.setenv("CC", "no_such_compiler")
    with pytest.raises(LinkworkError, match="there is no C compiler"):
        tree.build_plugin(tmp_path / "leg.so")
    monkeypatch.setattr(util, "find_spec", lambda *_: None)
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
