"""Models that are read and written move in MuJoCo as the first file does: meshes, fluid, drives."""

import mujoco as mj
import numpy as np
import pytest
import trimesh

import linkwork as lw
from linkwork.formats import load, save
from linkwork.mechanism import BoxDrag, EllipsoidDrag, Fluid

from tests.formats.test_mjcf_actuators import ACTUATORS, ARM, compared
from tests.formats.test_mjcf_fluid import AIR, FIN, LAST


def again(path, tmp_path):
    """Write what a file is read as, and return the second file and the notes."""
    (tmp_path / "again").mkdir(exist_ok=True)
    second = tmp_path / "again" / "model.xml"
    return second, save(load(path).mechanism, second)


@pytest.mark.parametrize(
    "shape", ["", 'type="ellipsoid" size="0.1 0.25 0.4"', 'type="sphere" size="0.1"']
)
def test_fluids_are_written(tmp_path, shape):
    text = ARM.replace(LAST, FIN.format(shape, "") if shape else LAST)
    path = tmp_path / "arm.xml"
    path.write_text(
        text.format(joint="", actuators=ACTUATORS).replace("<default>", AIR + "<default>", 1)
    )
    first = load(path).mechanism
    second, notes = again(path, tmp_path)
    assert not any("fluid" in note for note in notes)
    written = load(second).mechanism
    assert not written.caveats and written.fluid == first.fluid
    theirs = sorted(drag.type for drag in written.drags.values())
    assert theirs == sorted(drag.type for drag in first.drags.values())
    assert compared(second, tmp_path, mechanism=first) < 1e-10


def test_meshes_are_written_where_mujoco_reads_them(tmp_path):
    trimesh.creation.box((0.1, 0.2, 0.3)).export(tmp_path / "link.stl")
    trimesh.creation.icosphere(1).export(tmp_path / "ball.ply")
    frame = lw.Frame(position=(0.1, 0, 0), rotation=(0.3, 0.2, 0.1))
    half = lw.MeshFile(file=str(tmp_path / "link.stl"), scale=(0.5, 1, 1), frame=frame)
    other = lw.MeshFile(file=str(tmp_path / "ball.ply"))
    gone = lw.MeshFile(file=str(tmp_path / "gone.stl"))
    inertia = lw.Inertia(xx=0.01, yy=0.01, zz=0.01)
    bodies = {
        "arm": lw.Body(mass=1, inertia=inertia, shapes=(half, half)),
        "tip": lw.Body(mass=1, inertia=inertia, shapes=(half, other, gone)),
    }
    joints = {
        "a": lw.RevoluteJoint(connects=("ground", "arm"), axis=(0, 1, 0)),
        "b": lw.RevoluteJoint(connects=("arm", "tip"), axis=(0, 0, 1)),
    }
    path = tmp_path / "model.xml"
    notes = save(lw.Mechanism(bodies=bodies, joints=joints), path)
    assert 'file="link.stl"' in path.read_text() and path.read_text().count("<mesh ") == 1
    (told,) = (note for note in notes if "shapes that are left out" in note)
    assert told.startswith("tip: ")
    # Where MuJoCo has the vertices, and what is read again.
    model = mj.MjModel.from_xml_path(str(path))
    data = mj.MjData(model)
    mj.mj_forward(model, data)
    corners = data.geom_xpos[0] + model.mesh_vert @ data.geom_xmat[0].reshape(3, 3).T
    box = trimesh.load(tmp_path / "link.stl").vertices * (0.5, 1, 1)
    turn = lw.formats.poses.of_frame(frame)
    expected = box @ turn[:3, :3].T + turn[:3, 3]
    gaps = np.linalg.norm(corners[:, None] - expected[None], axis=2)
    assert max(gaps.min(axis=0).max(), gaps.min(axis=1).max()) < 1e-6
    back = load(path).mechanism.bodies
    assert [len(body.shapes) for body in back.values()] == [2, 1]
    assert back["arm"].shapes[0].scale == (0.5, 1, 1)


FALLING = {
    "bodies": {"leaf": {"mass": 0.3, "inertia": {"xx": 0.01, "yy": 0.02, "zz": 0.025}}},
    "joints": {"drop": {"type": "free", "connects": ["ground", "leaf"]}},
}
FLAKE = EllipsoidDrag(body="leaf", radii=(0.1, 0.2, 0.3))


@pytest.mark.parametrize(
    ("drags", "written"),
    [
        ({"a": FLAKE, "b": FLAKE.model_copy(update={"blunt": 0.9})}, True),
        ({"a": FLAKE.model_copy(update={"added_mass": (0, 0, 0)})}, False),
        ({"a": FLAKE, "b": BoxDrag(body="leaf", size=(1, 1, 1))}, False),
        ({"a": BoxDrag(body="leaf", size=(1, 1, 1))}, False),
        ({}, None),
    ],
)
def test_a_fluid_that_mujoco_has_otherwise_is_told(tmp_path, drags, written):
    mechanism = lw.Mechanism(**FALLING, fluid=Fluid(density=1.2), drags=drags)
    notes = save(mechanism, tmp_path / "leaf.xml")
    assert any(note.startswith("the fluid is left out: ") for note in notes) == (written is False)
    back = load(tmp_path / "leaf.xml").mechanism
    assert len(back.drags) == (len(drags) if written else 0)
    # What MuJoCo sums of Lamb's integrals is not quite that.
    assert sum("has it carry along differs by" in note for note in notes) == len(back.drags)
    again = save(back, tmp_path / "again.xml") if written else ()
    assert not any("carry along" in note or "left out" in note for note in again)
