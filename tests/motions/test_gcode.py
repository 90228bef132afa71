"""Lists of moves as machine tools take them, against geometry told by hand."""

import numpy as np
import pytest

from linkwork import LinkworkError, motions

from tests.catalogue import built

LIMITS = motions.AxisLimits(speed=0.5, acceleration=2.0, jerk=50.0)


def run(text, **given):
    timed = motions.gcode(text, LIMITS, **given)
    x, v, a = timed.sample(np.linspace(0, timed.duration, 4001))
    return timed, x, v, a


def test_a_square_is_run_through_side_by_side():
    text = "G21 G90 (metric)\nG0 X0 Y0 Z0 ; there\nG1 X100 F6000\nY100\nX0\nN5 Y0\nM2\nnonsense"
    timed, x, v, a = run(text)
    assert len(timed.passed) == 5 and len(timed.corners) == 3
    side = motions.s_curve(0.1, speed=0.1, acceleration=2.0, jerk=50.0).duration
    assert timed.duration == pytest.approx(4 * side, rel=1e-12)
    corners = timed.sample(np.array(timed.passed))[0]
    square = np.array([[0, 0, 0], [0.1, 0, 0], [0.1, 0.1, 0], [0, 0.1, 0], [0, 0, 0]])
    assert corners == pytest.approx(square, abs=1e-12)
    assert np.abs(v).max() == pytest.approx(0.1, rel=1e-9) and np.abs(a).max() < 2.0 + 1e-9
    assert np.gradient(x, timed.duration / 4000, axis=0)[1:-1] == pytest.approx(v[1:-1], abs=2e-4)


@pytest.mark.parametrize(
    ("words", "centre", "sweep"),
    [
        ("G3 X0 Y50 I-50 J0", [0, 0], np.pi / 2),
        ("G2 X0 Y50 I-50 J0", [0, 0], -3 * np.pi / 2),
        ("G3 X0 Y50 R50", [0, 0], np.pi / 2),
        ("G2 X0 Y50 R50", [0.05, 0.05], -np.pi / 2),
        ("G3 X0 Y50 R-50", [0.05, 0.05], 3 * np.pi / 2),
        ("G2 X0 Y50 R-50", [0, 0], -3 * np.pi / 2),
        ("G3 X50 Y0 I-50", [0, 0], 2 * np.pi),
        ("G91 G2 X-50 Y50 I-50 Z20", [0, 0], -3 * np.pi / 2),
    ],
)
def test_arcs_and_helices(words, centre, sweep):
    timed, x, v, _ = run(f"F3000\n{words}", start=[0.05, 0, 0])
    off = x[:, :2] - centre
    assert np.hypot(*off.T) == pytest.approx(0.05, abs=1e-12)
    angle = np.unwrap(np.arctan2(off[:, 1], off[:, 0]))
    assert angle[-1] - angle[0] == pytest.approx(sweep, abs=1e-9)
    rise = 0.02 if "Z" in words else 0.0
    assert x[-1, 2] == pytest.approx(rise, abs=1e-15)
    speed = np.linalg.norm(v, axis=1)
    assert speed.max() == pytest.approx(0.05, rel=1e-9)
    length = np.hypot(0.05 * sweep, rise)
    alone = motions.s_curve(length, speed=0.05, acceleration=2.0, jerk=50.0)
    assert timed.duration == pytest.approx(alone.duration, rel=1e-9)


@pytest.mark.parametrize(("code", "turned"), [("G18", "ZXY"), ("G19", "YZX")])
def test_arcs_of_the_other_planes_are_those_of_xy_with_other_axes(code, turned):
    """Right-handed in each plane: of ZX and YZ, Z and Y are the first axis."""
    text = "F3000 G3 X-46 Y54 I-50 J4 Z7\nG2 X0 Y20 R40\nG1 Z0"
    offsets = dict(zip("XYZ", "IJK", strict=True))
    swaps = dict(zip("XYZIJK", [*turned, *(offsets[axis] for axis in turned)], strict=True))
    other = "".join(swaps.get(letter, letter) for letter in text)
    (one, x, *_), (two, y, *_) = (run(t, start=[0, 0, 0]) for t in (text, f"{code}\n{other}"))
    assert two.duration == pytest.approx(one.duration, rel=1e-12)
    assert y[:, ["XYZ".index(axis) for axis in turned]] == pytest.approx(x, abs=1e-12)


def test_g3_of_the_zx_plane_turns_about_y():
    _, x, *_ = run("G18 F3000\nG3 X50 Z0 K-50", start=[0, 0, 0.05])
    assert x[2000] == pytest.approx([0.05 / np.sqrt(2), 0, 0.05 / np.sqrt(2)], abs=1e-12)


def test_the_tool_goes_on_where_the_direction_does_and_slows_in_arcs():
    """Into the arc tangentially; sqrt(A r) is less than the feed there."""
    timed, _, v, a = run("G1 X50 F30000\nG3 X50 Y20 J10\nG1 X0", start=[0, 0, 0])
    assert not timed.corners
    speed = np.linalg.norm(v, axis=1)
    assert speed.max() == pytest.approx(np.sqrt(2.0 * 0.01), rel=1e-9)
    across = np.abs(np.cross(v, a)).max(axis=1)[1:-1] / speed[1:-1]
    assert across.max() == pytest.approx(2.0, rel=1e-6)
    assert len(run("G1 X50 F30000\nF100 X60", start=[0, 0, 0])[0].corners) == 1


def test_inches_relative_moves_and_rapids():
    timed, x, *_ = run("G20 G91\nG0 X1\nY1", start=[0, 0, 0])
    assert x[-1] == pytest.approx([0.0254, 0.0254, 0], abs=1e-15)
    fast = motions.s_curve(0.0254, speed=0.5, acceleration=2.0, jerk=50.0)
    assert timed.duration == pytest.approx(2 * fast.duration, rel=1e-12)


def test_a_planar_robot_follows_a_list():
    text = "F6000 G1 X500 Y300\nX520\nG3 X520 Y280 I0 J-10 (half a circle)"
    timed = motions.gcode(text.replace("G3", "G2"), LIMITS, orientation=1.2, planar=True)
    motion = motions.follow(built("prr3"), timed, samples=41)
    assert motion.tool[-1] == pytest.approx([0.52, 0.28, 1.2], abs=1e-9)
    with pytest.raises(LinkworkError, match="the path has a corner at s = "):
        squared = motions.gcode(
            "F6000 G1 X500 Y300\nX520\nY280", LIMITS, orientation=1.2, planar=True
        )
        motions.fastest(built("prr3"), squared, motions.ActuatorLimits(force=5.0))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("G1 X1 F1\nG1 X=3", "line 2: '=3' is not understood|line 2: 'X=3' is not understood"),
        ("G1 X1 F1\n\nG5 X3", "line 3: G5 is not known"),
        ("M6", "line 1: M6 is not known"),
        ("M18", "line 1: M18 is not known"),
        ("F1 G18 G3 X1 Z1 I1 J1", "line 1: J is across the plane of the arc; give K, I"),
        ("F1 G3 X1 Y1", "line 1: an arc has a centre I, J or a radius R"),
        ("T1", "line 1: the word 'T1' is not known"),
        ("X1", "line 1: no move is chosen"),
        ("G1 X1", "line 1: G1 has no feed"),
        ("G1 X1 X2 F1", "line 1: X is given twice"),
        ("G1 X1 F0", "line 1: the feed F is 0"),
        ("G1 X1 I1 F1", "line 1: I belongs to arcs"),
        ("G2 X1 F1", "line 1: an arc has a centre"),
        ("G2 X1 I1 R1 F1", "line 1: an arc has a centre"),
        ("G2 X10 R1 F1", "line 1: no arc of the radius R = 1 leads from the start to an end 10"),
        ("G2 R1 F1", "line 1: no arc"),
        ("G2 X10 I3 F1", "line 1: the start is 3 from the centre and the end 7"),
        ("(nothing)", "the list has no move"),
    ],
)
def test_what_is_not_understood_is_refused_with_its_line(text, said):
    with pytest.raises(LinkworkError, match=said):
        motions.gcode(text, LIMITS, start=[0, 0, 0])


def test_other_refusals():
    for call, said in (
        (lambda: motions.gcode(3, LIMITS), "the list is 3"),
        (lambda: motions.gcode("G1 X1 F1", LIMITS), "line 1: where the tool is at first"),
        (lambda: motions.gcode("G1 Z1 F1", LIMITS, start=[0, 0], planar=True), "has no Z"),
        (lambda: motions.gcode("G2 K1", LIMITS, start=[0, 0], planar=True), "has no K"),
        (
            lambda: motions.gcode("F1 G19 G1 X1", LIMITS, start=[0, 0], planar=True),
            "a planar list is in the plane of G17",
        ),
        (lambda: motions.gcode("G1 Y1", LIMITS, start=[0, 0]), "the start is"),
        (
            lambda: motions.gcode("G0 X1", motions.AxisLimits(jerk=1.0), start=[0, 0, 0]),
            "line 1: G0 is as fast as the limit",
        ),
    ):
        with pytest.raises(LinkworkError, match=said):
            call()


@pytest.mark.parametrize("name", ["rrs3", "agile_wrist"])
def test_moves_are_no_turns_of_a_tool_that_is_led_in_these(name):
    """Three millimetres were followed as three milliradians."""
    robot, (timed, *_) = built(name), run("G0 X0 Y0 Z0\nG1 X3 F600\n")
    led = ", ".join(robot.task)
    with pytest.raises(LinkworkError, match=f"leads x, y, z, but the tool is led in {led}; name"):
        motions.follow(robot, timed)
    if robot.task == ("rx", "ry", "rz"):  # asked for by name they are
        motion = motions.follow(robot, timed, what=robot.task)
        assert robot.task_values(motion.state)[-1] == pytest.approx([0.003, 0, 0], abs=1e-12)


@pytest.mark.parametrize("code", ["M2", "M30"])
def test_the_end_of_a_list_follows_the_move_of_its_line(code):
    _, x, *_ = run(f"G1 X100 F3000\nX100 Y100 {code}\nX0", start=[0, 0, 0])
    assert x[-1] == pytest.approx([0.1, 0.1, 0], abs=1e-12)


@pytest.mark.parametrize("sense", ["G2", "G3"])
@pytest.mark.parametrize("way", ["G91 G1 X0.1\nX0.2\nX0.3\nX0.4\nX0.7", "G20 G1 X3\nG21"])
def test_a_circle_back_to_where_sums_led_is_a_whole_one(way, sense):
    """0.1 + 0.2 is not 0.3, nor three inches 76.2 thousandths: neither is another place."""
    there = 76.2 if "G20" in way else 1.7
    timed, x, *_ = run(f"F300 {way}\nG90 F300 {sense} X{there} I5", start=[0, 0, 0])
    last = x[np.linspace(0, timed.duration, 4001) > timed.passed[-2]]
    centre = 1e-3 * (there + 5)
    assert np.ptp(last[:, 0]) == pytest.approx(0.01, rel=1e-4)
    assert np.hypot(last[:, 0] - centre, last[:, 1]) == pytest.approx(0.005, abs=1e-12)


def test_a_line_to_where_sums_led_is_no_move():
    timed, *_ = run("F300 G91 G1 X0.1\nX0.2\nG90 X0.3\nX0.9", start=[0, 0, 0])
    assert len(timed.passed) == 4 and not timed.corners
