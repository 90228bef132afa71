"""Bodies of milligrams and millimetres as MuJoCo has them: it takes moments of inertia down to
1e-15 kg m^2 about principal axes, of tensors down to 1e-14."""

from __future__ import annotations

import mujoco as mj
import numpy as np
import pytest

from linkwork import robots
from linkwork.formats import load, save
from linkwork.mechanism import Body, Frame, Inertia, Mechanism, RevoluteJoint, Tool

from tests.formats.mujoco_side import compiled
from tests.oracle.scaling import Scale

SMALL = Inertia(xx=5e-15, yy=8e-15, zz=9e-15, xy=1e-15, yz=-2e-15)


def pendulum(mass: float, inertia: Inertia, arm: float) -> Mechanism:
    hinge = RevoluteJoint(connects=("ground", "bob"), axis=(0, 1, 0))
    body = Body(mass=mass, centre_of_mass=(0, 0, -arm), inertia=inertia)
    end = RevoluteJoint(
        connects=("bob", "end"), axis=(0, 1, 0), frames=(Frame(position=(0, 0, -arm)), Frame())
    )
    tip = Body(mass=mass, centre_of_mass=(arm, 0, 0), inertia=Inertia(xx=1e-9, yy=1e-9, zz=1e-9))
    return Mechanism(
        bodies={"bob": body, "end": tip},
        joints={"j": hinge, "k": end},
        tools={"tip": Tool(body="end")},
    )


def inertia_in_mujoco(model: mj.MjModel, name: str) -> np.ndarray:
    """Return the tensor in the body's axes."""
    body, R = model.body(name), np.empty(9)
    mj.mju_quat2Mat(R, body.iquat)
    R = R.reshape(3, 3)
    return R @ np.diag(body.inertia) @ R.T


def test_small_moments_are_written_as_they_are(tmp_path):
    mechanism = pendulum(1e-6, SMALL, 1e-3)
    notes = save(mechanism, tmp_path / "m.xml")
    assert not any("inertia" in note for note in notes)
    model, _ = compiled(tmp_path / "m.xml")
    exact = SMALL.tensor()
    assert np.allclose(inertia_in_mujoco(model, "bob"), exact, rtol=0, atol=1e-12 * exact.max())
    again = load(tmp_path / "m.xml").mechanism.bodies["bob"].inertia.tensor()
    assert np.allclose(again, exact, rtol=0, atol=1e-12 * exact.max())


def test_moments_below_what_mujoco_takes_are_raised_to_that_and_noted(tmp_path):
    mechanism = pendulum(1e-6, Inertia(xx=4e-16, yy=5e-16, zz=6e-16), 1e-3)
    notes = save(mechanism, tmp_path / "m.xml")
    words = (
        "bodies.bob: has a moment of inertia of 4e-16 kg m^2, less than MuJoCo takes; all of its "
        "moments are written larger by 6e-16"
    )
    assert words in notes
    model, _ = compiled(tmp_path / "m.xml")
    assert sorted(model.body("bob").inertia) == pytest.approx([1e-15, 1.1e-15, 1.2e-15], rel=1e-9)


@pytest.mark.parametrize(("arm", "radius"), [(1.0, 1e-4), (5e-3, 5e-6)])
def test_points_get_a_radius_that_is_small_beside_the_mechanism(arm, radius, tmp_path):
    mechanism = pendulum(1e-3, Inertia(xx=0.0, yy=0.0, zz=0.0), arm)
    notes = save(mechanism, tmp_path / "m.xml")
    assert any(f"a radius of gyration of {radius:g} m is added" in note for note in notes)
    model, _ = compiled(tmp_path / "m.xml")
    assert model.body("bob").inertia == pytest.approx(1e-3 * radius**2)


@pytest.mark.parametrize("L", [1e-6, 1.0, 1e3])
def test_hinges_that_close_loops_are_read_back_at_any_size(L, tmp_path):
    """A hinge is two points on its line, a tenth of a micrometre apart in the smallest linkage."""
    described = Scale(robots.bennett(), L, L**-3).mechanism
    save(described, tmp_path / "linkage.xml")
    found = load(tmp_path / "linkage.xml").mechanism
    assert {joint.type for joint in found.joints.values()} == {"revolute"}
