"""Maps of the workspace: the numbers in their places, lines where they belong, colours that part at
zero."""

import numpy as np
import pytest
import xarray

import linkwork as lw
from linkwork import analysis
from linkwork.views import plot_mechanism, plot_workspace
from linkwork.views.style import svg

from tests.catalogue import built


@pytest.fixture(scope="module")
def mapped():
    """Return the workspace of the 3-PRR robot at one angle, on a grid with more columns than
    rows."""
    grid = {"y": np.linspace(0, 0.5, 26), "x": np.linspace(0.2, 0.8, 41), "angle": np.pi / 2}
    return analysis.workspace(built("prr3"), grid)


def painted(axes):
    return next(artist for artist in axes.collections if hasattr(artist, "get_coordinates"))


def test_the_quantity_stands_at_its_pose_with_x_along_the_picture(mapped):
    axes = plot_workspace(mapped)
    mesh = painted(axes)
    shown = np.ma.filled(mesh.get_array(), np.nan)
    np.testing.assert_array_equal(shown, mapped["conditioning"].transpose("y", "x"))
    middles = mesh.get_coordinates()[:-1, :-1] + 0.5 * np.array([0.6 / 40, 0.5 / 25])
    np.testing.assert_allclose(middles[0, :, 0], mapped["x"], atol=1e-12)
    np.testing.assert_allclose(middles[:, 0, 1], mapped["y"], atol=1e-12)
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("x [m]", "y [m]")
    assert axes.get_aspect() == 1


def test_the_edge_of_what_is_reached_is_drawn_between_reached_and_unreached_poses(mapped):
    lines = [line for line in plot_workspace(mapped).lines if len(line.get_xdata())]
    edge = np.concatenate([line.get_xydata() for line in lines])
    reached = mapped["reachable"].astype(float)
    between = reached.interp(x=xarray.DataArray(edge[:, 0]), y=xarray.DataArray(edge[:, 1]))
    np.testing.assert_allclose(between, 0.5, atol=1e-9)


def test_signed_quantities_part_at_zero(mapped):
    low, high = painted(plot_workspace(mapped, "det_A")).get_clim()
    assert low == -high < 0
    assert painted(plot_workspace(mapped, "conditioning")).get_cmap().name == "cividis"


def test_the_bar_of_a_signed_quantity_shows_the_signs_that_occur_and_points_beyond_its_end(mapped):
    det = mapped["det_A"]
    for values, pointed in ((abs(det), "max"), (-abs(det), "min"), (det, "min")):
        mesh = painted(plot_workspace(mapped.assign(det_A=values), "det_A"))
        low, high = mesh.get_clim()
        assert mesh.colorbar.extend == pointed
        shown = (low * bool(values.min() < 0), high * bool(values.max() > 0))
        assert mesh.colorbar.ax.get_ylim() == shown
    assert painted(plot_workspace(mapped)).colorbar.extend == "neither"


def test_a_singularity_locus_is_drawn_where_its_determinant_vanishes():
    x, y = np.linspace(-1, 1, 41), np.linspace(-1, 1, 31)
    det = xarray.DataArray(
        x[:, None] ** 2 + y**2 - 0.5, {"x": x, "y": y}, ("x", "y"), attrs={"units": "1"}
    )
    made = xarray.Dataset({"det_A": det, "reachable": xarray.ones_like(det, bool)})
    for name in "xy":
        made[name].attrs["units"] = "m"
    axes = plot_workspace(made, "det_A")
    circle = np.concatenate([line.get_xydata() for line in axes.lines])
    np.testing.assert_allclose(np.linalg.norm(circle, axis=1), np.sqrt(0.5), atol=2e-3)
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["actuator-singular"]


def test_a_mechanism_is_drawn_upon_a_map(mapped):
    robot = built("prr3")
    axes = plot_mechanism(robot, robot.home, plot_workspace(mapped))
    assert axes.get_xlim()[0] < 0.1 and axes.get_xlim()[1] > 0.9
    svg(axes.figure)


def test_a_map_without_a_reachable_pose_says_so():
    nowhere = analysis.workspace(built("prr3"), {"x": [5.0, 6.0], "y": [5.0, 6.0], "angle": 0.0})
    axes = plot_workspace(nowhere)
    assert [text.get_text() for text in axes.texts] == ["no pose is reached"]
    svg(axes.figure)


def test_other_quantities_and_other_axes_are_refused(mapped):
    with pytest.raises(
        lw.LinkworkError,
        match="the map holds no 'heat' over two coordinates; over two it holds reachable",
    ):
        plot_workspace(mapped, "heat")
    with pytest.raises(lw.LinkworkError, match=r"choose a plane of it by mapped.sel\(...\)"):
        plot_workspace(mapped.isel(x=3))


def test_coordinates_of_one_value_are_no_direction_of_the_picture(mapped):
    plane = mapped.expand_dims("angle")
    shown = np.ma.filled(painted(plot_workspace(plane)).get_array(), np.nan)
    np.testing.assert_array_equal(shown, mapped["conditioning"].transpose("y", "x"))
    line = mapped.isel(y=[13])
    assert line["reachable"].any()
    with pytest.raises(lw.LinkworkError, match="the map holds no 'conditioning' over two"):
        plot_workspace(line)
