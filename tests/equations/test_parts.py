"""The parts of the derivation: topology, orientations, elimination, welded bodies."""

import operator

import casadi as ca
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from linkwork.equations import derive, functions
from linkwork.equations.algebra import SX, quaternion_matrix
from linkwork.equations.chart import choose_chart
from linkwork.equations.elimination import solve, weakest
from linkwork.equations.independence import choose_independent, independent_rows
from linkwork.equations.orientation import Orientation
from linkwork.equations.topology import span
from linkwork.mechanism import (
    Body,
    FixedJoint,
    Frame,
    FreeJoint,
    Inertia,
    Mechanism,
    PrismaticJoint,
    RevoluteJoint,
)
from linkwork.robots import prr3, stewart

from tests.equations.evaluation import close, values
from tests.oracle.lagrange import LagrangeOracle
from tests.oracle.random_joints import random_loops

BAR = Body(mass=1, centre_of_mass=(0.5, 0, 0), inertia=Inertia(xx=0.01, yy=0.1, zz=0.1))


def chain(topology, body):
    """Return the joints from ground to a body."""
    by_body = {branch.body: branch for branch in topology.branches}
    return [*chain(topology, by_body[body].parent), by_body[body].joint] if body in by_body else []


def test_the_tree_of_the_paper_has_short_chains_and_cuts_two_wrists():
    topology = span(prr3())
    assert topology.cuts == ("wrist_2", "wrist_3")
    assert chain(topology, "platform") == ["slide_1", "pivot_1", "wrist_1"]
    assert topology.loops == 2


@pytest.mark.parametrize(
    "mechanism", [prr3(), stewart(), random_loops(2, gears=1, rods=1, platform="bare")]
)
def test_every_joint_is_used_once(mechanism):
    topology = span(mechanism)
    used = sorted([branch.joint for branch in topology.branches] + list(topology.cuts))
    assert used == sorted([*mechanism.pairs, *topology.added])
    assert sorted(branch.body for branch in topology.branches) == sorted(mechanism.bodies)
    assert len(mechanism.pairs) - len(mechanism.bodies) == topology.loops


def test_a_body_on_rods_alone_and_a_platform_on_ball_joints_hang_on_free_joints():
    assert list(span(random_loops(2, 1, platform="bare")).added) == ["body_6"]
    topology = span(stewart())
    hung = {branch.body: branch.joint for branch in topology.branches}
    assert hung["platform"] == "pose"  # described already: nothing is added
    assert not topology.added


@pytest.mark.parametrize("seed", range(5))
def test_orientations_multiply_as_matrices_do(seed):
    """A random chain of turns and constant rotations, parallel axes among them, against SciPy's
    rotations."""
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
        symbolic, expected = (
            symbolic.then_turn(axis, angles[k]),
            expected * Rotation.from_rotvec(axis * values[k]),
        )
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


def test_hinges_that_are_parallel_on_a_body_that_moves_freely_move_as_in_a_plane():
    """None of their axes is one of the base's: two have the same axes, as SciPy's rotations do."""
    p, angles = SX.sym("p", 4), SX.sym("angle", 4)
    quaternion, values = np.array([0.4, -0.2, 0.8, 0.4]), np.array([0.7, -1.1, 0.3, 1.9])
    tilted, flipped = (Rotation.from_rotvec(v) for v in ([0.3, -0.5, 0.4], [np.pi, 0, 0]))
    x, z = np.eye(3)[0], np.eye(3)[2]
    skew = np.array([0.6, 0.0, 0.8])
    pelvis = Orientation.identity().then_matrix(quaternion_matrix(p))
    pelvis = pelvis.then_constant(tilted.as_matrix())
    turns = [(Rotation.identity(), z), (flipped, z), (Rotation.identity(), x), (flipped, skew)]
    hips = [
        pelvis.then_constant(R.as_matrix()).then_turn(axis, angles[k])
        for k, (R, axis) in enumerate(turns)
    ]
    assert hips[0].axes is hips[1].axes is not hips[2].axes
    first, second = (np.array(hip.axis) for hip in hips[:2])
    assert np.array_equal(first, second) and np.count_nonzero(first) == 1
    base = Rotation.from_quat(quaternion, scalar_first=True) * tilted
    for k, (hip, (R, axis)) in enumerate(zip(hips, turns, strict=True)):
        found = np.array(ca.Function("R", [p, angles], [hip.matrix])(quaternion, values))
        wanted = base * R * Rotation.from_rotvec(values[k] * axis)
        assert np.abs(found - wanted.as_matrix()).max() < 1e-14
        shin = hip.then_turn(axis, angles[0])
        assert shin.axes is hip.axes


def arm(off: float) -> Mechanism:
    """Return an arm of six links, each hinge turned against the one before by a quarter turn and
    what it is off by."""
    names = ["ground", *(f"link_{k}" for k in range(6))]
    joints = {
        f"hinge_{k}": RevoluteJoint(
            connects=(names[k], names[k + 1]),
            frames=(Frame(position=(0.5, 0, 0), rotation=(np.pi / 2 + off, 0, 0)), Frame()),
        )
        for k in range(6)
    }
    return Mechanism(bodies=dict.fromkeys(names[1:], BAR), joints=joints)


def test_quarter_turns_that_are_off_by_rounding_cost_no_operations():
    """Files of CAD have errors of 1e-15 to 7e-15 rad, which are no angles; one of 1e-13 is."""
    q = np.random.default_rng(0).uniform(-1, 1, 6)
    exact, rounded, tilted = (functions.motion(derive(arm(off))) for off in (0.0, 4e-15, 1e-13))
    assert rounded.n_instructions() == exact.n_instructions() < tilted.n_instructions()
    found = [np.array(f(q, q, [], [])[1]) for f in (exact, rounded)]
    assert found[1] == pytest.approx(found[0], rel=1e-12)


def test_elimination_divides_by_lengths_not_by_sines():
    """A leg's link may stand along either axis of the ground without a weak pivot: the rows are
    written in its own axes."""
    equations = derive(prr3())
    assert sorted(len(block.rows) for block in equations.chart.blocks) == [1, 1, 2]
    for pivot in (0.0, np.pi / 2):
        q = equations.reference.copy()
        q[equations.tree.coordinates.index("pivot_2")] = pivot - 2 * np.pi / 3
        maps = values(functions.maps(equations), q)
        assert np.isfinite(maps["L"]).all()
        assert abs(maps["pivot"][0]) > 0.1


def random_system(seed, rows, columns, density=0.4, constants=0.3):
    """Return a sparse matrix of full rank, some of its entries constants, as an expression, its
    symbols and numbers."""
    random = np.random.default_rng(seed)
    while True:
        A = random.normal(size=(rows, columns)) * (random.random((rows, columns)) < density)
        if np.linalg.matrix_rank(A, tol=0.1) == rows:
            break
    fixed = random.random(A.shape) < constants
    places = [(r, c) for r, c in np.argwhere(A) if not fixed[r, c]]
    x, expression = SX.sym("x", len(places)), SX(ca.sparsify(ca.DM(np.where(fixed, A, 0))))
    for k, (r, c) in enumerate(places):
        expression[int(r), int(c)] = x[k]
    return expression, x, A, np.array([A[r, c] for r, c in places])


@pytest.mark.parametrize("seed", range(8))
def test_the_elimination_solves_and_its_pivots_are_one_where_it_was_chosen(seed):
    """Phi_u X = right against NumPy's solver, for sparse systems with blocks of all sizes; then for
    other numbers."""
    Phi, x, A, numbers = random_system(seed, 7, 9)
    random = np.random.default_rng(seed)
    independent = choose_independent(A, ())
    chart = choose_chart(Phi, [A], tuple(range(7)), independent)
    right = random.normal(size=(7, 2))
    X, pivots = solve(chart, Phi, SX(right))
    X = ca.vertcat(*[X[c] for c in chart.dependent])
    evaluate = ca.Function("solve", [x], [X, ca.vertcat(*pivots), Phi])
    there, pivots, _ = map(np.array, evaluate(numbers))
    close(there, np.linalg.solve(A[:, chart.dependent], right), 1e-10)
    close(pivots, np.ones_like(pivots), 1e-12)
    elsewhere, _, B = map(np.array, evaluate(numbers + 0.1 * random.normal(size=numbers.size)))
    close(elsewhere, np.linalg.solve(B[:, chart.dependent], right), 1e-8)


def test_the_sign_of_a_pivot_tells_the_side_of_a_singular_configuration():
    x = SX.sym("x")
    Phi = ca.blockcat([[x, 1, 0.5], [1, x, 0.25]])  # det = x^2 - 1: singular at 1
    chart = choose_chart(Phi, [np.array([[2.0, 1, 0.5], [1, 2.0, 0.25]])], (0, 1), (2,))
    pivot = ca.Function("pivot", [x], [weakest(solve(chart, Phi, SX.zeros(2, 1))[1])])
    assert np.sign([float(pivot(2.0)), float(pivot(0.5))]).tolist() == [1, -1]


def test_rates_beside_one_that_hardly_moves_alone_are_no_more_than_they_are():
    """Three of four rates tell the others, and one moves alone: of the four preferred ones the
    third moves little with the first two at rest, and the fourth not at all with these three."""
    random = np.random.default_rng(0)
    for little in np.geomspace(1e-4, 0.1, 50):
        motions = np.zeros((7, 4))
        motions[:6, :3], motions[6, 3] = random.normal(size=(6, 3)), 1
        motions[2] = motions[0] + motions[1] + little * motions[2]
        Phi = np.linalg.svd(motions.T)[2][4:]
        assert choose_independent(Phi, (0, 1, 2, 3)) == (0, 1, 2, 6)


def test_independent_rates_are_the_preferred_ones_as_far_as_they_determine_the_motion():
    Phi = np.array([[1.0, -1.0, 0.0, 0.0], [0.0, 0.0, 1.0, -1.0]])  # w_0 = w_1, w_2 = w_3
    assert choose_independent(Phi, (1, 0)) in [(1, 2), (1, 3)]
    assert choose_independent(Phi, (3, 0)) == (3, 0)
    assert choose_independent(np.array([[1.0, 0.0]]), (0,)) == (1,)  # a locked rate is none
    for seed in range(20):  # nor is one of which rounding leaves something
        turned = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
        locked = np.insert(turned, 2, 0.0, axis=1)
        assert choose_independent(locked, (0, 1, 3)) == (2,)


@pytest.mark.long
def test_rates_that_no_row_holds_are_chosen_beside_the_others():
    """With columns of zeros the choice among the others is the one without them, in the same order;
    of thousands of rates that nothing holds it takes no longer than their number asks."""
    random = np.random.default_rng(3)
    Phi, places = random.normal(size=(3, 7)), np.array([1, 2, 4, 5, 8, 9, 10])
    wide = np.zeros((3, 12))
    wide[:, places] = Phi
    for preferred in ((), (2, 6), (5, 1, 0)):
        small = choose_independent(Phi, preferred)
        asked = [int(places[k]) for k in preferred]
        found = choose_independent(wide, [*asked[:1], 3, *asked[1:]])
        assert [k for k in found if k in places] == [places[k] for k in small]
        assert sorted(set(found) - {*places.tolist()}) == [0, 3, 6, 7, 11]
        assert found.index(3) == len(asked[:1])
    assert choose_independent(np.zeros((0, 6000)), range(100, 6000))[:2] == (100, 101)


def test_what_floats_alone_is_derived_in_proportion():
    """Bodies that nothing joins: each rate is its own, and no matrix of all of them is filled."""
    bodies = {f"b{i}": Body(mass=1, inertia=Inertia(xx=1, yy=1, zz=1)) for i in range(30)}
    joints = {f"f{name}": FreeJoint(connects=("ground", name)) for name in bodies}
    equations = derive(Mechanism(bodies=bodies, joints=joints))
    assert equations.elimination.L.nnz() == equations.nv == 180
    assert equations.tree.derivative_map.nnz() == 30 * (3 + 12)


def test_dependent_rows_are_left_out():
    a, b = np.array([1.0, 2.0, 0.0, 1.0]), np.array([0.0, 1.0, 1.0, 0.0])
    assert independent_rows([np.array([a, 2 * a, b, a + b])]) == (0, 2)
    accident = np.array([a, a, b])  # dependent in one configuration, not in the next
    assert independent_rows([accident, np.array([a, a + b / 10, b + a[::-1]])]) == (0, 1, 2)
    assert len(independent_rows([np.array([a, 2 * a, b, a + b])], 2)) == 2


def test_a_chart_says_what_it_solves():
    assert derive(prr3()).chart.description == "2 single pivots, blocks of [2]"


def test_welded_bodies_move_as_one():
    """A body cut in two and welded together again has the dynamics of the whole."""
    whole = Body(
        mass=2, centre_of_mass=(0.5, 0.1, 0), inertia=Inertia(xx=0.02, yy=0.3, zz=0.3, xy=0.01)
    )
    hinge = RevoluteJoint(connects=("ground", "a"), axis=(0, 0.6, 0.8))
    weld = FixedJoint(
        connects=("a", "b"), frames=(Frame(position=(0.1, 0.2, 0.3), rotation=(1, 0, 0)), Frame())
    )
    slide = PrismaticJoint(connects=("b", "c"), axis=(1, 0, 0))
    bodies = {"a": BAR, "b": whole, "c": BAR}
    mechanism = Mechanism(
        bodies=bodies,
        joints={"hinge": hinge, "weld": weld, "slide": slide},
        actuators=("hinge", "slide"),
    )
    oracle, equations = LagrangeOracle(mechanism), derive(mechanism)
    q, v, u = np.array([0.3, 0.2]), np.array([1.0, -0.5]), np.array([0.1, 0.2])
    close(
        values(functions.motion(equations), q, v, u)["accelerations"],
        oracle.forward_dynamics(q, v, u),
        1e-12,
    )


@pytest.mark.parametrize("seed", range(6))
def test_each_branch_is_the_first_joint_of_fewest_freedoms_on_the_rim(seed):
    """Prim's rule, by looking through all joints each time, where none is driven or needed."""
    mechanism = random_loops(seed, 3, planar=True).model_copy(update={"actuators": ()})
    topology, depth = span(mechanism), {"ground": 0}
    for branch in topology.branches:
        rim = [
            (len(joint.rates(name)), min(depth[end] for end in joint.connects if end in depth), k)
            for k, (name, joint) in enumerate(mechanism.pairs.items())
            if sum(end in depth for end in joint.connects) == 1
        ]
        assert list(mechanism.pairs)[min(rim)[2]] == branch.joint
        depth[branch.body] = depth[branch.parent] + 1


OTHERS = {
    "expression": SX.sym("y", 3),
    "scalar": SX.sym("y"),
    "sparse": SX(3, 1),
    "number": 2.5,
    "whole": 2,
    "NumPy's": np.float64(2.5),
    "array": np.array([1.0, 2.0, 3.0]),
    "matrix": ca.DM([1.0, 2.0, 3.0]),
}


@pytest.mark.parametrize("other", OTHERS.values(), ids=OTHERS.keys())
@pytest.mark.parametrize("of", ["add plus", "sub minus", "mul times", "truediv rdivide"])
def test_operators_of_expressions_do_what_casadi_s_functions_do(of, other):
    ours, theirs = (
        getattr(room, name) for room, name in zip((operator, ca), of.split(), strict=True)
    )
    x = SX.sym("x", 3)
    for pair in ((x, other), (other, x)):
        combined, told = ours(*pair), theirs(*pair)
        assert str(combined) == str(told)
        assert combined.sparsity() == told.sparsity()


@pytest.mark.parametrize("other", ["1", SX.sym("y", 2), ca.MX.sym("y", 3), None])
def test_operators_of_expressions_refuse_what_casadi_refuses(other):
    with pytest.raises((TypeError, RuntimeError)):
        SX.sym("x", 3) + other
    assert np.array_equal(ca.DM(SX([1, 2])), [[1], [2]])
