"""Arcs and helices as tool paths."""

import numpy as np
import pytest

from linkwork import LinkworkError, paths

from tests.catalogue import WHOLE, built

S = np.linspace(0, 1, 201)


def checked(path):
    """Return the points of a path whose derivatives are those of its points."""
    x, x_s, x_ss = path.curve(S)
    h = 1e-5
    before, _, _ = path.curve(S - h)
    after, _, _ = path.curve(S + h)
    assert x_s == pytest.approx((after - before) / (2 * h), abs=1e-7)
    assert x_ss == pytest.approx((after - 2 * x + before) / h**2, rel=1e-5, abs=1e-3)
    return x


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    ("size", "orientation"), [(2, 0.3), (3, None), *[(2, None), (3, 0.3)] * WHOLE]
)
def test_an_arc_goes_through_its_three_points_on_one_circle(size, orientation):
    points = np.random.default_rng(4).normal(size=(40, 3, size))
    for start, via, end in points:
        turn = None if orientation is None else [orientation] * (2 * size - 3)
        x = checked(paths.arc(start, via, end, turn))
        assert x[0, :size] == pytest.approx(start, abs=1e-12)
        assert x[-1, :size] == pytest.approx(end, abs=1e-9)
        # The second point lies on the arc, not on the rest of the circle.
        length = np.linalg.norm(np.diff(x[:, :size], axis=0), axis=1)
        assert np.linalg.norm(x[:, :size] - via, axis=1).min() < 0.51 * length.max() + 1e-9
        assert length == pytest.approx(length[0], rel=1e-6)
        assert x.shape[1] == size + (0 if orientation is None else 2 * size - 3)


def test_a_helix_climbs_evenly():
    x = checked(paths.helix([0.1, 0.2, 0.3], 0.05, 0.4, [0, 0, 0.5], turns=-2))
    assert np.linalg.norm(x[:, :2] - [0.1, 0.2], axis=1) == pytest.approx(0.05, abs=1e-15)
    assert x[:, 2] == pytest.approx(0.3 + 0.4 * S, abs=1e-15)
    assert (x[:, 3:] == [0, 0, 0.5]).all()


@pytest.mark.parametrize(
    "path",
    [
        paths.circle([0, 0, -0.65], 0.1, 0.3),
        paths.helix([0, 0, -0.65], 0.1, 0.05, 0.3),
        paths.arc([0.1, 0, -0.65], [0, 0.1, -0.65], [-0.1, 0, -0.65], 0.3),
    ],
)
def test_a_tool_that_turns_about_the_vertical_alone_keeps_its_angle(path):
    """The Par4 is led in x, y, z, rz: one number after the place."""
    robot = built("par4")
    motion = robot.follow(path, 1.0, samples=21)
    assert motion.what == ("x", "y", "z", "rz") and (motion.tool[:, 3] == 0.3).all()
    pose = robot.tool_pose(motion.state)
    assert np.linalg.norm(pose[:, :2], axis=1) == pytest.approx(0.1, abs=1e-12)
    assert pose[:, 3:] == pytest.approx(np.tile([0, 0, 0.3], (21, 1)), abs=1e-12)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: paths.arc([0, 0], [1, 1], [2, 2]), "lie in a line"),
        (lambda: paths.arc([0, 0], [1, 1], [0, 0]), "lie in a line"),
        (lambda: paths.arc([0, 0], [1, 1, 1], [2, 0]), "the point between is"),
        (lambda: paths.arc([0, 0], [1, np.nan], [2, 0]), "the point between is"),
        (lambda: paths.arc([0, 0], [1, 1], [2, 0], [1, 2]), r"is \[1.0, 2.0\]; give 0 or 1 finite"),
        (lambda: paths.circle([0, 0, 0], 1, [1] * 4), "give 0, 1, 2 or 3 finite numbers"),
        (lambda: paths.circle([0, 0], 1, "up"), "the orientation is 'up'"),
        (lambda: paths.helix([0, 0], 1, 1), "the centre is"),
        (lambda: paths.helix([0, 0, 0], 0, 1), "the radius is 0"),
        (lambda: paths.helix([0, 0, 0], 1, np.nan), "the rise is nan"),
    ],
)
def test_refusals(call, said):
    with pytest.raises(LinkworkError, match=said):
        call()
