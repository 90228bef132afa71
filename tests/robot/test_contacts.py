"""Contacts against closed forms, geometry and identities."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

import linkwork as lw
from linkwork.equations import functions
from linkwork.equations.algebra import quaternion_matrix, rotation_matrix
from linkwork.equations.surfaces import cell_at, spline

from tests.equations.evaluation import close, values

TIGHT = {"rtol": 1e-11, "atol": 1e-13}
R, m, g = 0.1, 0.4, 9.81
I = 0.4 * m * R**2  # noqa: E741
BALL = lw.Body(mass=m, inertia=lw.Inertia(xx=I, yy=I, zz=I))
SPHERE = lw.Sphere(radius=R)
PLANE = lw.Plane()
FREE = lw.FreeJoint(connects=("ground", "ball"))


def on_floor(surface=PLANE, gravity=(0.0, 0.0, -g), ball=SPHERE, **law) -> lw.Robot:
    """Return a free ball and what it may meet, fixed in ground."""
    law = {"stiffness": 1e6} | law
    floor = lw.Contact(connects=("ground", "ball"), surfaces=(surface, ball), **law)
    return lw.Robot(
        lw.Mechanism(
            bodies={"ball": BALL}, joints={"f": FREE}, contacts={"floor": floor}, gravity=gravity
        )
    )


def at(robot: lw.Robot, position, rates=(0.0, 0.0, 0.0), turning=(0.0, 0.0, 0.0)) -> lw.State:
    return robot.state([*position, 1, 0, 0, 0]).with_rates([*rates, *turning])


def ran(robot: lw.Robot, state: lw.State, duration: float, **options) -> lw.Run:
    run = robot.simulate(state, duration=duration, **TIGHT | options)
    assert run.status is lw.Status.FINISHED, run.message
    close(run["energy_balance"].values, np.zeros(len(run.time)), 1e-8)
    return run


@pytest.mark.parametrize("exchanged", [False, True])
def test_a_ball_bounces_off_a_wall_that_stands_askew(exchanged):
    """The rate along the normal is turned round times the restitution, the others stay."""
    wall = lw.Frame(position=(0.3, 0.2, 0), rotation=(0.4, -1.1, 0.3))
    n = rotation_matrix(wall.rotation)[:, 2]
    surfaces = (lw.Plane(frame=wall), SPHERE)
    contact = lw.Contact(
        connects=("ball", "ground") if exchanged else ("ground", "ball"),
        surfaces=surfaces[::-1] if exchanged else surfaces,
        stiffness=1e5,
        restitution=0.7,
        impact_rate=2.0,
    )
    robot = lw.Robot(
        lw.Mechanism(
            bodies={"ball": BALL},
            joints={"f": FREE},
            contacts={"wall": contact},
            gravity=(0.0, 0.0, 0.0),
        )
    )
    along = np.cross(n, [1.0, 2.0, 3.0])
    start = np.array(wall.position) + (R + 0.2) * n
    run = ran(robot, at(robot, start, along - 2.0 * n), 0.4)
    close(run["joint_rate"].values[-1, :3], along + 1.4 * n, 1e-6)
    close(run["joint_rate"].values[-1, 3:], np.zeros(3), 1e-12)
    assert list(run.coords["event"].values) == ["wall: contact begins", "wall: contact ends"]
    force = run["contact_force"].values[:, 0]
    outwards = -1 if exchanged else 1
    assert (outwards * force @ n).max() > 10 and (outwards * force @ n).min() > -1e-12


def test_a_ball_slides_and_then_rolls():
    """m v' = -F, I w' = h F with the smoothed Coulomb force F: the slip u goes by the closed form
    sqrt(u^2 + r^2) - r artanh(r / sqrt(u^2 + r^2)) = that at the start - a t, and the ball rolls on
    with v_0 / (1 + m h^2 / I), at h above where it touches."""
    mu, r, v_0, k = 0.2, 1e-6, 2.0, 1e6
    robot = on_floor(stiffness=k, dissipation=1.0, friction=lw.Sliding(coefficient=mu, rate=r))
    depth = (m * g / k) ** (1 / 1.5)
    h = R - depth / 2
    share = 1 + m * h**2 / I
    stops = v_0 / share / (mu * g)
    times = np.array([0.3 * stops, 0.9 * stops, 1.1 * stops, 1.5 * stops])
    start = at(robot, (0, 0, R - depth), (v_0, 0, 0))
    run = ran(robot, start, times[-1], save_at=times)
    v, w = run["joint_rate"].values[:, 0], run["joint_rate"].values[:, 4]
    slip = v - h * w
    expected = v_0 - share * mu * g * times
    close(slip[:2], expected[:2], 1e-6)
    close(v[2:], np.full(2, v_0 * (1 - 1 / share)), 1e-6)
    close(slip[2:], np.zeros(2), 1e-6)
    force = run["contact_force"].values[:, 0]
    close(force[:2], np.array([[-mu * m * g, 0, m * g]] * 2), 1e-6)


def test_a_block_stops_where_friction_has_taken_its_energy():
    """Stribeck's friction takes all of it: v v' = -g (m_c + (m_s - m_c) exp(-(v / s)^2))."""
    law = lw.Sliding(coefficient=0.3, static=0.5, stribeck_rate=0.4, rate=1e-6)
    size, k = (0.2, 0.1, 0.05), 1e6
    body = lw.Body(mass=m, inertia=lw.Inertia(xx=1e-3, yy=1e-3, zz=1e-3))
    contact = lw.Contact(
        connects=("ground", "ball"),
        surfaces=(lw.Plane(), lw.Box(size=size)),
        stiffness=k,
        exponent=1.0,
        friction=law,
    )
    robot = lw.Robot(
        lw.Mechanism(
            bodies={"ball": body, "carrier": lw.Body(mass=0.0)},
            joints={
                "z": lw.PrismaticJoint(connects=("ground", "carrier")),
                "xy": lw.PlanarJoint(connects=("carrier", "ball")),
            },
            contacts={"sole": contact},
        )
    )
    depth = m * g / (4 * k)
    state = robot.state([size[2] / 2 - depth, 0, 0, 0]).with_rates([0, 1.0, 0, 0])
    assert list(robot.names.meetings) == [f"sole.{i}: contact" for i in range(1, 9)]
    v = np.linspace(0, 1, 20001)
    way = v / (g * (0.3 + 0.2 * np.exp(-((v / 0.4) ** 2))))
    stops = np.trapezoid(np.where(v > 0, way / np.where(v > 0, v, 1), 1 / (g * 0.5)), v)
    run = ran(robot, state, 1.2 * stops, save_at=np.array([0.0, 1.2 * stops]))
    went = run["joint_position"].sel(coordinate="xy.x").values[-1]
    close(went, np.trapezoid(way, v), 2e-6)


def test_balls_that_collide():
    """Momentum is kept, and they part with the restitution of their approach, whatever their
    masses."""
    small = lw.Body(mass=0.1, inertia=lw.Inertia(xx=1e-3, yy=1e-3, zz=1e-3))
    contact = lw.Contact(
        connects=("ball", "small"),
        surfaces=(SPHERE, lw.Sphere(radius=0.05)),
        stiffness=1e5,
        restitution=0.5,
        impact_rate=2.4,
    )
    robot = lw.Robot(
        lw.Mechanism(
            bodies={"ball": BALL, "small": small},
            joints={"f": FREE, "e": lw.FreeJoint(connects=("ground", "small"))},
            contacts={"hit": contact},
            gravity=(0.0, 0.0, 0.0),
        )
    )
    line = np.array([0.6, 0.8, 0.0])
    begin = 0.3 * line
    state = robot.state([0, 0, 0, 1, 0, 0, 0, *begin, 1, 0, 0, 0])
    state = state.with_rates([*(1.0 * line), 0, 0, 0, *(-1.4 * line), 0, 0, 0])
    w = ran(robot, state, 0.2).dataset["joint_rate"].values[-1]
    close(m * w[:3] + 0.1 * w[6:9], (m - 0.14) * line, 1e-9)
    close(w[6:9] - w[:3], 1.2 * line, 1e-6)


def gap_of(first, second, place) -> float:
    contact = lw.Contact(connects=("ground", "ball"), surfaces=(first, second), stiffness=1.0)
    robot = lw.Robot(
        lw.Mechanism(bodies={"ball": BALL}, joints={"f": FREE}, contacts={"pair": contact})
    )
    return float(robot.observe(robot.state(place)).gap("pair: contact"))


@pytest.mark.parametrize("kinds", ["sphere capsule", "capsule sphere", "capsule capsule"])
def test_gaps_of_round_bodies_are_least_distances(kinds):
    """Between segments, by least squares over both within their ends."""
    random = np.random.default_rng(4)
    for _ in range(6):
        frames = [
            lw.Frame(position=tuple(random.normal(size=3)), rotation=tuple(random.normal(size=3)))
            for _ in range(2)
        ]
        shapes = [
            lw.Sphere(radius=0.1, frame=frame)
            if kind == "sphere"
            else lw.Capsule(radius=0.2, length=1.5, frame=frame)
            for kind, frame in zip(kinds.split(), frames, strict=True)
        ]
        q = random.normal(size=4)
        place = [*random.normal(size=3), *(q / np.linalg.norm(q))]
        turn = np.array(ca.DM(quaternion_matrix(ca.SX(place[3:]))))
        ends = []
        for shape, frame in zip(shapes, frames, strict=True):
            half = 0.75 if isinstance(shape, lw.Capsule) else 0.0
            own = rotation_matrix(frame.rotation) @ np.array([0, 0, half])
            ends.append([np.array(frame.position) - own, np.array(frame.position) + own])
        ends[1] = [np.array(place[:3]) + turn @ end for end in ends[1]]

        def distance(st, ends=ends):
            p, q = ((1 - s) * a + s * b for s, (a, b) in zip(st, ends, strict=True))
            return np.sum((p - q) ** 2)

        best = min(
            minimize(distance, [s, t], bounds=[(0, 1)] * 2, tol=1e-15).fun
            for s in (0, 0.5, 1)
            for t in (0, 0.5, 1)
        )
        expected = np.sqrt(best) - sum(shape.radius for shape in shapes)
        close(gap_of(*shapes, place), expected, 1e-7)


def wavy(n: int = 5) -> lw.HeightField:
    x = np.arange(n) * 0.2
    heights = 0.05 * np.sin(3 * x[:, None]) * np.cos(2 * x[None, :])
    return lw.HeightField(
        heights=tuple(map(tuple, heights.tolist())),
        spacing=(0.2, 0.2),
        frame=lw.Frame(position=(-0.4, -0.4, 0.0), rotation=(0.0, 0.0, 0.3)),
    )


def height(field, x, y):
    cell = cell_at(field, ca.vertcat(x, y))
    return spline(cell.P, cell.t)


def test_a_field_goes_through_its_heights_and_a_level_slope_is_a_plane():
    field = wavy()
    x = ca.SX.sym("x", 2)
    h = ca.Function("h", [x], [height(field, x[0], x[1])])
    found = [[float(h([0.2 * i, 0.2 * j])) for j in range(5)] for i in range(5)]
    close(found, field.heights, 1e-14)
    slope = lw.HeightField(heights=((0.0, 0.0), (0.1, 0.1)), spacing=(1.0, 1.0))
    angle = np.arctan(0.1)
    plane = lw.Plane(frame=lw.Frame(rotation=(0.0, -angle, 0.0)))
    place = [0.4, 0.5, 0.3, 1, 0, 0, 0]
    close(gap_of(slope, SPHERE, place) * np.cos(angle), gap_of(plane, SPHERE, place), 1e-14)


@pytest.mark.parametrize("counts", [(2, 2), (3, 9), (17, 4), (21, 33)])
def test_a_field_is_the_natural_spline_of_other_software(counts):
    """Within cells and along their borders, both edges included, with its slopes."""
    rng = np.random.default_rng(sum(counts))
    heights, spacing = rng.normal(size=counts), (0.3, 0.7)
    field = lw.HeightField(heights=heights.tolist(), spacing=spacing)
    x = ca.SX.sym("x", 2)
    h = height(field, x[0], x[1])
    told = ca.Function("h", [x], [h, ca.gradient(h, x)])
    places = rng.uniform(size=(40, 2)) * (np.array(counts) - 1)
    places[:20, 0] = rng.integers(counts[0], size=20)
    places[10:30, 1] = rng.integers(counts[1], size=20)
    for place in places:
        rows = CubicSpline(range(counts[0]), heights, bc_type="natural")
        along = [
            CubicSpline(range(counts[1]), rows(place[0], order), bc_type="natural")
            for order in (0, 1)
        ]
        slopes = along[1](place[1]) / spacing[0], along[0](place[1], 1) / spacing[1]
        inside = (place > 0) & (place < np.array(counts) - 1)
        value, slope = told(place * spacing)
        close(float(value), float(along[0](place[1])), 1e-13)
        close(slope.full().ravel()[inside], np.array(slopes)[inside], 1e-12)


def test_derivatives_of_a_field_do_not_grow_with_it():
    x = ca.SX.sym("x", 2)
    lengths = []
    for count in (20, 60):
        field = lw.HeightField(heights=np.ones((count, count)).tolist(), spacing=(1.0, 1.0))
        h = height(field, x[0], x[1])
        second = ca.hessian(h, x)[0]
        value, all_three = ca.Function("h", [x], [h]), ca.Function("d", [x], [h, second])
        lengths.append(all_three.n_instructions() - value.n_instructions())
        assert value.n_instructions() < 5 * (count + 12) ** 2
    assert lengths[1] < 1.1 * lengths[0] < 1000


def test_a_ball_runs_over_a_field_and_keeps_its_energy():
    robot = on_floor(wavy(), stiffness=1e5)
    run = ran(robot, at(robot, (0.0, 0.0, 0.25), (0.3, 0.1, 0)), 1.0)
    assert len(run.coords["event"].values) > 3
    assert "contact_power" not in run.variables


@pytest.mark.parametrize("place", [(0.2, 0.13), (0.13, 0.4), (0.4, 0.6)])
def test_a_ball_between_two_cells_of_a_field_is_pressed_along_its_energy(place):
    field = wavy().model_copy(update={"frame": lw.Frame()})
    robot = on_floor(field, stiffness=1e5, gravity=(0.0, 0.0, 0.0))

    def energy(x, y):
        return float(robot.energy(at(robot, (x, y, R - 0.01)))[1])

    (x, y), h = place, 1e-5
    force = robot.passive_forces(at(robot, (x, y, R - 0.01)))[:2]
    slopes = energy(x + h, y) - energy(x - h, y), energy(x, y + h) - energy(x, y - h)
    assert np.abs(force).max() > 1
    close(force, -np.array(slopes) / (2 * h), 1e-3 * np.abs(force).max())


def test_a_ball_that_rolls_off_a_field_keeps_its_energy():
    """Down a slope and over its edge onto the level, whose gap has no leap there."""
    slope = lw.HeightField(heights=((0.0, 0.0), (0.1, 0.1)), spacing=(0.4, 0.4))
    robot = on_floor(slope, stiffness=1e5)
    on_slope = at(robot, (0.2, 0.2, 0.0499 + R * np.sqrt(1 + 1 / 16)), (-0.5, 0, -0.125))
    run = robot.simulate(on_slope, duration=0.8, rtol=1e-10, atol=1e-12)
    assert run["joint_position"].values[-1, 0] < -0.1
    assert float(abs(run["energy_balance"]).max()) < 1e-7


@pytest.mark.parametrize("surface", [lw.Plane(frame=lw.Frame(rotation=(0.3, 0.1, 0))), wavy()])
def test_forces_at_rest_are_the_slope_of_the_energy(surface):
    """Q = -dU/dq along every rate, for a capsule that presses with both ends or one."""
    robot = on_floor(surface, ball=lw.Capsule(radius=R, length=0.3), gravity=(0.0, 0.0, 0.0))
    of, random = robot.equations, np.random.default_rng(1)
    energy, terms = functions.energy(of), functions.terms(of)
    for _ in range(3):
        q = np.array([0.1, 0.05, 0.03, 1, 0.5, 0.3, 0.1]) + 0.05 * random.normal(size=7)
        q[3:] /= np.linalg.norm(q[3:])
        v = random.normal(size=6)
        moved = np.array(
            ca.DM(ca.Function("n", [of.tree.q], [of.tree.derivative_map])(q)).full() @ v
        )

        def stored(e, q=q, moved=moved):
            return values(energy, q + e * moved, np.zeros(6))["potential"][0]

        slope = (stored(-2e-4) - 8 * stored(-1e-4) + 8 * stored(1e-4) - stored(2e-4)) / 12e-4
        assert abs(slope) > 1.0
        close(values(terms, q, 0 * v)["f"] @ v, -slope, 1e-6)


def test_friction_and_stiffness_may_be_free():
    law = lw.Sliding(coefficient=0.2, rate=1e-2)
    free = lw.Robot(
        on_floor(friction=law, stiffness=1e5, dissipation=0.5).mechanism,
        free=["floor.friction.coefficient", "floor.stiffness", "floor.surfaces.1.radius"],
    )
    other = on_floor(
        friction=lw.Sliding(coefficient=0.4, rate=1e-2),
        stiffness=3e5,
        dissipation=0.5,
        ball=lw.Sphere(radius=0.12),
    )
    values_ = {
        "floor.friction.coefficient": 0.4,
        "floor.stiffness": 3e5,
        "floor.surfaces.1.radius": 0.12,
    }
    ends = [
        robot.simulate(
            at(robot, (0, 0, 0.2), (1.0, 0, 0)), duration=0.3, parameters=given, **TIGHT
        )["joint_position"].values[-1]
        for robot, given in ((free, values_), (other, {}))
    ]
    close(*ends, 1e-8)


def test_members_of_an_ensemble_bounce_as_they_do_alone():
    robot = on_floor(dissipation=0.3)
    heights = [0.15, 0.2, 0.4]
    states = robot.state(np.array([[0, 0, z, 1, 0, 0, 0] for z in heights], float))
    times = np.linspace(0.1, 0.5, 5)
    together = robot.ensemble(states, duration=0.5, save_at=times)
    for member in range(3):
        alone = robot.simulate(states.at(member), duration=0.5, save_at=times)
        found = together.dataset["joint_position"].values[member]
        close(found, alone["joint_position"].values, 1e-12)


@pytest.mark.parametrize(
    ("surfaces", "said"),
    [
        ((lw.Plane(), lw.Plane()), "a contact of plane and plane has no place"),
        ((lw.Plane(), lw.Cylinder(radius=0.1, length=1.0)), "a cylinder has no corners"),
        (
            (lw.Polygon(points=((0, 0), (1, 0), (0, 1)), thickness=0.1), SPHERE),
            "polygon and sphere do not meet here",
        ),
    ],
)
def test_surfaces_that_do_not_meet(surfaces, said):
    with pytest.raises(lw.MechanismError, match=said):
        lw.Contact(connects=("ground", "ball"), surfaces=surfaces, stiffness=1.0)


def test_a_surface_of_no_type():
    surfaces = ({"type": "plan"}, SPHERE)
    with pytest.raises(lw.MechanismError, match=r"'plan' is not a type .*did you mean plane") as no:
        lw.Contact(connects=("ground", "ball"), surfaces=surfaces, stiffness=1.0)
    assert str(no.value).count("height_field") == 1


def test_contacts_of_no_bodies_and_fields_of_no_grid():
    contact = lw.Contact(connects=("ground", "bal"), surfaces=(lw.Plane(), SPHERE), stiffness=1.0)
    with pytest.raises(
        lw.MechanismError, match=r"contacts\.floor\.connects: there is no body 'bal'"
    ):
        lw.Mechanism(bodies={"ball": BALL}, joints={"f": FREE}, contacts={"floor": contact})
    with pytest.raises(lw.MechanismError, match="the heights are no grid"):
        lw.HeightField(heights=((0.0, 1.0), (0.0,)), spacing=(1.0, 1.0))


def test_files_hold_contacts(tmp_path):
    for surface in (lw.Plane(), wavy()):
        mechanism = on_floor(surface, friction=lw.Sliding(coefficient=0.3, static=0.4)).mechanism
        mechanism.save(tmp_path / "x.yaml")
        assert lw.Mechanism.load(tmp_path / "x.yaml") == mechanism


@pytest.mark.sample(2)
@pytest.mark.parametrize("method", [None, "dormand_prince", "rodas"])
@pytest.mark.parametrize("exponent", [1.0, 1.5])
def test_a_ball_that_is_laid_on_a_slope_sets_off(method, exponent):
    """Where its gap is zero but for rounding, whatever its rate along the slope."""
    slope = lw.HeightField(heights=((0.0, 0.0), (0.1, 0.1)), spacing=(0.4, 0.4))
    plane = lw.Plane(frame=lw.Frame(rotation=(0.0, -np.arctan(0.25), 0.0)))
    height = 0.05 + R * np.sqrt(1 + 1 / 16)
    for surface in (slope, plane):
        robot = on_floor(surface, stiffness=1e5, exponent=exponent)
        rates = np.array([(-0.5, 0, -0.125), (0, 0, 0), (0.4, 0.1, 0.1)])
        for rate in rates:
            start = at(robot, (0.2, 0.2, height), rate)
            given = {"method": method} if method else {}
            run = robot.simulate(start, duration=0.02, **given)
            assert run.status is lw.Status.FINISHED, run.message
        start = robot.state(np.tile(start.positions, (3, 1)), np.hstack([rates, np.zeros((3, 3))]))
        members = robot.ensemble(start, duration=0.02, **given)
        assert not len(members.failed)
        close(members.final.positions[-1], run.final.positions, 1e-9)


@pytest.mark.sample(3)
@pytest.mark.parametrize("friction", [{}, {"friction": lw.Sliding(coefficient=0.5)}])
@pytest.mark.parametrize("rate", [(0.3, 0.1, 0.0), (0.5, 0.0, 0.0), (0.0, 0.0, -0.3)])
def test_a_box_that_is_laid_on_a_plane_and_pushed_keeps_its_energy(rate, friction):
    """Its first step, which begins where nothing presses yet, is judged by what it meets."""
    lean = Rotation.from_rotvec([0.13, 0.2, 0.0])
    floor = lw.Plane(frame=lw.Frame(rotation=tuple(lean.as_rotvec())))
    law = {"exponent": 1.0, "dissipation": 5.0} | friction
    robot = on_floor(floor, ball=lw.Box(size=(0.2, 0.2, 0.1)), **law)
    x, y, z, w = lean.as_quat()
    start = robot.state([*lean.apply([0, 0, 0.05]), w, x, y, z])
    start = start.with_rates([*lean.apply(rate), 0, 0, 0])
    for method in ("sharp_smart", "dormand_prince"):
        run = robot.simulate(start, duration=0.05, method=method)
        assert run.status is lw.Status.FINISHED, run.message
        assert float(abs(run["energy_balance"]).max()) < 1e-8
