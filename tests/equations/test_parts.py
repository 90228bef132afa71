"""The parts of the derivation: topology, orientations, rows, charts, redundancy."""

import casadi as ca
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from linkwork.equations import derive, functions
from linkwork.equations.algebra import SX
from linkwork.equations.orientation import Orientation
from linkwork.equations.topology import span
from linkwork.mechanism import Body, FixedJoint, Frame, Inertia, Mechanism, PrismaticJoint, RevoluteJoint
from linkwork.robots import prr3

from tests.oracle.closed_forms import DoublePendulum, SliderCrank
from tests.oracle.lagrange import LagrangeOracle

BAR = Body(mass=1, centre_of_mass=(0.5, 0, 0), inertia=Inertia(xx=0.01, yy=0.1, zz=0.1))


def test_the_tree_of_the_paper_has_short_chains_and_cuts_two_wrists():
    topology = span(prr3())
    assert topology.cuts == ("wrist_2", "wrist_3")
    assert [branch.joint for branch in topology.chain("platform")] == ["slide_1", "pivot_1", "wrist_1"]
    assert topology.loops == 2


def test_every_joint_is_used_once():
    topology = span(prr3())
    assert sorted([branch.joint for branch in topology.branches] + list(topology.cuts)) == sorted(prr3().joints)


@pytest.mark.parametrize("seed", range(5))
def test_orientations_multiply_as_matrices_do(seed):
    """A random chain of turns and constant rotations, parallel axes among them, against SciPy's rotations."""
    random = np.random.default_rng(seed)
    axes = [np.array([0, 0, 1.0]), random.normal(size=3)]
    axes = [axis / np.linalg.norm(axis) for axis in axes]
    angles = SX.sym("angle", 8)
    values = random.uniform(-2, 2, 8)
    symbolic, expected = Orientation.identity(), Rotation.identity()
    for k in range(8):
        if random.random() < 0.4:
            constant = Rotation.from_rotvec(
                random.normal(size=3) if random.random() < 0.5 else axes[0] * random.normal()
            )
            symbolic, expected = symbolic.then_constant(constant.as_matrix()), expected * constant
        axis = axes[int(random.integers(2))] * random.choice([-1, 1])
        symbolic, expected = symbolic.then_turn(axis, angles[k]), expected * Rotation.from_rotvec(axis * values[k])
    found = np.array(ca.Function("R", [angles], [symbolic.matrix])(values))
    assert np.abs(found - expected.as_matrix()).max() < 1e-13


def test_parallel_axes_add_their_angles():
    a, b = SX.sym("a"), SX.sym("b")
    z = np.array([0, 0, 1.0])
    tilted = Rotation.from_rotvec(0.7 * z).as_matrix()
    R = Orientation.identity().then_turn(z, a).then_constant(tilted).then_turn(-z, b)
    counted = ca.Function("R", [a, b], [R.matrix])
    operations = [counted.instruction_id(k) for k in range(counted.n_instructions())]
    assert operations.count(ca.OP_SIN) == 1
    assert operations.count(ca.OP_COS) == 1


def test_a_planar_mechanism_loses_its_rows_out_of_the_plane_symbolically():
    equations = derive(prr3())
    assert len(equations.rows.names) == 4
    assert all("position across the axis" in name for name in equations.rows.names)


def parallelogram(cranks=3):
    """Return a coupler on parallel cranks of equal length: one freedom, and one row too many for each crank beyond two."""
    bodies = {f"crank_{i}": BAR for i in range(cranks)} | {"coupler": BAR}
    joints, reference = {}, {}
    for i in range(cranks):
        joints[f"base_{i}"] = RevoluteJoint(connects=("ground", f"crank_{i}"), frames=(Frame.planar(0.7 * i), Frame()))
        joints[f"top_{i}"] = RevoluteJoint(
            connects=(f"crank_{i}", "coupler"), frames=(Frame.planar(1), Frame.planar(0.7 * i))
        )
        reference |= {f"base_{i}": 1.0, f"top_{i}": -1.0}
    return Mechanism(bodies=bodies, joints=joints, actuators=("base_0",), reference=reference)


def test_redundant_rows_are_found_and_named():
    equations = derive(parallelogram())
    assert equations.mobility == 1
    assert len(equations.redundant) == 1
    assert equations.redundant[0].startswith("top_")
    q, v = equations.reference, np.array([0.4])
    _, acceleration, _ = functions.motion(equations)(q, v, [0.3])
    oracle = LagrangeOracle(parallelogram())
    expected = oracle.forward_dynamics(oracle.reference, v, np.array([0.3]))
    assert np.allclose(np.array(acceleration).ravel(), expected, atol=1e-11)


def test_a_spatial_description_of_a_planar_loop_has_no_row_too_many():
    """The same parallelogram tilted in space: out-of-plane rows do not vanish symbolically, and are found redundant."""
    tilt = Frame(rotation=(0.3, -0.5, 0.2))
    joints = dict(parallelogram(2).joints)
    joints["stand"] = FixedJoint(connects=("ground", "stand"), frames=(tilt, Frame()))
    for name in ("base_0", "base_1"):
        joints[name] = joints[name].model_copy(update={"connects": ("stand", joints[name].connects[1])})
    flat = parallelogram(2)
    mechanism = flat.model_copy(
        update={"joints": joints, "bodies": dict(flat.bodies) | {"stand": Body(mass=1)}, "gravity": (0, 0, 0)}
    )
    flat = flat.model_copy(update={"gravity": (0, 0, 0)})
    tilted, plain = derive(mechanism), derive(flat)
    assert tilted.mobility == plain.mobility == 1
    found = functions.motion(tilted)(tilted.reference, [0.4], [0.3])[1]
    expected = functions.motion(plain)(plain.reference, [0.4], [0.3])[1]
    assert np.allclose(float(found), float(expected), atol=1e-11)


@pytest.mark.parametrize("form", [DoublePendulum(), SliderCrank()], ids=["double pendulum", "slider-crank"])
def test_closed_forms(form):
    equations = derive(form.mechanism())
    inverse = functions.inverse_dynamics(equations)
    n = equations.mobility
    random = np.random.default_rng(1)
    for _ in range(5):
        v, a = random.normal(size=(2, n))
        if n == 1:
            theta = random.uniform(-1, 1)
            all_joints = form.coordinates(theta)
            names = [name for name, joint in form.mechanism().joints.items() if joint.type != "fixed"]
            q = np.array([all_joints[names.index(name)] for name in equations.tree.coordinates])
            expected = form.force(theta, v[0], a[0])
        else:
            q = random.normal(size=n)
            expected = form.force(q, v, a)
        assert np.allclose(np.array(inverse(q, v, a)[0]).ravel(), expected, rtol=1e-11, atol=1e-11)


def test_elimination_divides_by_lengths_not_by_sines():
    """A leg's link may stand along either axis of the ground without a weak pivot: the rows are written in its own axes."""
    equations = derive(prr3())
    assert sorted(len(block.rows) for block in equations.chart.blocks) == [1, 1, 2]
    closure, maps = functions.closure_step(equations), functions.maps(equations)
    for pivot in (0.0, np.pi / 2):
        q = equations.reference.copy()
        q[equations.tree.coordinates.index("pivot_2")] = pivot - 2 * np.pi / 3
        L, _, smallest = maps(q)
        assert np.isfinite(np.array(L)).all()
        assert float(smallest) > 0
    assert closure.n_out() == 2


def test_welded_bodies_move_as_one():
    """A body cut in two and welded together again has the dynamics of the whole."""
    whole = Body(mass=2, centre_of_mass=(0.5, 0.1, 0), inertia=Inertia(xx=0.02, yy=0.3, zz=0.3, xy=0.01))
    hinge = RevoluteJoint(connects=("ground", "a"), axis=(0, 0.6, 0.8))
    weld = FixedJoint(connects=("a", "b"), frames=(Frame(position=(0.1, 0.2, 0.3), rotation=(1, 0, 0)), Frame()))
    slide = PrismaticJoint(connects=("b", "c"), axis=(1, 0, 0))
    bodies = {"a": BAR, "b": whole, "c": BAR}
    mechanism = Mechanism(
        bodies=bodies, joints={"hinge": hinge, "weld": weld, "slide": slide}, actuators=("hinge", "slide")
    )
    oracle, equations = LagrangeOracle(mechanism), derive(mechanism)
    q, v, u = np.array([0.3, 0.2]), np.array([1.0, -0.5]), np.array([0.1, 0.2])
    found = np.array(functions.motion(equations)(q, v, u)[1]).ravel()
    assert np.allclose(found, oracle.forward_dynamics(q, v, u), atol=1e-12)
