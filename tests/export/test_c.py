"""C against the kernels, bit by bit on robots of every kind, and what is refused."""

import re
import shutil

import numpy as np
import pytest

import linkwork as lw
from linkwork.export.calls import PROGRAMS
from linkwork.kernels import compile_function
from linkwork.kernels.by_sections import SHORT
from linkwork.model.checks import PIVOT_BOUND
from linkwork.robot import Robot

from tests.catalogue import SAMPLE, WHOLE, built
from tests.export.compiled import STRICT, Library, Program, compiler, run

OK, SINGULAR, NOT_FINITE = range(3)
STRAIGHT = ["motion", "inverse_dynamics", "mass_matrix", "jacobian", "closure"]
SAMPLES = 10_000 if WHOLE else 50
ABROAD = lw.robots.__all__ if WHOLE else ("prr3", "rrs3", "spatial_slider_crank")
PROCESSORS = {
    "aarch64": ("aarch64-linux-gnu-gcc", "qemu-aarch64"),
    "armhf": ("arm-linux-gnueabihf-gcc", "qemu-arm"),
}


def samples(robot: Robot, count: int = SAMPLES) -> dict[str, np.ndarray]:
    """Return configurations around home, rates, accelerations and forces (fixed seed)."""
    random = np.random.default_rng(7)
    spread = random.normal(size=(count, robot.equations.nq)) * robot.equations.tree.units
    return {
        "q": robot.home.q + 0.2 * spread,
        "v": random.normal(size=(count, robot.mobility)),
        "dv": random.normal(size=(count, robot.mobility)),
        "u": 10 * random.normal(size=(count, len(robot.actuators))),
    }


@pytest.mark.sample(2)
@pytest.mark.parametrize("name", SAMPLE)
def test_c_gives_the_numbers_of_the_kernels(name, tmp_path):
    """Also near singular configurations, where roundings of another order would show."""
    robot = built(name)
    wanted = STRAIGHT if WHOLE or robot.equations.nq < 8 else STRAIGHT[:1]
    wanted = [each for each in wanted if has(robot, each)]
    library, given = Library(robot, lw.export.c(robot, wanted), tmp_path), samples(robot)
    for function in wanted:
        rows = inputs_of(function, given)
        found = [library(function, *row) for row in zip(*rows, strict=True)]
        statuses = np.array([status for status, _ in found])
        require_equal(robot, function, rows, statuses, [np.concatenate(out) for _, out in found])


@pytest.mark.parametrize("name", ["pendulum", "slider_crank", "bennett", "five_bar", "tripteron"])
def test_vectors_of_any_number_of_angles_give_the_numbers_of_the_kernels(name, tmp_path):
    """One, two, three, four and seven angles, one of them at times beyond what polynomials take."""
    robot = built(name)
    library = Library(robot, lw.export.c(robot, ["motion"]), tmp_path, "-O3", "-march=native")
    rows = inputs_of("motion", samples(robot))
    rows[0][::9, 0] += 2.0**31
    found = [library("motion", *row) for row in zip(*rows, strict=True)]
    statuses = np.array([status for status, _ in found])
    require_equal(robot, "motion", rows, statuses, [np.concatenate(out) for _, out in found])


def test_long_programs_are_short_functions_that_compilers_leave_apart():
    def lengths(name):
        source = lw.export.c(built(name), ["motion"], name="robot").files["robot.c"]
        apart = re.findall(r"^ROBOT_SEPARATE\nstatic void \w+\((.*?)^}", source, re.M | re.S)
        return [body.count("const robot_real v") for body in apart]

    assert len(lengths("stewart")) > 10 and max(lengths("stewart")) <= SHORT
    assert not lengths("prr3")


@pytest.mark.sample(1)
@pytest.mark.parametrize("processor", PROCESSORS)
@pytest.mark.parametrize("name", ABROAD)
def test_other_processors_give_the_numbers_of_the_kernels(name, processor, tmp_path):
    compiling, running = PROCESSORS[processor]
    if missing := [each for each in (compiling, running) if not shutil.which(each)]:
        pytest.skip(f"{' and '.join(missing)} not installed")
    robot = built(name)
    wanted = [each for each in STRAIGHT if has(robot, each)]
    export, given = lw.export.c(robot, wanted), samples(robot)
    program = Program(robot, export, tmp_path, [compiling, "-static"], [running])
    for function in wanted:
        rows = inputs_of(function, given)
        statuses, found = program(function, rows)
        require_equal(robot, function, rows, statuses, found)


def inputs_of(function: str, given: dict[str, np.ndarray]) -> list[np.ndarray]:
    """Return what a function takes, an array of rows for each input."""
    return [given[each] for each in PROGRAMS[function].inputs]


def require_equal(robot: Robot, function: str, rows, statuses, found) -> None:
    """Compare with the kernel of a function: 4 units in the last place of the largest entry, and
    the status that its pivot asks for."""
    piece = PROGRAMS[function]
    own = function == "motion" or robot.actuators == robot.independent
    known = function in ("motion", "inverse_dynamics") and own
    kernel = robot.kernel(function) if known else compile_function(piece.make(robot))
    for status, out, *row in zip(statuses, found, *rows, strict=True):
        y = kernel.flat(*row)
        expected, pivot = (y[:-1], abs(y[-1])) if piece.outputs[-1] == "pivot" else (y, 1.0)
        assert (status == SINGULAR) == (not pivot > PIVOT_BOUND)
        largest = np.abs(expected).max(initial=0.0)
        atol = 4 * 2.0**-52 * (largest if np.isfinite(largest) else 0.0)
        np.testing.assert_allclose(out, expected, rtol=0, atol=atol)


def has(robot: Robot, function: str) -> bool:
    """Tell whether a robot has a function."""
    undriven = function == "inverse_dynamics" and robot.actuators != robot.independent
    return not undriven and (function != "jacobian" or bool(robot.task))


@pytest.mark.long
def test_c_gives_what_the_robot_does(tmp_path):
    """Through the public calls, at home and in motion."""
    robot = built("delta")
    library = Library(robot, lw.export.c(robot), tmp_path)
    state = robot.assemble({"motor_1": 0.7, "motor_2": 0.5}, rates=[0.3, -0.2, 0.1])
    u, dv = np.array([3.0, -1.0, 0.5]), np.array([1.0, 2.0, -3.0])
    for name, given, expected in (
        ("motion", (state.rates, u), robot.forward_dynamics(state, u)),
        ("inverse_dynamics", (state.rates, dv), robot.inverse_dynamics(state, dv)),
        ("mass_matrix", (), robot.mass_matrix(state).ravel()),
        ("jacobian", (), robot.jacobian(state).ravel()),
        ("closure", (), robot.closure_error(state)[None]),
    ):
        status, found = library(name, state.q, *given)
        assert status == OK
        np.testing.assert_allclose(found[-1], expected, rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("name", ["prr3", "delta", "puma560"])
def test_the_jacobian_is_that_of_the_tool(name, tmp_path):
    robot = built(name)
    library = Library(robot, lw.export.c(robot, ["jacobian"]), tmp_path)
    expected = robot.jacobian(robot.home)
    status, [found] = library("jacobian", robot.home.q)
    assert status == OK
    np.testing.assert_allclose(found.reshape(expected.shape), expected, rtol=1e-13, atol=1e-13)


@pytest.mark.sample(1)
@pytest.mark.parametrize("with_compiler", ["gcc", "clang", "tcc", "zig"])
def test_compilers_have_nothing_to_say(with_compiler, tmp_path):
    command = compiler(with_compiler)
    if not command:
        pytest.skip(f"{with_compiler} is not installed")
    flags = ["-std=c99", "-Wall", "-Werror"] if with_compiler == "tcc" else STRICT
    for sines in ("polynomial", "libm"):
        export = lw.export.c(built("prr3"), sines=sines)
        export.write(tmp_path)
        run([*command, *flags, "-c", tmp_path / f"{export.name}.c", "-o", tmp_path / "one.o"])


@pytest.mark.long
def test_the_source_is_c_plus_plus_too(tmp_path):
    command = compiler("g++")
    if not command:
        pytest.skip("g++ is not installed")
    export = lw.export.c(built("delta"))
    export.write(tmp_path)
    flags = [flag for flag in STRICT if flag != "-std=c99"]
    source = tmp_path / f"{export.name}.c"
    run([*command, "-std=c++11", *flags, "-x", "c++", "-c", source, "-o", tmp_path / "one.o"])


def test_free_numbers_are_a_structure(tmp_path):
    robot = lw.Robot("prr3").free("platform.mass", "gravity.y")
    heavier = robot.with_parameters({"platform.mass": 9.0, "gravity.y": -5.0})
    export = lw.export.c(robot, ["motion"], parameters="free")
    library = Library(robot, export, tmp_path)
    q, v, u = robot.home.q, np.array([0.1, -0.2, 0.3]), np.array([1.0, 2.0, 3.0])
    for one in (robot, heavier):
        expected = one.kernel("motion")(q, v, u)
        status, found = library("motion", q, v, u, one.p)
        assert status == OK
        np.testing.assert_array_equal(found[1], expected[1])
    assert "lw_" not in export.files["robot_3_prr.c"]
    assert "robot_3_prr_real platform_mass; /* platform.mass */" in export.files["robot_3_prr.h"]
    folded = Library(heavier, lw.export.c(heavier, ["motion"]), tmp_path / "folded")
    np.testing.assert_allclose(
        folded("motion", q, v, u)[1][1], heavier.kernel("motion")(q, v, u)[1], rtol=1e-12
    )


def test_singular_and_not_finite_have_their_status(tmp_path):
    robot = built("five_bar")
    library = Library(robot, lw.export.c(robot, ["motion"]), tmp_path)
    nothing, q = np.zeros(2), robot.home.q
    assert library("motion", q, nothing, nothing)[0] == OK
    assert library("motion", q, nothing, np.array([np.nan, 0.0]))[0] == NOT_FINITE
    # Where the pivot changes its sign the motors do not determine the motion.
    low, high = [q + np.eye(4)[k] * turn for k, turn in ((0, 0.0), (3, 3.0))]
    pivot = robot.kernel("motion")
    assert pivot(low, nothing, nothing)[-1] * pivot(high, nothing, nothing)[-1] < 0
    for _ in range(60):
        middle = (low + high) / 2
        same = pivot(middle, nothing, nothing)[-1] * pivot(low, nothing, nothing)[-1] > 0
        low, high = (middle, high) if same else (low, middle)
    assert library("motion", low, nothing, nothing)[0] == SINGULAR


def test_sines_of_any_size(tmp_path):
    robot = built("pendulum")
    for sines in ("polynomial", "libm"):
        folder = tmp_path / sines
        library = Library(robot, lw.export.c(robot, ["motion"], sines=sines), folder)
        for angle in (0.0, 1.5, -3e5, 2.0e9, 1e15, -1e300):
            _, expected, _ = robot.kernel("motion")([angle], [0.0], [0.0])
            status, found = library("motion", np.array([angle]), np.zeros(1), np.zeros(1))
            assert status == OK
            np.testing.assert_allclose(found[1], expected, rtol=1e-15, atol=1e-15)


def test_names_that_c_cannot_hold_are_mapped_and_told():
    export = lw.export.c(named_oddly(), ["motion"])
    assert export.name == "robot_3_arm_s"
    header = export.files["robot_3_arm_s.h"]
    assert "ROBOT_3_ARM_S_Q_HINGE_1 = 0, /* hinge 1 [rad] */" in header
    assert "ROBOT_3_ARM_S_Q_HINGE_1_2 = 1 /* hinge-1* / [rad] */" in header
    assert any("'hinge-1*/' is HINGE_1_2 in C" in note for note in export.notes)
    own = lw.export.c(named_oddly(), ["motion"], name="arm")
    assert own.name == "arm" and "arm_motion(" in own.files["arm.c"]


def named_oddly() -> Robot:
    link = lw.Body(mass=1.0, centre_of_mass=(0.5, 0.0, 0.0), inertia=lw.Inertia(zz=0.1))
    places = lw.Frame.planar(1.0, 0.0), lw.Frame()
    joints = {
        "hinge 1": lw.RevoluteJoint(connects=("ground", "a")),
        "hinge-1*/": lw.RevoluteJoint(connects=("a", "b"), frames=places),
    }
    return lw.Robot(lw.Mechanism(name="3 Arm(s)", bodies={"a": link, "b": link}, joints=joints))


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"functions": ["montion"]}, "montion.*motion"),
        ({"functions": "motion"}, "give a list of names"),
        ({"precision": "half"}, "precision is 'half'; give 'double' or 'float'"),
        ({"functions": []}, "functions names none; give some of motion, inverse_dynamics"),
        ({"parameters": "free"}, "no number of the robot is free"),
        ({"sines": "own"}, "sines is 'own'; give 'polynomial' or 'libm'"),
        ({"name": "3prr"}, "'3prr' cannot begin names of C"),
        ({"name": "for"}, "'for' cannot begin names of C"),
    ],
)
def test_refusals(options, sentence):
    with pytest.raises(lw.LinkworkError, match=sentence):
        lw.export.c(built("prr3"), **options)


def test_what_a_robot_does_not_have_is_left_out_or_refused():
    robot = built("flyball_governor")
    export = lw.export.c(robot)
    assert "inverse_dynamics" not in export.functions
    assert any("inverse_dynamics is left out" in note for note in export.notes)
    with pytest.raises(lw.LinkworkError, match="the actuators do not drive"):
        lw.export.c(robot, ["inverse_dynamics"])
    with pytest.raises(lw.LinkworkError, match="names no tool"):
        lw.export.c(built("bricard"), ["jacobian"])
    with pytest.raises(lw.LinkworkError, match=r"give a linkwork.Robot"):
        lw.export.c("prr3")  # pyright: ignore[reportArgumentType]


def test_a_folder_that_cannot_be_written_is_refused(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(lw.LinkworkError, match="cannot be written"):
        lw.export.c(built("pendulum")).write(tmp_path / "file")
