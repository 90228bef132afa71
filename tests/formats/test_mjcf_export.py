"""Exported models in MuJoCo move like the mechanism up to MuJoCo's softness, and read back they
move like it exactly.

A soft constraint of impedance d has the regularisation R = (1 - d)/d A, A MuJoCo's estimate of the
inverse inertia that the constraint feels, so that its accelerations are off by about R/A = 1e-4 of
what its force does, and by more where A, an average over directions, is far from the truth. Scaling
A by s scales the error by s: nothing else separates the two.
"""

from functools import cache

import mujoco as mj
import numpy as np
import pytest

import linkwork as lw
from linkwork.formats import load, poses, save
from linkwork.formats.mjcf.model_plan import Home
from linkwork.formats.mjcf.writer import to_mjcf
from linkwork.mechanism import (
    Body,
    CylindricalJoint,
    FixedJoint,
    Frame,
    FreeJoint,
    Friction,
    GearJoint,
    Inertia,
    Limits,
    Mechanism,
    MechanismError,
    PlanarJoint,
    PrismaticJoint,
    RevoluteJoint,
    RodJoint,
    SphericalJoint,
    Spring,
    Tool,
)
from linkwork.mechanism.joints import ManyFreedoms

from tests.formats.mujoco_side import body_accelerations, compiled, set_state
from tests.oracle.maximal import MaximalOracle
from tests.oracle.random_joints import random_loops, random_motion, random_tree

STIFFER = 1e-3
SOLVER = 1e-7
"""What MuJoCo's iterative solver leaves of such stiff constraints, relative to the greatest
acceleration."""
ROBOTS = {  # about twice the measured error as MuJoCo comes, relative to the greatest acceleration
    "prr3": 3e-4,
    "five_bar": 2e-5,
    "n_four_bar": 1e-2,
    "slider_crank": 2e-4,
    "andrews": 1e-4,
    "bennett": 5e-6,
    "spatial_slider_crank": 2e-3,
    "delta": 5e-4,
}


def write(mechanism, tmp_path):
    path = tmp_path / "model.xml"
    return path, save(mechanism, path)


def by_joint(path, robot, state, forces, softness):
    """Return MuJoCo's accelerations of hinges and slides by name; all qpos but those of balls come
    from the state."""
    model, data = compiled(path, softness)
    mj.mj_resetDataKeyframe(model, data, 0)
    values = dict(zip(robot.coordinates, state.positions, strict=True))
    names = [
        name for name in (model.joint(index).name for index in range(model.njnt)) if name in values
    ]
    for name in names:
        data.joint(name).qpos[0] = values[name]
    mj.mj_forward(model, data)
    twists = dict(zip(robot.mechanism.bodies, robot.twists(state).reshape(-1, 2, 3), strict=True))
    body_accelerations(model, data, twists, forces, reset=False)
    return {name: data.joint(name).qacc[0] for name in names}


@pytest.mark.sample(7)
@pytest.mark.parametrize("name", ROBOTS)
def test_mujoco_gives_the_accelerations_up_to_its_softness(name, tmp_path):
    mechanism, rng = getattr(lw.robots, name)(), np.random.default_rng(1)
    robot, (path, _) = lw.Robot(mechanism), write(mechanism, tmp_path)
    kinds = {joint.type for joint in mechanism.joints.values()}
    # of a held tendon MuJoCo leaves out the part of the second derivative that goes with the rates
    at_rest = "rod" in kinds
    state = robot.home.with_rates(rng.normal(size=robot.mobility) * (not at_rest))
    if not kinds & {"spherical", "rod"}:
        start = dict(
            zip(robot.independent, [state[name] for name in robot.independent], strict=True)
        )
        moved = {name: value + rng.uniform(-0.05, 0.05) for name, value in start.items()}
        state = robot.assemble(joints=moved, rates=rng.normal(size=robot.mobility))
    forces = rng.normal(size=len(mechanism.actuators))
    ours = dict(
        zip(
            robot.rates,
            robot.joint_accelerations(state, robot.forward_dynamics(state, forces)),
            strict=True,
        )
    )
    scale = max(map(abs, ours.values()))
    errors = []
    for softness in (1, STIFFER):
        theirs = by_joint(path, robot, state, forces, softness)
        errors.append(max(abs(theirs[joint] - ours[joint]) for joint in theirs) / scale)
    assert errors[0] < ROBOTS[name]
    assert errors[1] < 2 * STIFFER * errors[0] + SOLVER


@pytest.mark.sample(2)
@pytest.mark.parametrize("name", [*ROBOTS, "bricard", "stewart"])
def test_reading_back_gives_the_same_joints_and_the_same_motion(name, tmp_path):
    mechanism, rng = getattr(lw.robots, name)(), np.random.default_rng(2)
    path, _ = write(mechanism, tmp_path)
    back = load(path).mechanism
    kinds = {
        label: joint.type
        for label, joint in mechanism.joints.items()
        if joint.type not in ("fixed", "free")
    }
    assert {
        label: joint.type
        for label, joint in back.joints.items()
        if joint.type not in ("fixed", "free")
    } == kinds
    assert back.actuators == mechanism.actuators
    assert set(back.bodies) == set(mechanism.bodies)
    assert set(back.tools) == set(mechanism.tools)
    near, far = lw.Robot(mechanism), lw.Robot(back)
    rates = dict(zip(near.independent, rng.normal(size=near.mobility), strict=True))
    states = near.home.with_rates(list(rates.values())), far.state(far.home.positions, rates)
    forces = rng.normal(size=len(mechanism.actuators))
    a = [
        dict(
            zip(
                robot.rates,
                robot.joint_accelerations(state, robot.forward_dynamics(state, forces)),
                strict=True,
            )
        )
        for robot, state in zip((near, far), states, strict=True)
    ]
    scale = max(map(abs, a[0].values()))
    for rate in near.independent:
        assert a[1][rate] == pytest.approx(a[0][rate], rel=1e-7, abs=1e-8 * scale)


# -------------------------------------------------------------------- mechanisms of all joint types


def held(mechanism):
    """Return a mechanism without what MJCF holds otherwise: Coulomb friction, springs of turned
    balls."""
    joints = {}
    for name, joint in mechanism.joints.items():
        fields = {}
        if isinstance(joint, ManyFreedoms):
            fields["friction"] = {
                key: Friction(viscous=value.viscous) for key, value in joint.friction.items()
            }
            fields["spring"] = {
                key: value.model_copy(update={"stiffness": value.stiffness * (key != "turn")})
                for key, value in joint.spring.items()
            }
        elif "friction" in type(joint).model_fields:
            fields["friction"] = Friction(viscous=joint.friction.viscous)
        joints[name] = joint.model_copy(update=fields)
    return mechanism.model_copy(update={"joints": joints})


RANDOM = {
    **{
        f"tree {seed}": lambda seed=seed: random_tree(seed, 7, effects=seed % 2 == 0)
        for seed in range(6)
    },
    **{
        f"loops {seed}": lambda seed=seed: random_loops(seed, 2, effects=seed % 2 == 0)
        for seed in range(8)
    },
    **{
        f"planar loops {seed}": lambda seed=seed: random_loops(seed, 2, planar=True)
        for seed in range(2)
    },
    "gears in a tree": lambda: random_tree(1, 7, gears=2),
}
RODS = {
    "rod and gear": lambda: random_loops(0, 1, gears=1, rods=1),
    "platform on rods": lambda: random_loops(0, 1, platform="bare"),
    "free platform on rods": lambda: random_loops(0, 1, platform="free"),
}


@cache
def exported(name, moving=True):
    """Return a mechanism with its text, and the oracle's poses, twists, forces and accelerations at
    home."""
    mechanism, rng = held((RANDOM | RODS)[name]()), np.random.default_rng(5)
    oracle = MaximalOracle(mechanism)
    placed, twists = random_motion(oracle, rng, 0.0)
    if not moving:
        twists = {body: (0 * omega, 0 * v) for body, (omega, v) in twists.items()}
    forces = rng.normal(size=len(mechanism.actuators))
    home = Home(
        {"ground": np.eye(4)} | {body: poses.pose(p, R) for body, (p, R) in placed.items()},
        dict(zip(mechanism.coordinates, oracle.coordinates(placed), strict=True)),
    )
    return (
        mechanism,
        to_mjcf(mechanism, home)[0],
        placed,
        twists,
        forces,
        oracle.accelerations(placed, twists, forces),
    )


def difference(one, other):
    return max(np.max(abs(np.subtract(one[body], other[body]))) for body in one)


def check_in_mujoco(name, moving):
    _, text, _, twists, forces, accelerations = exported(name, moving)
    scale = max(np.max(np.abs(pair)) for pair in accelerations.values())
    errors = [
        difference(body_accelerations(*compiled(text, softness), twists, forces), accelerations)
        / scale
        for softness in (1, STIFFER)
    ]
    assert errors[0] < 1
    assert errors[1] < 1e-3


@pytest.mark.sample(8)
@pytest.mark.parametrize("name", RANDOM)
def test_every_kind_of_joint_in_mujoco(name):
    check_in_mujoco(name, moving=True)


@pytest.mark.parametrize("name", RODS)
def test_rods_in_mujoco_at_rest(name):
    check_in_mujoco(name, moving=False)


@pytest.mark.sample(7)
@pytest.mark.parametrize("name", [*RANDOM, *RODS])
def test_every_kind_of_joint_read_back(name, tmp_path):
    mechanism, text, placed, twists, forces, accelerations = exported(name)
    path = tmp_path / "model.xml"
    path.write_text(text, encoding="utf-8")
    back = load(path).mechanism
    assert list(back.bodies) == sorted(mechanism.bodies, key=list(back.bodies).index)
    assert set(back.actuators) == set(mechanism.actuators)
    for label, joint in mechanism.joints.items():
        if joint.type != "fixed":  # a fixed joint has no name in MJCF
            assert back.joints[label].type == joint.type
    given = [forces[mechanism.actuators.index(rate)] for rate in back.actuators]
    again = MaximalOracle(back).accelerations(placed, twists, given)
    scale = max(np.max(np.abs(pair)) for pair in accelerations.values())
    assert difference(again, accelerations) < 1e-9 * scale
    values = MaximalOracle(back).coordinates(placed)
    ours = dict(zip(back.coordinates, values, strict=True))
    at_home = dict(
        zip(mechanism.coordinates, MaximalOracle(mechanism).coordinates(placed), strict=True)
    )
    for label, value in at_home.items():
        kind = mechanism.joints[label.partition(".")[0]].type
        if back.reference.get(label, 0.0) and kind not in ("spherical", "free"):
            assert ours[label] == pytest.approx(value, abs=1e-9)


# ------------------------------------------------------------------------------------ single things


def slider_crank(**fields):
    """Describe a slider-crank all of whose joints are driven or have effects, so that none can be a
    connect."""
    rod = Body(mass=1.0, centre_of_mass=(0.1, 0, 0), inertia=Inertia(xx=0.01, yy=0.02, zz=0.02))
    joints = {
        "shaft": RevoluteJoint(connects=("ground", "crank")),
        "pin": RevoluteJoint(
            connects=("crank", "rod"),
            frames=(Frame.planar(0.2), Frame()),
            friction=Friction(viscous=0.1),
        ),
        "wrist": RevoluteJoint(
            connects=("rod", "piston"), frames=(Frame.planar(0.5), Frame()), rotor_inertia=0.01
        ),
        "bore": PrismaticJoint(
            connects=("ground", "piston"),
            axis=(1, 0, 0),
            spring=Spring(stiffness=20, rest=0.5, damping=1),
        ),
    }
    return Mechanism(
        bodies={"crank": rod, "rod": rod, "piston": rod},
        joints=joints,
        actuators=("shaft", "bore"),
        tools={"head": Tool(body="piston", frame=Frame.planar(0.1, 0, 0.5))},
        reference={"shaft": 0.6, "pin": -0.8, "wrist": 0.2, "bore": 0.65},
        **fields,
    )


def test_a_joint_that_closes_a_loop_with_effects_leads_to_a_part_of_its_body(tmp_path):
    mechanism = slider_crank()
    path, notes = write(mechanism, tmp_path)
    model, _ = compiled(path)
    parts = [
        model.body(index).name for index in range(model.nbody) if "." in model.body(index).name
    ]
    assert len(parts) == 1
    assert any("leads to a part of its body, welded to it" in note for note in notes)
    assert sum(model.body_mass) == pytest.approx(3.0)
    back = load(path).mechanism
    assert all(body.mass == 1.0 for body in back.bodies.values())
    assert {name: joint.type for name, joint in back.joints.items()} == {
        n: j.type for n, j in mechanism.joints.items()
    }
    assert back.joints["bore"].spring == Spring(stiffness=20, rest=0.5)
    assert back.joints["bore"].friction.viscous == 1


def test_the_exported_model_stands_closed_at_home_with_the_mechanisms_coordinates(tmp_path):
    mechanism = slider_crank()
    path, _ = write(mechanism, tmp_path)
    (model, data), robot = compiled(path), lw.Robot(mechanism)
    mj.mj_forward(model, data)
    np.testing.assert_allclose(data.efc_pos, 0, atol=1e-12)
    for name in mechanism.joints:
        assert data.joint(name).qpos[0] == pytest.approx(robot.home[name], abs=1e-12)
    p, R = robot.body_poses(robot.home)["piston"]
    np.testing.assert_allclose(data.site("head").xpos, p + R @ [0.1, 0, 0], atol=1e-12)
    assert [model.actuator(index).name for index in range(model.nu)] == ["shaft", "bore"]


def test_massless_bodies_inside_a_chain_become_several_joints_of_one_body(tmp_path):
    bar = Body(mass=1.0, centre_of_mass=(0, 0.1, 0), inertia=Inertia(xx=0.02, yy=0.01, zz=0.03))
    joints = {
        "turn": RevoluteJoint(
            connects=("ground", "cross"),
            axis=(0, 1, 1),
            frames=(Frame(position=(0, 0, 1)), Frame()),
        ),
        "tilt": RevoluteJoint(
            connects=("bar", "cross"),
            axis=(1, 0, 0),
            frames=(Frame(position=(0.1, 0, 0)), Frame(position=(0, 0.2, 0))),
        ),
    }
    mechanism = Mechanism(
        bodies={"cross": Body(mass=0.0), "bar": bar},
        joints=joints,
        actuators=("turn",),
        reference={"tilt": 0.4, "turn": 0.2},
    )
    path, notes = write(mechanism, tmp_path)
    model, data = compiled(path)
    assert [model.body(index).name for index in range(model.nbody)] == ["world", "bar"]
    assert any(note.startswith("cross: has no mass") for note in notes)
    robot, back = lw.Robot(mechanism), lw.Robot(load(path).mechanism)
    rates = {"turn": 0.7, "tilt": -1.1}
    values = dict(zip(robot.coordinates, robot.home.positions, strict=True))
    set_state(model, data, values, rates, 0.3)
    for one in (robot, back):
        state = one.state(values, rates)
        a = dict(
            zip(
                one.rates,
                one.joint_accelerations(state, one.forward_dynamics(state, [0.3])),
                strict=True,
            )
        )
        assert a["turn"] == pytest.approx(data.joint("turn").qacc[0], rel=1e-9)
        assert a["tilt"] == pytest.approx(data.joint("tilt").qacc[0], rel=1e-9)


def pendulum(joint, body=None, **fields):
    bodies = {
        "bob": body
        or Body(mass=1.0, centre_of_mass=(0, 0, -0.5), inertia=Inertia(xx=0.02, yy=0.02, zz=0.01))
    }
    return Mechanism(bodies=bodies, joints={"j": joint}, **fields)


NOTED = {
    "Coulomb friction is written as frictionloss": pendulum(
        RevoluteJoint(connects=("ground", "bob"), friction=Friction(coulomb=0.1))
    ),
    "limits of speed are left out": pendulum(
        RevoluteJoint(connects=("ground", "bob"), limits=Limits(speed=1.0))
    ),
    "limits are stops in MuJoCo": pendulum(
        RevoluteJoint(connects=("ground", "bob"), limits=Limits(upper=1.0))
    ),
    "bodies that give zz alone": pendulum(
        RevoluteJoint(connects=("ground", "bob")), Body(mass=1, inertia=Inertia(zz=1))
    ),
    "bodies.bob: has no inertia about some axis": pendulum(
        RevoluteJoint(connects=("ground", "bob")), Body(mass=1, centre_of_mass=(1, 0, 0))
    ),
    "bodies.bob: moves without mass": Mechanism(
        bodies={"bob": Body(mass=0, inertia=Inertia(xx=1, yy=1, zz=1)), "weight": Body(mass=2.0)},
        joints={
            "j": RevoluteJoint(connects=("ground", "bob")),
            "k": PrismaticJoint(connects=("bob", "weight"), axis=(1, 0, 0)),
        },
    ),
    "j: MuJoCo measures the turn of a ball joint from home": pendulum(
        SphericalJoint(connects=("ground", "bob")), reference={"j.qw": 0.8, "j.qx": 0.6}
    ),
}


@pytest.mark.parametrize("words", NOTED)
def test_what_mujoco_takes_otherwise_is_noted(words, tmp_path):
    path, notes = write(NOTED[words], tmp_path)
    assert any(note.startswith(words) for note in notes)
    compiled(path)


def test_limits_and_frictions_come_back(tmp_path):
    joint = CylindricalJoint(
        connects=("ground", "bob"),
        limits={"angle": Limits(lower=-1.0), "slide": Limits(upper=0.5)},
        friction={"slide": Friction(viscous=0.3, coulomb=0.2)},
        rotor_inertia={"angle": 0.05},
        spring={"slide": Spring(stiffness=3, rest=0.1)},
    )
    path, _ = write(pendulum(joint), tmp_path)
    assert load(path).mechanism.joints["j"].effects() == joint.effects()


def test_a_free_body_is_a_freejoint_and_one_with_effects_is_slides_and_a_ball(tmp_path):
    path, _ = write(
        pendulum(FreeJoint(connects=("ground", "bob")), reference={"j.x": 1.0}), tmp_path
    )
    assert compiled(path)[0].nv == 6
    assert load(path).mechanism.reference == {"j.x": 1.0}
    damped = FreeJoint(connects=("ground", "bob"), friction={"y": Friction(viscous=2.0)})
    path, _ = write(pendulum(damped, reference={"j.x": 1.0}), tmp_path)
    back = load(path).mechanism
    assert back.joints["j"].type == "free"
    assert back.joints["j"].friction == {"y": Friction(viscous=2.0)}
    assert back.reference == {"j.x": 1.0}


REFUSED = {
    "bodies.world: is the name that MJCF gives to ground": Mechanism(
        bodies={"world": Body(mass=1)}, joints={"j": RevoluteJoint(connects=("ground", "world"))}
    ),
    "bodies.bob: moves without mass and inertia": pendulum(
        RevoluteJoint(connects=("ground", "bob")), Body(mass=0)
    ),
    "joints.j: has a spring or a limit and is turned at home": pendulum(
        SphericalJoint(connects=("ground", "bob"), spring={"turn": Spring(stiffness=1)}),
        reference={"j.qw": 0.8, "j.qx": 0.6},
    ),
}


@pytest.mark.parametrize("words", REFUSED)
def test_what_mjcf_cannot_hold_is_refused(words):
    mechanism = REFUSED[words]
    oracle = MaximalOracle(mechanism)
    placed = oracle.reference_poses()
    home = Home(
        {"ground": np.eye(4)} | {body: poses.pose(p, R) for body, (p, R) in placed.items()},
        dict(zip(mechanism.coordinates, oracle.coordinates(placed), strict=True)),
    )
    with pytest.raises(MechanismError, match=words):
        to_mjcf(mechanism, home)


def test_a_free_joint_that_closes_a_loop_and_a_fixed_one_are_left_out(tmp_path):
    fields = {"bodies": {"a": Body(mass=1.0, inertia=Inertia(xx=1, yy=1, zz=1))}}
    joints = {
        "hinge": RevoluteJoint(connects=("ground", "a")),
        "pose": FreeJoint(connects=("ground", "a")),
    }
    _, notes = write(Mechanism(joints=joints, **fields), tmp_path)
    assert (
        "joints.pose: holds nothing that the rest of the model does not, and is left out" in notes
    )


def test_a_gear_of_a_free_joints_native_coordinate_is_possible(tmp_path):
    fields = {
        "bodies": {"a": Body(mass=1.0, inertia=Inertia(xx=1, yy=1, zz=1)), "b": Body(mass=1.0)}
    }
    joints = {
        "float": FreeJoint(connects=("ground", "a")),
        "rail": PrismaticJoint(connects=("ground", "b"), axis=(1, 0, 0)),
        "g": GearJoint(ratios={"float.x": 1.0, "rail": -2.0}),
    }
    path, _ = write(Mechanism(joints=joints, **fields), tmp_path)
    assert load(path).mechanism.joints["g"] == joints["g"]


def test_planar_and_rod_and_fixed(tmp_path):
    plate = Body(mass=1.0, inertia=Inertia(xx=0.1, yy=0.1, zz=0.2))
    joints = {
        "table": PlanarJoint(connects=("ground", "plate")),
        "link": RodJoint(
            connects=("ground", "plate"), length=0.5, frames=(Frame.planar(0.5), Frame())
        ),
        "knob": FixedJoint(
            connects=("plate", "knob"), frames=(Frame(position=(0, 0, 0.1)), Frame())
        ),
    }
    mechanism = Mechanism(
        bodies={"plate": plate, "knob": plate},
        joints=joints,
        reference={"table.x": 0.1, "table.y": 0.3},
    )
    path, _ = write(mechanism, tmp_path)
    back = load(path).mechanism
    assert back.joints["link"].length == pytest.approx(0.5, abs=1e-12)
    assert back.joints["table"].type == "planar"
    assert lw.Robot(back).mobility == lw.Robot(mechanism).mobility == 2


def test_a_chain_too_deep_is_refused():
    bodies = {f"b{k}": Body(mass=1.0, inertia=Inertia(xx=1, yy=1, zz=1)) for k in range(300)}
    joints = {
        f"j{k}": RevoluteJoint(connects=("ground" if k == 0 else f"b{k - 1}", f"b{k}"))
        for k in range(300)
    }
    home = Home({body: np.eye(4) for body in ("ground", *bodies)}, dict.fromkeys(joints, 0.0))
    with pytest.raises(MechanismError, match="a chain of more than 240 bodies is too deep"):
        to_mjcf(Mechanism(bodies=bodies, joints=joints), home)


# ------------------------------------------------------------- balls, and bodies of next to nothing

BRICK = Body(
    mass=1.3, centre_of_mass=(0.1, 0.05, -0.1), inertia=Inertia(xx=0.03, yy=0.04, zz=0.05, xy=0.004)
)
TURNED = {"position": (0.2, -0.1, 0.3), "rotation": (0.3, -0.5, 0.4)}


def test_a_ball_that_slides_follow_in_a_loop_has_a_body_of_its_own(tmp_path):
    """A damped free joint that is described from the body to ground is a ball and three slides in
    MuJoCo."""
    joints = {
        "float": FreeJoint(connects=("a", "ground"), friction={"x": Friction(viscous=0.5)}),
        "near": SphericalJoint(
            connects=("ground", "b"), frames=(Frame(position=(0.5, 0, 0)), Frame())
        ),
        "far": SphericalJoint(
            connects=("b", "a"), frames=(Frame(position=(0, 0.7, 0)), Frame(**TURNED))
        ),
    }
    reference = {"float.x": -0.3, "float.y": -0.6, "float.qw": 0.8, "float.qz": 0.6}
    mechanism = Mechanism(bodies={"a": BRICK, "b": BRICK}, joints=joints, reference=reference)
    path, notes = write(mechanism, tmp_path)
    model, _ = compiled(path)
    (ball,) = (joint for joint in map(model.joint, range(model.njnt)) if joint.name == "float.turn")
    assert model.body(ball.bodyid[0]).name == "a.float.turn"
    assert model.body_mass[ball.bodyid[0]] < 1e-7
    assert any(note.startswith("a.float.turn: is a body of") for note in notes)
    assert lw.Robot(load(path).mechanism).mobility == lw.Robot(mechanism).mobility == 6


def chain(second, **fields):
    """Describe a massless body on a ball, which leads to ground, and a brick on a second joint."""
    ball = SphericalJoint(connects=("cross", "ground"), frames=(Frame(), Frame(**TURNED)))
    bodies = {"cross": Body(mass=0.0), "brick": BRICK}
    return Mechanism(bodies=bodies, joints={"ball": ball, "second": second}, **fields)


def test_a_driven_ball_whose_body_vanishes_is_driven_in_its_own_sense():
    slide = PrismaticJoint(
        connects=("cross", "brick"), axis=(0.6, 0, 0.8), frames=(Frame(**TURNED), Frame())
    )
    mechanism = chain(
        slide, actuators=("ball.wx", "ball.wz"), reference={"ball.qw": 0.8, "ball.qy": 0.6}
    )
    oracle, rng = MaximalOracle(mechanism), np.random.default_rng(3)
    placed, twists = random_motion(oracle, rng, 0.0)
    home = Home(
        {"ground": np.eye(4)} | {body: poses.pose(p, R) for body, (p, R) in placed.items()},
        dict(zip(mechanism.coordinates, oracle.coordinates(placed), strict=True)),
    )
    model, data = compiled(to_mjcf(mechanism, home)[0])
    exact = oracle.accelerations(placed, twists, [0.7, -0.4])["brick"]
    found = body_accelerations(model, data, {"brick": twists["brick"]}, [0.7, -0.4])["brick"]
    np.testing.assert_allclose(found, exact, rtol=1e-6, atol=1e-6)


def test_a_turn_after_a_ball_keeps_the_massless_body_between_them(tmp_path):
    hinge = RevoluteJoint(connects=("cross", "brick"), axis=(0.6, 0, 0.8))
    path, notes = write(chain(hinge), tmp_path)
    model, _ = compiled(path)
    assert [model.body(index).name for index in range(model.nbody)] == ["world", "cross", "brick"]
    assert any(note.startswith("bodies.cross: moves without mass") for note in notes)


def test_what_is_added_to_light_bodies_is_enough_for_mujoco(tmp_path):
    feather = Body(mass=1e-3, inertia=Inertia(xx=1e-9, yy=1e-9, zz=1e-9))
    joints = {
        "stem": PrismaticJoint(connects=("ground", "fork"), axis=(0, 0, 1)),
        "left": RevoluteJoint(connects=("fork", "a")),
        "right": RevoluteJoint(connects=("fork", "b")),
    }
    mechanism = Mechanism(
        bodies={"fork": Body(mass=0.0), "a": feather, "b": feather}, joints=joints
    )
    path, _ = write(mechanism, tmp_path)
    assert compiled(path)[0].body("fork").mass[0] < 1e-10
