"""Mechanisms written with six decimals: their redundant rows stay open by rounding, and they move
as the exact ones do."""

from functools import cache

import mujoco
import numpy as np
import pytest
from scipy.linalg import null_space

import linkwork as lw
from linkwork import robots
from linkwork.equations import derive
from linkwork.equations.lengths import own_length
from linkwork.errors import ModelWarning
from linkwork.formats import save
from linkwork.mechanism import (
    Body,
    FixedJoint,
    Frame,
    Inertia,
    Mechanism,
    MechanismError,
    RevoluteJoint,
    SphericalJoint,
)

from tests.hostile.changes import rounded, scaled, spatial
from tests.oracle.maximal import MaximalOracle
from tests.oracle.random_joints import tilted
from tests.products import first


def spherical(angles=(0.7, 1.1, 0.9)) -> Mechanism:
    """A loop of four hinges whose axes meet in a point 1 m off their frames: three rows of six are
    redundant."""
    frames = [Frame(position=(0, 0, -1))]
    ends = [
        Frame(position=tuple(np.array([0, np.sin(a), -np.cos(a)])), rotation=(a, 0, 0))
        for a in angles
    ]
    body = Body(mass=0.5, centre_of_mass=(0.1, 0.2, -0.8), inertia=Inertia(xx=0.2, yy=0.2, zz=0.1))
    names = ["ground", "crank", "coupler", "rocker"]
    joints = {"hinge_1": RevoluteJoint(connects=("ground", "crank"), frames=(frames[0], frames[0]))}
    for i, end in enumerate(ends[:2], start=1):
        joints[f"hinge_{i + 1}"] = RevoluteJoint(
            connects=(names[i], names[i + 1]), frames=(end, frames[0])
        )
    back = Frame(position=tuple(np.array([0, np.sin(1.3), -np.cos(1.3)])), rotation=(1.3, 0, 0))
    joints["hinge_4"] = RevoluteJoint(connects=("ground", "rocker"), frames=(back, ends[2]))
    reference = {
        "hinge_1": 1.19019805,
        "hinge_2": -0.44414325,
        "hinge_3": -1.79208441,
        "hinge_4": -2.03478605,
    }
    bodies = dict.fromkeys(names[1:], body)
    return Mechanism(bodies=bodies, joints=joints, actuators=("hinge_1",), reference=reference)


EXACT = {
    "bennett": robots.bennett,
    "tilted bricard": lambda: tilted(spatial(robots.bricard()), 2),
    "spherical": lambda: tilted(spherical(), 4),
    "tilted wrist": lambda: tilted(spatial(robots.agile_wrist()), 3),
}
OPEN = ("bennett", "tilted bricard", "spherical")


@cache
def pair(name: str) -> tuple[lw.Robot, lw.Robot]:
    """The robot with all its digits and the one with six decimals."""
    exact = EXACT[name]()
    return lw.Robot(exact), lw.Robot(rounded(exact))


def gap(mechanism: Mechanism, positions: np.ndarray) -> float:
    """The largest gap of a joint [m, rad], found in coordinates of all bodies."""
    oracle = MaximalOracle(mechanism, dict(zip(mechanism.coordinates, positions, strict=True)))
    residuals = oracle.residuals(oracle.poses(oracle.near))
    return max(float(np.abs(part).max(initial=0)) for part in residuals.values())


@pytest.mark.sample(2)
@pytest.mark.parametrize("name", EXACT)
def test_six_decimals_have_the_mobility_and_the_accelerations_of_all_digits(name):
    exact, decimal = pair(name)
    assert (decimal.mobility, len(decimal.redundant)) == (exact.mobility, len(exact.redundant))
    rates = np.full(exact.mobility, 0.7)
    expected, found = (
        one.joint_accelerations(
            state, one.forward_dynamics(state, np.full(len(one.actuators), 0.1))
        )
        for one in (exact, decimal)
        for state in [one.state(one.home.positions, rates)]
    )
    assert decimal.independent == exact.independent
    np.testing.assert_allclose(found, expected, atol=1e-4 * np.abs(expected).max())


@pytest.mark.parametrize("name", OPEN)
def test_a_note_names_the_rows_that_rounding_leaves_open_and_the_gap_is_told(name):
    _, decimal = pair(name)
    (note,) = decimal.notes
    assert "redundant rows stay open" in note and any(row in note for row in decimal.redundant)
    told = float(decimal.closure_error(decimal.home))
    true = gap(decimal.mechanism, decimal.home.positions)
    assert 1e-8 < told < 1e-6
    assert 0.1 * true < told < 10 * true
    with pytest.warns(ModelWarning, match="redundant rows stay open"):
        lw.Robot(decimal.mechanism)


def test_loops_that_close_to_rounding_warn_of_nothing(recwarn):
    exact, _ = pair(next(iter(EXACT)))
    assert not exact.equations.caveats and exact.equations.rows.unheld is None
    lw.Robot(exact.mechanism)
    assert not [each for each in recwarn if issubclass(each.category, ModelWarning)]


ROUGH = {
    "tilted bennett": lambda: tilted(robots.bennett(), 2),
    "tilted bricard": lambda: tilted(spatial(robots.bricard()), 1),
    "tilted 3-PRR": lambda: tilted(spatial(robots.prr3()), 2),
    "spherical": lambda: tilted(spherical(), 1),
    "bennett": robots.bennett,
    "agile wrist": lambda: tilted(spatial(robots.agile_wrist()), 1),
    "ladder": lambda: tilted(spatial(robots.n_four_bar()), 1),
}


@pytest.mark.sample(3)
@pytest.mark.parametrize("name", first(4, tuple(ROUGH)))
def test_six_decimals_and_a_rough_reference_go_together(name):
    """The gap is that of numbers rounded by 5e-7 each, which add up around the loop; the freedoms
    are those of all digits."""
    exact = ROUGH[name]()
    random = np.random.default_rng(5)
    off = {
        label: value + 0.02 * random.standard_normal() for label, value in exact.reference.items()
    }
    decimal, whole = derive(rounded(exact).model_copy(update={"reference": off})), derive(exact)
    assert (decimal.mobility, len(decimal.redundant)) == (whole.mobility, len(whole.redundant))
    positions = decimal.tree.evaluated("x", [decimal.joints.positions()])(decimal.reference)[0]
    assert gap(decimal.mechanism, np.array(positions).ravel()) < 2e-5


def test_the_limit_grows_with_the_loop_not_with_its_smallest_part():
    """Bennett's linkage open by some 2e-6 m is read where its links are 1 m long, and refused at a
    tenth of that."""
    exact = tilted(robots.bennett(), 1)
    assert derive(rounded(exact)).notes
    with pytest.raises(MechanismError, match="stays open by"):
        derive(rounded(scaled(exact, length=0.05)))


@pytest.mark.parametrize("name", OPEN)
def test_a_run_with_six_decimals_reaches_its_end_beside_the_exact_one_and_tells_its_gap(name):
    exact, decimal = pair(name)
    runs = [one.simulate(one.home, duration=1.0, save_at=[0.5, 1.0]) for one in (exact, decimal)]
    assert all(run.success for run in runs)
    expected, found = (run.variables["joint_position"].values for run in runs)
    np.testing.assert_allclose(found, expected, atol=1e-4)
    true = max(gap(decimal.mechanism, positions) for positions in found)
    saved = runs[1].variables["closure_error"].values
    assert 0.1 * true < saved.max() <= runs[1].closure_error < 1e-5
    assert runs[0].closure_error < 1e-12


def test_the_members_of_an_ensemble_tell_the_gap_of_rows_that_are_not_held():
    _, decimal = pair("bennett")
    starts = decimal.state(np.stack([decimal.home.positions] * 2), np.array([[0.0], [1.0]]))
    found = decimal.ensemble(starts, duration=0.2, save_at=[0.1, 0.2])
    true = [gap(decimal.mechanism, positions) for positions in found.final.positions]
    assert (found.closure_error > 0.1 * np.array(true)).all() and (found.closure_error < 1e-6).all()


def test_a_redundant_loop_that_is_really_open_is_refused():
    exact = robots.bennett()
    hinge = exact.joints["hinge_2"]
    far = hinge.frames[0].model_copy(
        update={"position": (hinge.frames[0].position[0] + 5e-4, 0.0, 0.0)}
    )
    joints = exact.joints | {"hinge_2": hinge.model_copy(update={"frames": (far, hinge.frames[1])})}
    with pytest.raises(MechanismError, match="stays open by"):
        lw.Robot(exact.model_copy(update={"joints": joints}))


def test_a_free_number_that_opens_the_rows_that_are_not_held_is_refused():
    decimal = pair("bennett")[1].free("joints.hinge_2.frames.0.position.0")
    (path,) = decimal.parameters
    with pytest.raises(MechanismError, match="stays open by"):
        decimal.with_parameters({path: decimal.parameters[path] + 5e-4})


def drawn(tilt: float) -> Mechanism:
    """A four-bar that closes as it is drawn, at zero angles, one of its axes tilted."""
    points = {"left": (0, 0, 0), "top": (0.3, 0.4, 0), "end": (0.9, 0.6, 0), "right": (1, 0, 0)}
    frames = {
        name: Frame(position=place, rotation=(tilt if name == "top" else 0.0, 0, 0))
        for name, place in points.items()
    }
    bodies = ("ground", "crank", "coupler", "rocker", "ground")
    body = Body(mass=0.5, centre_of_mass=(0.4, 0.3, 0), inertia=Inertia(xx=0.02, yy=0.02, zz=0.03))
    joints = {
        name: RevoluteJoint(connects=(bodies[i], bodies[i + 1]), frames=(frame, frame))
        for i, (name, frame) in enumerate(frames.items())
    }
    return Mechanism(
        bodies=dict.fromkeys(bodies[1:4], body),
        joints=joints,
        actuators=("left",),
        gravity=(0, -9.81, 0),
    )


@pytest.mark.parametrize("tilt", first(2, [3e-10, 3e-7, 3e-8]))
def test_a_linkage_that_closes_as_drawn_and_opens_by_rounding_as_it_moves_runs_to_its_end(tilt):
    exact, decimal = lw.Robot(drawn(0.0)), lw.Robot(drawn(tilt))
    assert decimal.mobility == 1 and len(decimal.redundant) == 3
    (note,) = decimal.notes
    assert "redundant rows stay open" in note
    moved = decimal.assemble({"left": 0.3})
    np.testing.assert_allclose(moved.positions, exact.assemble({"left": 0.3}).positions, atol=1e-6)
    runs = [
        one.simulate(one.home.with_rates([1.0]), duration=0.5, save_at=[0.25, 0.5])
        for one in (exact, decimal)
    ]
    assert all(run.success for run in runs)
    expected, found = (run.variables["joint_position"].values for run in runs)
    np.testing.assert_allclose(found, expected, atol=1e-5)
    true = max(gap(decimal.mechanism, positions) for positions in found)
    assert 0.1 * tilt < true and 0.1 * true < runs[1].closure_error < 10 * tilt


@pytest.mark.parametrize("make", [robots.four_bar, robots.bennett])
def test_a_reference_with_seven_digits_of_a_loop_that_closes_is_closed_to_rounding_without_a_note(
    make,
):
    home = lw.Robot(make()).home.positions
    robot = lw.Robot(
        make().with_reference(
            dict(zip(make().coordinates, np.round(home, 7).tolist(), strict=True))
        )
    )
    assert robot.closure_error(robot.home) < 1e-12 and not robot.notes
    np.testing.assert_allclose(robot.home.positions, home, atol=1e-6)


@pytest.mark.parametrize("size", [1e18, 1e26])
@pytest.mark.parametrize("name", ["prr3", "delta", "stewart"])
def test_inertias_far_too_great_leave_the_length_and_the_freedoms(name, size):
    mechanism = getattr(robots, name)()
    bodies = {
        key: body.model_copy(update={"inertia": Inertia(xx=size, yy=size, zz=size)})
        for key, body in mechanism.bodies.items()
    }
    heavy = mechanism.model_copy(update={"bodies": bodies})
    assert own_length(heavy) == own_length(mechanism)
    if name == "prr3":
        assert derive(heavy).mobility == 3


@pytest.mark.parametrize("tilt", [1e-6, 1e-5])
def test_one_row_that_a_rounded_axis_makes_of_none_does_not_hold_a_linkage_still(tilt):
    """A four-bar whose last joint is a ball: in the plane one row is redundant; where an axis is
    off by its sixth or fifth digit that row closes only where nothing moves."""

    def balled(tilt: float) -> lw.Robot:
        linkage = drawn(tilt)
        last = linkage.joints["right"]
        ball = SphericalJoint(connects=last.connects, frames=last.frames)
        pendulum = RevoluteJoint(connects=("ground", "pendulum"))
        return lw.Robot(
            linkage.model_copy(
                update={
                    "bodies": linkage.bodies | {"pendulum": linkage.bodies["crank"]},
                    "joints": linkage.joints | {"right": ball, "swing": pendulum},
                }
            )
        )

    exact, decimal = balled(0.0), balled(tilt)
    assert decimal.mobility == exact.mobility == 2
    assert [note for note in decimal.equations.caveats if "redundant rows stay open" in note]
    runs = [one.simulate(one.home, duration=0.3, save_at=[0.3]) for one in (exact, decimal)]
    assert all(run.success for run in runs)
    expected, found = ([run.final[name] for name in ("left", "top", "swing")] for run in runs)
    np.testing.assert_allclose(found, expected, atol=10 * tilt)
    assert 0.1 * tilt < runs[1].closure_error < 10 * tilt


@pytest.mark.parametrize("tilt", [0.0, 1e-3])
def test_an_actuator_that_a_tilted_axis_holds_still_is_told(tilt, tmp_path):
    """Beside a pendulum, which moves: a four-bar linkage none of whose motions is left where one
    axis is a thousandth off. MuJoCo's own rows say whether its crank can move."""
    linkage = drawn(tilt)
    pendulum = RevoluteJoint(connects=("ground", "pendulum"))
    beside = linkage.model_copy(
        update={
            "bodies": linkage.bodies | {"pendulum": linkage.bodies["crank"]},
            "joints": linkage.joints | {"swing": pendulum},
            "actuators": ("left", "swing"),
        }
    )
    robot = lw.Robot(beside)
    told = [note for note in robot.equations.caveats if "hold still" in note]
    path = tmp_path / "beside.xml"
    save(robot.mechanism, path)
    model = mujoco.MjModel.from_xml_path(str(path))
    model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    rows = data.efc_J.reshape(-1, model.nv)[: data.ne]
    free = null_space(rows, rcond=1e-6)
    movable = np.linalg.norm(free[model.joint("left").dofadr[0]]) > 1e-9
    assert (robot.mobility, free.shape[1], movable) == (
        (2, 2, True) if tilt == 0 else (1, 1, False)
    )
    assert not told if movable else "'left' drives" in told[0] and "swing" not in told[0]


def test_an_actuator_of_what_a_lock_holds_is_none_that_is_told():
    beside = drawn(0.0)
    swing = RevoluteJoint(connects=("ground", "pendulum"))
    locked = beside.model_copy(
        update={
            "bodies": beside.bodies | {"pendulum": beside.bodies["crank"]},
            "joints": beside.joints
            | {"swing": swing, "lock": FixedJoint(connects=("ground", "pendulum"))},
            "actuators": ("left", "swing"),
        }
    )
    robot = lw.Robot(locked)
    assert robot.mobility == 1 and not robot.equations.caveats
