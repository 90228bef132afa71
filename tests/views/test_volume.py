"""The surface of a set of grid points: closed, where it belongs, and what it is drawn of."""

from collections import Counter

import matplotlib.pyplot as plt
import numpy as np
import pytest

import linkwork as lw
from linkwork import analysis
from linkwork.views import plot_workspace
from linkwork.views.style import svg
from linkwork.views.volume import surface

from tests.catalogue import built

AXES = np.linspace(-1, 1, 25), np.linspace(-1.2, 1.2, 31), np.linspace(1.1, -1.1, 29)


def within(radius: float) -> np.ndarray:
    x, y, z = np.meshgrid(*AXES, indexing="ij")
    return x**2 + y**2 + z**2 < radius**2


def volume(faces: np.ndarray) -> float:
    """Return the volume within closed faces (f, 4, 3), by the divergence theorem."""
    a, b, c, d = np.moveaxis(faces, 1, 0)
    triple = np.einsum("fi,fi->f", a, np.cross(b, c)) + np.einsum("fi,fi->f", a, np.cross(c, d))
    return float(triple.sum() / 6)


def test_the_surface_of_a_ball_is_closed_lies_on_the_sphere_and_holds_its_volume():
    axes = (*AXES[:2], AXES[2][::-1])
    faces = surface(within(0.9), axes).faces
    sides = Counter(
        frozenset((a.tobytes(), b.tobytes()))
        for face in faces
        for a, b in zip(face, np.roll(face, -1, axis=0), strict=True)
    )
    assert all(count % 2 == 0 for count in sides.values())
    radii = np.linalg.norm(faces.reshape(-1, 3), axis=1)
    assert np.abs(radii - 0.9).max() < 0.6 * max(np.ptp(axis[:2]) for axis in axes)
    assert volume(faces) == pytest.approx(4 / 3 * np.pi * 0.9**3, rel=0.02)


def test_each_face_stands_at_a_point_that_is_inside_and_has_one_outside_beside_it():
    inside = within(0.8)
    found = surface(inside, AXES)
    assert inside[tuple(found.points.T)].all()
    padded = np.pad(inside, 1)
    for point in found.points:
        beside = [
            padded[tuple(point + 1 + s * step)] for step in np.eye(3, dtype=int) for s in (1, -1)
        ]
        assert not all(beside)


def test_the_surface_ends_with_the_grid():
    everywhere = surface(np.ones((4, 3, 5), bool), [np.arange(4.0), np.arange(3.0), np.arange(5.0)])
    corners = everywhere.faces.reshape(-1, 3)
    assert corners.min(axis=0) == pytest.approx(0) and corners.max(axis=0) == pytest.approx(
        (3, 2, 4)
    )
    assert (
        len(surface(np.zeros((4, 3, 5), bool), [np.arange(k + 0.0) for k in (4, 3, 5)]).faces) == 0
    )


@pytest.fixture(scope="module")
def mapped():
    """Return the workspace of the delta robot, on a grid that reaches beyond it."""
    grid = {
        "z": np.linspace(-1.9, -0.1, 13),
        "x": np.linspace(-1.3, 1.3, 15),
        "y": np.linspace(-1.3, 1.3, 17),
    }
    return analysis.workspace(built("delta"), grid)


def test_a_workspace_in_space_is_drawn_as_its_surface_in_the_colours_of_a_quantity(mapped):
    axes = plot_workspace(mapped)
    (drawn,) = axes.collections
    assert (axes.get_xlabel(), axes.get_ylabel(), axes.get_zlabel()) == ("x [m]", "y [m]", "z [m]")
    names = ("x", "y", "z")
    reached = mapped["reachable"].transpose(*names).values
    expected = surface(reached, [mapped[name].values for name in names])
    assert len(expected.faces) > 500
    values = mapped["conditioning"].transpose(*names).values[tuple(expected.points.T)]
    colours = plt.get_cmap("cividis")((values - values.min()) / np.ptp(values))
    own = drawn._facecolor3d  # in the order of the faces; what is public is sorted by depth
    assert own[:, :3] == pytest.approx(colours[:, :3])
    svg(axes.figure)


def test_what_is_reached_alone_has_one_colour_and_no_scale(mapped):
    axes = plot_workspace(mapped, "reachable")
    assert len(np.unique(axes.collections[0].get_facecolor(), axis=0)) == 1
    assert axes.figure.axes == [axes]


def test_nothing_reached_flat_axes_and_other_quantities_are_said(mapped):
    nowhere = analysis.workspace(
        built("delta"), {"x": [5.0, 6.0], "y": [5.0, 6.0], "z": [5.0, 6.0]}
    )
    assert [text.get_text() for text in plot_workspace(nowhere).texts] == ["no pose is reached"]
    with pytest.raises(lw.LinkworkError, match="over three coordinates and the axes are flat"):
        plot_workspace(mapped, ax=plt.figure().add_subplot())
    with pytest.raises(lw.LinkworkError, match="no 'heat' over three coordinates; over three it"):
        plot_workspace(mapped, "heat")
