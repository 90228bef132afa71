"""Gears of lengths: what holds a cable's length, or ties it to another one's, is exact in lengths,
rates and accelerations; MJCF's equalities of spatial tendons are such gears."""

import mujoco as mj
import numpy as np
import pytest

import linkwork as lw
from linkwork.formats import load, save
from linkwork.mechanism import Cable, GearJoint, Mechanism, MechanismError

MODEL = """<mujoco>
<compiler angle="radian"/><option gravity="1 -9.81 -3"/>
<default><geom contype="0" conaffinity="0"/>
 <equality solref="0.001 1" solimp="0.999999 0.999999 1"/></default>
<worldbody>
 <site name="w" pos="-0.2 0.5 0.1"/>
 <geom name="ball" type="sphere" size="0.15" pos="0.1 0.35 0.05"/>
 <geom name="drum" type="cylinder" size="0.1 0.1" pos="-0.3 0.35 0"/>
 <body name="arm"><joint name="a" axis="0 0 1"/>
  <geom type="capsule" size="0.04" fromto="0 0 0 .3 0 0"/>
  <body name="fore" pos="0.3 0 0"><joint name="b" axis="0 0.2 1"/>
   <geom type="capsule" size="0.03" fromto="0 0 0 0.3 0.02 0"/>
   <site name="s1" pos="0.2 0.03 0"/></body></body>
 <body name="load" pos="-0.5 0.1 0.3"><joint name="s" type="slide" axis="0.1 0 1"/>
  <geom type="sphere" size="0.05"/><site name="s2" pos="0 0 0.05"/></body>
</worldbody>
<tendon>
 <spatial name="near"><site site="w"/><geom geom="ball"/><site site="s1"/></spatial>
 <spatial name="far"><site site="w"/><geom geom="drum"/><site site="s2"/></spatial>
 <fixed name="both"><joint joint="b" coef="0.2"/><joint joint="s" coef="1"/></fixed>
</tendon>
<equality>%s</equality>
<actuator><motor joint="a"/></actuator>
</mujoco>"""
TIES = {
    "held": '<tendon name="rope" tendon1="near"/>',
    "two": '<tendon name="rope" tendon1="near" tendon2="far" polycoef="0 -1.5 0.7 0.3 -0.2"/>',
    "joints": '<tendon name="rope" tendon1="near" tendon2="both" polycoef="0 -0.8"/>',
    "square": '<tendon name="rope" tendon1="near" tendon2="both" polycoef="0 -0.8 0.4"/>',
    "sum": '<tendon name="rope" tendon1="both" tendon2="near" polycoef="0 -0.5 0 0.3"/>',
}
AT = {tie: {"a": 0.15, "b": 0.2} for tie in TIES} | {"held": {"a": 0.15, "s": 0.05}}
"""Where their lengths are compared, away from where the file begins."""


def read(tie, tmp_path, name="tied.xml"):
    path = tmp_path / name
    path.write_text(MODEL % TIES[tie])
    return path, load(path).mechanism


def mujoco_at(path, values):
    """MuJoCo's data at rest, at values of the joints, with hardly any softness."""
    model = mj.MjModel.from_xml_path(str(path))
    model.tendon_invweight0[:] *= SOFTNESS
    model.opt.iterations, model.opt.tolerance, model.opt.ls_tolerance = 200, 0.0, 1e-12
    data = mj.MjData(model)
    for name, value in values.items():
        data.joint(name).qpos[0] = value
    mj.mj_forward(model, data)
    return data


def mujoco_accelerations(path, values):
    """Accelerations of MuJoCo at rest by joint, at values of the joints."""
    data = mujoco_at(path, values)
    return {name: data.joint(name).qacc[0] for name in values}


@pytest.mark.sample(1)
@pytest.mark.parametrize("tie", TIES)
def test_equalities_of_tendons_of_cables_are_gears_of_lengths(tie, tmp_path):
    path, mechanism = read(tie, tmp_path)
    assert not mechanism.caveats and isinstance(mechanism.joints["rope"], GearJoint)
    robot = lw.Robot(mechanism)
    assert robot.mobility == 2
    state = robot.assemble(AT[tie])
    values = dict(zip(robot.coordinates, state.positions, strict=True))
    assert robot.closure_error(state) < 1e-12
    want = mujoco_accelerations(path, values)
    found = robot.joint_accelerations(state, robot.forward_dynamics(state, [0.0]))
    assert dict(zip(robot.rates, found, strict=True)) == pytest.approx(want, rel=1e-9, abs=1e-8)
    # Written and read again it is the same mechanism.
    for ending in ("xml", "yaml"):
        save(mechanism, tmp_path / f"again.{ending}")
        again = lw.Robot(load(tmp_path / f"again.{ending}").mechanism)
        same = again.assemble(AT[tie], guess=again.state(values))
        assert again.joint_accelerations(
            same, again.forward_dynamics(same, [0.0])
        ) == pytest.approx(found, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("tie", TIES)
def test_in_motion_accelerations_are_those_of_multipliers_by_differences_of_lengths(tie, tmp_path):
    _, mechanism = read(tie, tmp_path)
    robot = lw.Robot(mechanism)
    state = robot.assemble(AT[tie], rates={name: 1.3 for name in AT[tie]})
    q, w = state.positions, robot.joint_rates(state)
    # Without the gear: M w' + c = G' mu, with G and its change along w from differences of phi.
    joints = {name: joint for name, joint in mechanism.joints.items() if name != "rope"}
    free = lw.Robot(mechanism.model_copy(update={"joints": joints}))
    order = [free.independent.index(name) for name in ("a", "b", "s")]
    path = tmp_path / "tied.xml"
    model = mj.MjModel.from_xml_path(str(path))
    data = mj.MjData(model)
    eq = model.eq_data[0]

    def phi(values):
        data.qpos[:] = values
        mj.mj_fwdPosition(model, data)
        one, two = model.eq_obj1id[0], model.eq_obj2id[0]
        x = data.ten_length[two] - model.tendon_length0[two] if two >= 0 else 0.0
        shown = np.polyval(eq[4::-1], x) if two >= 0 else eq[0]
        return data.ten_length[one] - model.tendon_length0[one] - shown

    def gradient(values, h=1e-3):
        unit = np.eye(3) * h
        return np.array(
            [
                sum(c * (phi(values + k * e) - phi(values - k * e)) for k, c in STENCIL) / h
                for e in unit
            ]
        )

    G = gradient(q)
    assert abs(G @ w) < 1e-9
    bend = sum(c * (gradient(q + k * 1e-3 * w) - gradient(q - k * 1e-3 * w)) for k, c in STENCIL)
    gamma = bend @ w / 1e-3
    at = free.state(dict(zip(("a", "b", "s"), q, strict=True)), dict(zip("abs", w, strict=True)))
    M = free.mass_matrix(at)[np.ix_(order, order)]
    plain = free.forward_dynamics(at, [0.0])[order]
    Y = np.linalg.solve(M, G)
    want = plain - Y * (G @ plain + gamma) / (G @ Y)
    found = robot.joint_accelerations(state, robot.forward_dynamics(state, [0.0]))
    assert found == pytest.approx(want, rel=1e-7, abs=1e-7)


SOFTNESS = 1e-7
"""Part of the softness that MuJoCo gives constraints at the least."""
STENCIL = ((1, 3 / 4), (2, -3 / 20), (3, 1 / 60))
"""Central differences of the sixth order: steps and weights."""


def test_runs_keep_a_held_length_and_their_energy(tmp_path):
    _, mechanism = read("two", tmp_path)
    robot = lw.Robot(mechanism)
    start = robot.assemble({"a": 0.15, "b": 0.2}, rates={"a": 0.5, "b": 0.0})
    run = robot.simulate(start, duration=0.2, rtol=1e-10)
    assert robot.closure_error(run.final) < 1e-12
    energies = [robot.energy(state) for state in (start, run.final)]
    assert sum(energies[0]) == pytest.approx(sum(energies[1]), abs=1e-8)


@pytest.mark.parametrize("tie", TIES)
def test_tensions_at_rest_are_those_of_mujoco(tie, tmp_path):
    path, mechanism = read(tie, tmp_path)
    robot = lw.Robot(mechanism)
    state = robot.assemble(AT[tie])
    at = mujoco_at(path, dict(zip(robot.coordinates, state.positions, strict=True)))
    found = robot.reactions(state, [0.0]).gears["rope"]
    assert found == pytest.approx(at.efc_force[0], rel=1e-6)


def slackened(robot):
    """The same mechanism with forces along what its rope ties, in place of the rope."""
    joints = {name: joint for name, joint in robot.mechanism.joints.items() if name != "rope"}
    drives = (*robot.actuators, *robot.mechanism.joints["rope"].ratios)
    return lw.Robot(robot.mechanism.model_copy(update={"joints": joints, "actuators": drives}))


def pulling(robot, path, state, tension):
    """The state of the mechanism without its rope, and the forces that do what the rope does."""
    values = dict(zip(robot.coordinates, state.positions, strict=True))
    rates = dict(zip(robot.rates, robot.joint_rates(state), strict=True))
    lengths = mujoco_at(path, values).ten_length
    gear, tendons = robot.mechanism.joints["rope"], ("near", "far", "both")
    forces = [0.7]
    for name in gear.ratios:
        slopes = np.polyder([*gear.polynomial(name)[::-1], 0.0])
        forces.append(tension * np.polyval(slopes, lengths[tendons.index(name)]))
    free = slackened(robot)
    return free, free.state(values, rates), forces


@pytest.mark.sample(2)
@pytest.mark.parametrize("tie", TIES)
@pytest.mark.parametrize("rubbing", [False, True], ids=["", "rubbing"])
def test_wrenches_in_joints_are_those_of_forces_along_the_cables(tie, rubbing, tmp_path):
    path, mechanism = read(tie, tmp_path)
    if rubbing:  # the rope presses on the bearing, whose friction changes the rope's tension
        friction = lw.Sliding(coefficient=0.3, rate=1e-3)
        bearing = lw.JournalBearing(friction=friction, radius=0.05, span=0.2)
        hinge = mechanism.joints["a"].model_copy(update={"bearing": bearing})
        mechanism = mechanism.model_copy(update={"joints": {**mechanism.joints, "a": hinge}})
    robot = lw.Robot(mechanism)
    state = robot.assemble(AT[tie], rates={name: 1.3 for name in AT[tie]})
    found = robot.reactions(state, [0.7])
    free, same, forces = pulling(robot, path, state, found.gears["rope"])
    wanted = free.reactions(same, forces)
    np.testing.assert_allclose(found.wrenches, wanted.wrenches, atol=1e-12)
    np.testing.assert_allclose(found.constraint, wanted.constraint, atol=1e-12)
    np.testing.assert_allclose(
        robot.joint_accelerations(state, robot.forward_dynamics(state, [0.7])),
        free.joint_accelerations(same, free.forward_dynamics(same, forces)),
        atol=1e-10,
    )
    function = robot.functions().reactions
    shown = np.array(function(state.q, state.rates, [0.7])[0])
    np.testing.assert_allclose(shown.T, found.wrenches, atol=1e-11)


def test_a_boom_on_a_rope_by_hand():
    """L/2 m g = L T sin(a) about the hinge, which brings the rest of the weight, and T cos(a)."""
    length, mass, g, height = 2.0, 3.0, 9.81, 1.5
    ends = {"ground": (0.0, height, 0.0), "boom": (length, 0.0, 0.0)}
    path = [{"type": "point", "body": body, "point": p} for body, p in ends.items()]
    rope = np.hypot(length, height)
    robot = lw.Robot(
        Mechanism(
            bodies={
                "boom": lw.Body(mass=mass, centre_of_mass=(length / 2, 0, 0)),
                "aside": lw.Body(mass=1.0),
            },
            joints={
                "hinge": lw.RevoluteJoint(connects=("ground", "boom")),
                "slide": lw.PrismaticJoint(connects=("ground", "aside"), axis=(1, 0, 0)),
                "rope": GearJoint(ratios={"line": 2.0}, offset=2 * rope),
            },
            transmissions={"line": Cable(path=path)},
            gravity=(0.0, -g, 0.0),
        )
    )
    found = robot.reactions(robot.home, [])
    tension = mass * g / 2 / (height / rope)
    assert found.gears["rope"] == pytest.approx(-tension / 2)
    wanted = [0, 0, 0, tension * length / rope, mass * g / 2, 0]
    assert found["hinge"] == pytest.approx(wanted, abs=1e-12)


@pytest.mark.sample(1)
@pytest.mark.parametrize("rods", [0, 3])
def test_ropes_bear_a_platform(rods):
    """m (a - g) and the moment of what is there are brought by ropes, and rods, which is all that
    hangs the platform in the ground."""
    random = np.random.default_rng(5)
    feet = np.column_stack([random.normal(size=(6, 2)), 2 + 0.3 * random.normal(size=6)])
    tips = np.column_stack([0.3 * random.normal(size=(6, 2)), 0.1 * random.normal(size=6)])
    ropes = range(rods, 5)
    cables = {
        f"line {k}": Cable(
            path=[
                {"type": "point", "body": "ground", "point": feet[k].tolist()},
                {"type": "point", "body": "platform", "point": tips[k].tolist()},
            ]
        )
        for k in ropes
    }
    lengths = np.linalg.norm(feet - tips, axis=1)
    joints = {
        f"rope {k}": GearJoint(ratios={f"line {k}": 1.0}, offset=lengths[k]) for k in ropes
    } | {
        f"rod {k}": lw.RodJoint(
            connects=("ground", "platform"),
            frames=(lw.Frame(position=feet[k].tolist()), lw.Frame(position=tips[k].tolist())),
            length=lengths[k],
        )
        for k in range(rods)
    }
    if not rods:
        joints["float"] = lw.FreeJoint(connects=("ground", "platform"))
    body = lw.Body(
        mass=2.0, centre_of_mass=(0.05, -0.1, 0.02), inertia=lw.Inertia(xx=0.2, yy=0.3, zz=0.4)
    )
    robot = lw.Robot(
        Mechanism(
            bodies={"platform": body}, joints=joints, transmissions=cables, gravity=(0, 0, -9.81)
        )
    )
    assert robot.mobility == 1
    state = robot.home.with_rates([0.8])
    found = robot.reactions(state, [])
    # How the platform moves: from poses of a short run to and fro.
    step, moves = 1e-3, {0: robot.body_poses(state)["platform"]}
    for k in (-2, -1, 1, 2):
        start = state.with_rates([np.copysign(0.8, k)])
        end = robot.simulate(start, duration=abs(k) * step, rtol=1e-12).final
        moves[k] = robot.body_poses(end)["platform"]
    centre = {k: p + R @ body.centre_of_mass for k, (p, R) in moves.items()}
    second = {-2: -1 / 12, -1: 4 / 3, 0: -5 / 2, 1: 4 / 3, 2: -1 / 12}
    a = sum(c * centre[k] for k, c in second.items()) / step**2
    (p, R), first = moves[0], {-2: 1 / 12, -1: -2 / 3, 1: 2 / 3, 2: -1 / 12}
    dR = sum(c * moves[k][1] for k, c in first.items()) / step
    ddR = sum(c * moves[k][1] for k, c in second.items()) / step**2
    spun, spins = dR @ R.T, ddR @ R.T + dR @ dR.T
    omega, alpha = (np.array([A[2, 1], A[0, 2], A[1, 0]]) for A in (spun, spins))
    inertia = R @ np.diag([0.2, 0.3, 0.4]) @ R.T
    needed = 2.0 * (a - [0, 0, -9.81])
    turned = inertia @ alpha + np.cross(omega, inertia @ omega)
    # What ropes and rods bring: forces from tips to feet.
    force, moment = np.zeros(3), np.zeros(3)
    for k in range(5):
        line = feet[k] - p - R @ tips[k]
        if k in ropes:
            pull = -found.gears[f"rope {k}"] * line / np.linalg.norm(line)
        else:
            pull = found[f"rod {k}"][3:]
        force, moment = force + pull, moment + np.cross(p + R @ tips[k] - centre[0], pull)
    np.testing.assert_allclose(force, needed, atol=1e-6)
    np.testing.assert_allclose(moment, turned, atol=1e-6)
    if not rods:
        assert np.abs(found["float"]).max() < 1e-9


@pytest.mark.parametrize("ending", ["urdf", "sdf"])
def test_files_without_cables_refuse_the_gear(ending, tmp_path):
    _, mechanism = read("held", tmp_path)
    with pytest.raises(lw.LinkworkError, match=r"rope|near"):
        save(mechanism, tmp_path / f"tied.{ending}")


@pytest.mark.parametrize(
    "ratios, words",
    [
        ({"push": 1.0}, "'push' is a thrust, which has no length that can be held"),
        ({"a": 1.0}, "a gear couples at least two coordinates, or a length"),
        ({"pul": 1.0}, "there is no coordinate 'pul'"),
    ],
)
def test_refusals(ratios, words):
    path = [{"type": "point", "body": body} for body in ("ground", "arm")]
    fields = {
        "name": "tied",
        "bodies": {"arm": {"mass": 1.0}},
        "joints": {
            "a": {"type": "revolute", "connects": ["ground", "arm"]},
            "rope": {"type": "gear", "ratios": ratios},
        },
        "transmissions": {
            "push": {"type": "thrust", "body": "arm", "force": [1, 0, 0]},
            "pull": Cable(path=path),
        },
    }
    with pytest.raises(MechanismError, match=words):
        Mechanism(**fields)
