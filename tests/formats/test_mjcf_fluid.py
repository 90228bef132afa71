"""Fluids of MJCF files: accelerations are MuJoCo's."""

import re

import mujoco as mj
import numpy as np
import pytest

import linkwork as lw
from linkwork.equations.fluid import added
from linkwork.formats import load
from linkwork.formats.mjcf.carried_fluid import carried

from tests.formats import mujoco_side as side
from tests.formats.test_mjcf_actuators import ACTUATORS, ARM, compared

AIR = '<option density="1.2" viscosity="0.3" wind="1 2 -0.5"/>'
LAST = '<geom type="capsule" size="0.03" fromto="0 0 0 0.4 0 0.1"/>'
FIN = '<geom {} pos="0.1 0.2 0.3" euler="0.3 0.2 0.1" fluidshape="ellipsoid" {}/>'
POINTS = "0 0 0 1 0 0 0 2 0 0 0 3 0.5 0.5 4"
SHELL = f'<asset><mesh name="m" vertex="{POINTS}" scale="0.2 0.2 0.2"/></asset>'


def written(tmp_path, text, option=AIR):
    path = tmp_path / "arm.xml"
    path.write_text(text.replace("<default>", f"{option}<default>", 1))
    return path


def test_boxes_of_inertia_are_resisted_as_in_mujoco(tmp_path):
    path = written(tmp_path, ARM.format(joint="", actuators=ACTUATORS))
    mechanism = load(path).mechanism
    assert not mechanism.caveats
    assert [drag.type for drag in mechanism.drags.values()] == 4 * ["box"]
    assert compared(path, tmp_path) < 1e-12
    still = written(tmp_path, ARM.format(joint="", actuators=ACTUATORS), AIR.replace("1.2", "0"))
    assert load(still).mechanism.fluid.density == 0
    assert compared(still, tmp_path) < 1e-12


def test_axes_of_equal_moments_are_mujocos(tmp_path):
    """A sphere and a cube have no axes of their own, but MuJoCo's box has those of the geom."""
    for geom in ('type="box" size="0.1 0.1 0.1"', 'type="sphere" size="0.1"'):
        turned = f'<geom {geom} pos="0.1 0.2 0.3" euler="0.3 0.2 0.1"/>'
        path = written(tmp_path, ARM.replace(LAST, turned).format(joint="", actuators=""))
        assert not load(path).mechanism.caveats
        assert compared(path, tmp_path) < 1e-12


def test_axes_that_cannot_be_known_are_told(tmp_path):
    """Two spheres on a slanted line: turned about it, the box would be the same by its moments."""
    pair = '<geom size="0.1"/><geom size="0.1" pos="0.1 0.2 0.3"/>'
    path = written(tmp_path, ARM.replace(LAST, pair).format(joint="", actuators=""))
    (caveat,) = load(path).mechanism.caveats
    assert "<body 'b'> has equal moments of inertia" in caveat


@pytest.mark.sample(4)
@pytest.mark.parametrize(
    "shape",
    [
        'type="ellipsoid" size="0.1 0.25 0.4"',
        'type="capsule" size="0.1 0.25"',
        'type="cylinder" size="0.1 0.3"',
        'type="box" size="0.03 0.02 0.5"',
        'type="sphere" size="0.1"',
        'type="mesh" mesh="m" density="50"',
    ],
)
def test_ellipsoids_are_moved_as_in_mujoco(tmp_path, shape):
    """With MuJoCo's own added masses, to rounding; but it holds meshes in single precision."""
    fin = FIN.format(shape, 'fluidcoef="0.4 0.2 1.3 0.9"')
    path = written(tmp_path, ARM.replace(LAST, fin).format(joint="", actuators=ACTUATORS))
    path.write_text(path.read_text().replace("<default>", SHELL + "<default>", 1))
    imported = load(path).mechanism
    model = mj.MjModel.from_xml_path(str(path))
    (row,) = model.geom_fluid[model.geom_fluid[:, 0] > 0]
    drag = next(drag for drag in imported.drags.values() if drag.type == "ellipsoid")
    assert (drag.blunt, drag.slender, drag.angular, drag.lift, drag.magnus) == tuple(row[1:6])
    close = 1e-6 if "mesh" in shape else 1e-12
    np.testing.assert_allclose(drag.added_mass, row[6:9], rtol=close)
    np.testing.assert_allclose(drag.added_inertia, row[9:12], rtol=close)
    assert compared(path, tmp_path) < (1e-8 if "mesh" in shape else 1e-12)


def test_added_masses_are_mujocos_sums_near_lambs_integrals():
    """MuJoCo's sum is Lamb's integral to 6e-7 for a sphere (k = 2/3, m_a = V / 2, I_a = 0), and to
    2 to 4 digits of thin plates."""
    sphere = carried((0.1, 0.1, 0.1))
    off = np.abs(sphere.mass / (2 / 3 * np.pi * 0.1**3) - 1)
    assert (off < 6e-7).all() and (off > 5e-7).all() and not sphere.inertia.any()
    for radii, close in {
        (0.1, 0.2, 0.3): 1e-6,
        (0.3, 0.003, 0.2): 1e-4,
        (1, 1, 0.004): 5e-3,
    }.items():
        for theirs, lambs in zip(carried(radii), added(np.array(radii)), strict=True):
            assert np.abs(theirs - lambs).max() < close * np.abs(lambs).max()


def test_sums_that_are_far_from_the_integral_are_noted(tmp_path):
    fin = FIN.format('name="fin" type="cylinder" size="0.3 0.001"', "")
    path = written(tmp_path, ARM.replace(LAST, fin).format(joint="", actuators=""))
    rows = mj.MjModel.from_xml_path(str(path)).geom_fluid
    theirs, lambs = rows[rows[:, 0] > 0][0][6:9], added(np.array([0.3, 0.3, 0.001])).mass
    off = np.abs(theirs / lambs - 1).max()
    imported = load(path)
    (note,) = (note for note in imported.notes if "carries along fluid" in note)
    told = re.search("<geom 'fin'> .* as MuJoCo sums it, (.*) off the integral", note)
    assert told is not None and 0.004 < off < float(told[1]) < 2 * off
    assert note not in imported.mechanism.caveats


@pytest.mark.parametrize("size", ["0.001 0.002 0.003", "0.02 0.3 0.4", "0.01 0.01 0.01"])
def test_forces_on_small_and_slow_ellipsoids_are_mujocos(tmp_path, size):
    path = tmp_path / "fish.xml"
    path.write_text(f"""<mujoco><option density="1000" gravity="0 0 0"/><worldbody>
    <body><freejoint name="f"/><geom type="ellipsoid" size="{size}" fluidshape="ellipsoid"/></body>
    </worldbody></mujoco>""")
    robot, (model, data) = lw.Robot(load(path).mechanism), side.compiled(path)
    assert not robot.mechanism.caveats
    home = dict(zip(robot.coordinates, [0, 0, 0, 1, 0, 0, 0], strict=True))
    for speed in (1e-6, 1e-3, 1.0):
        rates = dict(zip(robot.rates, speed * np.array([0.6, -0.6, 0.5, 2, -1, 3]), strict=True))
        side.set_state(model, data, home, rates)
        expected = side.accelerations(model, data)
        found = robot.forward_dynamics(robot.state(home, rates), [])
        wanted = np.array([expected[name] for name in robot.independent])
        assert np.abs(found - wanted).max() < 1e-12 * np.abs(wanted).max()


def test_files_of_water_are_read_whole(tmp_path):
    """Fluid acts on nothing that has no mass or stands still, and the last option holds."""
    path = tmp_path / "pond.xml"
    path.write_text("""<mujoco><option density="5"/><option density="1000" gravity="0 0 -1"/>
    <worldbody><body name="rock"><geom size="0.1"/></body>
    <body name="fish"><freejoint/><geom type="box" size="0.1 0.2 0.3"/>
    <body name="mark"><site name="s"/></body></body></worldbody></mujoco>""")
    mechanism = load(path).mechanism
    assert mechanism.fluid == lw.mechanism.Fluid(density=1000)
    assert list(mechanism.drags) == ["fish"] and not mechanism.caveats
    assert mechanism.drags["fish"].size == pytest.approx((0.2, 0.4, 0.6))
    robot = lw.Robot(mechanism)
    assert np.isfinite(robot.forward_dynamics(robot.home, [])).all()
