"""Shapes in model files: where and how large MuJoCo and Pinocchio have them, and that they come
back from a file."""

import mujoco as mj
import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial.transform import Rotation

import linkwork as lw
from linkwork.formats import load, poses, save
from linkwork.mechanism import (
    Body,
    Box,
    Capsule,
    Cylinder,
    Frame,
    Inertia,
    MeshFile,
    Polygon,
    Sphere,
)
from linkwork.scene.meshes import piece_of

from tests.formats.meshes import lump, write_stl

TYPES = {
    "box": mj.mjtGeom.mjGEOM_BOX,
    "cylinder": mj.mjtGeom.mjGEOM_CYLINDER,
    "sphere": mj.mjtGeom.mjGEOM_SPHERE,
}
TYPES["capsule"] = mj.mjtGeom.mjGEOM_CAPSULE
TURNED = Frame(position=(0.1, -0.2, 0.3), rotation=(0.4, 1.0, -0.3))
SHAPES = (
    Box(size=(0.1, 0.2, 0.3), frame=TURNED, colour=(0.25, 0.5, 1.0)),
    Cylinder(radius=0.02, length=0.3, frame=Frame(position=(0.0, 0.1, 0.0))),
    Sphere(radius=0.05, colour=(0.0, 0.0, 0.0)),
    Capsule(radius=0.03, length=0.2, frame=TURNED),
)
MJCF = """<mujoco>
  <compiler angle="radian"/>
  <default><geom mass="0.1"/><default class="red"><geom rgba="1 0 0 1"/>
    <material rgba="0 0.5 0 1"/></default></default>
  <asset><material name="steel" rgba="0.2 0.4 0.6 1"/><material name="grass" class="red"/>
    <texture name="t" builtin="flat" type="2d" width="4" height="4"/>
    <material name="wood" texture="t"/></asset>
  <worldbody>
    <body name="b" pos="1 2 3">
      <joint name="j"/>
      <frame pos="0.1 0.2 0.3" euler="0.1 0.2 0.3">
        <geom name="g0" type="box" size="0.1 0.2 0.3" pos="0.5 0 0" quat="1 2 3 4" class="red"/>
        <geom name="g1" type="capsule" size="0.02" fromto="0 0 0 0.1 0.2 0.3" material="steel"/>
      </frame>
      <geom name="g2" type="cylinder" size="0.02 0.1" axisangle="1 1 0 0.5"
        rgba="0.1 0.2 0.3 1" material="steel"/>
      <geom name="g3" size="0.07" material="grass"/>
      <geom name="g4" type="sphere" size="0.04" material="wood"/>
      <geom name="g5" type="box" size="0.01" fromto="0 0 0 0 0.3 0"/>
      {more}
    </body>
  </worldbody>
</mujoco>"""
COLOURS = [(1, 0, 0), (0.2, 0.4, 0.6), (0.1, 0.2, 0.3), (0, 0.5, 0), None, None]
MOMENTS = '<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/>'
VISUAL = '<visual><origin xyz="0.1 0.2 0.3" rpy="0.4 0.5 0.6"/><geometry>{0}</geometry>{1}</visual>'
URDF = f"""<robot name="arm">
  <material name="blue"><color rgba="0 0 1 1"/></material>
  <link name="base"><visual><geometry><sphere radius="1"/></geometry></visual></link>
  <link name="a"><inertial><mass value="1"/>{MOMENTS}</inertial>{{0}}</link>
  <link name="pad"><visual><geometry><sphere radius="0.3"/></geometry></visual></link>
  <joint name="j" type="continuous"><parent link="base"/><child link="a"/></joint>
  <joint name="k" type="fixed"><parent link="a"/><child link="pad"/>
    <origin xyz="0 0 0.4" rpy="1 0 0"/></joint>
</robot>"""


def read(text, tmp_path, name="model.xml"):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return load(path)


def pendulum(*shapes, **bodies):
    inertia = Inertia(xx=0.1, yy=0.1, zz=0.1)
    return lw.Mechanism(
        bodies={"arm": Body(mass=1.0, inertia=inertia, shapes=shapes), **bodies},
        joints={"hinge": lw.RevoluteJoint(connects=("ground", "arm"))}
        | {
            f"hinge_{name}": lw.RevoluteJoint(connects=("arm", name), axis=(1.0, 0.0, 0.0))
            for name in bodies
        },
    )


def size_in_mujoco(shape):
    match shape:
        case Box():
            return np.array(shape.size) / 2
        case Sphere():
            return np.array([shape.radius, 0, 0])
    return np.array([shape.radius, shape.length / 2, 0])


def assert_same_geom(model, number, shape):
    assert model.geom_type[number] == TYPES[shape.type]
    np.testing.assert_allclose(model.geom_size[number], size_in_mujoco(shape), atol=1e-12)
    np.testing.assert_allclose(model.geom_pos[number], shape.frame.position, atol=1e-12)
    theirs = Rotation.from_quat(model.geom_quat[number], scalar_first=True)
    assert (theirs.inv() * Rotation.from_rotvec(shape.frame.rotation)).magnitude() < 1e-9


def assert_same_shape(one, other):
    assert one.model_copy(update={"frame": Frame()}) == other.model_copy(update={"frame": Frame()})
    np.testing.assert_allclose(poses.of_frame(one.frame), poses.of_frame(other.frame), atol=1e-12)


def test_geoms_are_where_mujoco_has_them(tmp_path):
    imported, model = (
        read(MJCF.format(more=""), tmp_path),
        mj.MjModel.from_xml_string(MJCF.format(more="")),
    )
    shapes = imported.mechanism.bodies["b"].shapes
    assert [shape.colour for shape in shapes] == COLOURS
    assert imported.notes == ()
    assert len(shapes) == model.ngeom
    for number, shape in enumerate(shapes):
        assert_same_geom(model, number, shape)


@pytest.mark.parametrize(
    ("geom", "words"),
    [
        (
            '<geom type="mesh" mesh="hull" mass="0"/>',
            "is a mesh that is not shown: there is no mesh 'hull'",
        ),
        ('<geom size="0.1" rgba="1 0 0 0.5"/>', "is half transparent; shapes are opaque here"),
        ('<geom size="0.1" rgba="1 0 0 0"/>', None),
        ('<geom type="box" size="1 1 1" group="3"/>', None),
    ],
)
def test_what_is_not_shown_is_named_or_hidden_in_mujoco_too(geom, words, tmp_path):
    imported = read(MJCF.format(more=geom), tmp_path)
    assert len(imported.mechanism.bodies["b"].shapes) == 6 + ("transparent" in str(words))
    assert len(imported.notes) == (words is not None)
    assert all(words in note for note in imported.notes)


def test_geoms_of_the_world_are_named(tmp_path):
    text = MJCF.format(more="").replace(
        "<worldbody>", '<worldbody><geom type="plane" size="1 1 1"/><geom size="1"/>'
    )
    (note,) = read(text, tmp_path).notes
    assert "<geom> stands in the world and is not shown: only bodies have shapes here" in note


def test_shapes_are_written_as_geoms_without_mass_or_contact(tmp_path):
    save(pendulum(*SHAPES), tmp_path / "model.xml")
    model = mj.MjModel.from_xml_path(str(tmp_path / "model.xml"))
    assert model.ngeom == len(SHAPES)
    assert not model.geom_contype.any() and not model.geom_conaffinity.any()
    assert model.body("arm").mass == 1.0
    for number, shape in enumerate(SHAPES):
        assert_same_geom(model, number, shape)
        assert model.geom_rgba[number] == pytest.approx((*(shape.colour or (0.5, 0.5, 0.5)), 1))


def test_shapes_come_back(tmp_path):
    save(pendulum(*SHAPES, other=Body(mass=1.0)), tmp_path / "model.xml")
    imported = load(tmp_path / "model.xml")
    back = imported.mechanism.bodies
    for one, other in zip(back["arm"].shapes, SHAPES, strict=True):
        assert_same_shape(one, other)
    assert back["other"].shapes == ()  # what was drawn for want of shapes is none


def test_a_body_in_parts_is_shown_once(tmp_path):
    wedge = Body(mass=1.0, inertia=Inertia(xx=1.0, yy=1.0, zz=1.0), shapes=SHAPES)
    ways = {
        ("ground", "a"): (1.0, 0.0, 0.0),
        ("a", "b"): (0.0, 1.0, 0.0),
        ("ground", "b"): (0.6, 0.8, 0.0),
    }
    joints = {
        f"slide_{n}": lw.PrismaticJoint(connects=ends, axis=axis)
        for n, (ends, axis) in enumerate(ways.items())
    }
    save(lw.Mechanism(bodies={"a": wedge, "b": wedge}, joints=joints), tmp_path / "model.xml")
    model = mj.MjModel.from_xml_path(str(tmp_path / "model.xml"))
    assert sorted(model.body_geomnum) == [0, 0, 4, 4]  # the world and a part have none
    back = load(tmp_path / "model.xml").mechanism.bodies
    assert {name: len(body.shapes) for name, body in back.items()} == {"a": 4, "b": 4}


def test_polygons_are_plates_in_mjcf_and_come_back(tmp_path):
    """MuJoCo's mesh has the plate's corners where the body has them; one asset serves two shapes of
    one polygon."""
    corners = ((0.0, 0.0), (1.0, 0.0), (0.3, 0.7))
    polygon = Polygon(points=corners, thickness=0.1, frame=TURNED, colour=(0.25, 0.5, 1.0))
    again = Polygon(points=corners, thickness=0.1)
    notes = save(pendulum(polygon, SHAPES[2], again), tmp_path / "model.xml")
    assert not any("left out" in note for note in notes)
    model = mj.MjModel.from_xml_path(str(tmp_path / "model.xml"))
    assert model.nmesh == 1
    data = mj.MjData(model)
    mj.mj_kinematics(model, data)
    geom = next(k for k in range(model.ngeom) if model.geom_type[k] == mj.mjtGeom.mjGEOM_MESH)
    at, R = data.geom_xpos[geom], data.geom_xmat[geom].reshape(3, 3)
    body = model.geom_bodyid[geom]
    found = model.mesh_vert @ R.T + at - data.xpos[body]
    wanted = [poses.of_frame(TURNED) @ (*corner, 1.0) for corner in polygon.corners]
    in_order = [min(found, key=lambda p, w=w: np.linalg.norm(p - w[:3])) for w in wanted]
    np.testing.assert_allclose(in_order, np.array(wanted)[:, :3], atol=1e-6)
    back = load(tmp_path / "model.xml").mechanism.bodies["arm"].shapes
    assert [shape.type for shape in back] == ["polygon", "sphere", "polygon"]
    assert (back[0].points, back[0].thickness) == (polygon.points, polygon.thickness)
    np.testing.assert_allclose(back[0].frame.position, TURNED.position)
    assert (back[0].colour, back[2].frame) == (polygon.colour, again.frame)


def test_visuals_are_where_pinocchio_has_them(tmp_path):
    solids = [
        '<box size="0.1 0.2 0.3"/>',
        '<cylinder radius="0.1" length="0.5"/>',
        '<sphere radius="0.2"/>',
    ]
    colour = '<material name="own"><color rgba="1 0.5 0 1"/></material>'
    text = URDF.format("".join(map(VISUAL.format, solids, (colour, "<material name='blue'/>", ""))))
    imported = read(text, tmp_path, "arm.urdf")
    shapes = imported.mechanism.bodies["a"].shapes
    model = pin.buildModelFromXML(text)
    geometry = pin.buildGeomFromUrdfString(model, text, pin.GeometryType.VISUAL)
    base, *theirs = geometry.geometryObjects
    assert "base" in base.name
    for shape, item in zip(shapes, theirs, strict=True):
        np.testing.assert_allclose(
            poses.of_frame(shape.frame), item.placement.homogeneous, atol=1e-12
        )
    box, cylinder, ball, pad = (item.geometry for item in theirs)
    assert shapes[0].size == pytest.approx(2 * box.halfSide)
    assert (shapes[1].radius, shapes[1].length) == pytest.approx(
        (cylinder.radius, 2 * cylinder.halfLength)
    )
    assert (shapes[2].radius, shapes[3].radius) == pytest.approx((ball.radius, pad.radius))
    assert [shape.colour for shape in shapes] == [(1, 0.5, 0), (0, 0, 1), None, None]
    assert any(
        "<visual> of 'base' is not shown: only bodies have shapes here, not ground" in n
        for n in imported.notes
    )


def test_capsules_and_other_visuals_of_links(tmp_path):
    solids = ['<capsule radius="0.1" length="0.5"/>', '<mesh filename="hull.stl"/>']
    imported = read(
        URDF.format("".join(VISUAL.format(solid, "") for solid in solids)), tmp_path, "arm.urdf"
    )
    capsule, pad = imported.mechanism.bodies["a"].shapes
    assert isinstance(capsule, Capsule) and capsule.length == 0.5
    assert isinstance(pad, Sphere)
    assert any("<visual> is not shown: its mesh is not there" in note for note in imported.notes)


MESHES = """<mujoco><compiler meshdir="parts"/><asset>
<mesh name="x" file="x.stl" scale="-2 -2 -2" refpos="0.1 0.2 0.3" refquat="1 0.2 0.3 0.4"/>
<mesh name="y" file="x.stl" scale="1 2 3" refquat="1 0.2 0.3 0.4"/></asset><worldbody>
<body name="b"><joint/><geom type="mesh" mesh="x" pos="1 2 3" euler="10 20 30" {more}/></body>
</worldbody></mujoco>"""


@pytest.mark.parametrize("scale", ["", 'scale="1 2 3"'])
def test_meshes_of_geoms_are_where_mujoco_has_them(tmp_path, scale):
    """The vertices that MuJoCo keeps in the mesh's principal axes, in the body's frame."""
    (tmp_path / "parts").mkdir()
    write_stl(tmp_path / "parts" / "x.stl", *lump())
    path = tmp_path / "model.xml"
    text = MESHES.format(more='rgba="1 0 0 1"')
    if scale:
        text = text.replace('scale="-2 -2 -2"', scale).replace('refquat="1 0.2 0.3 0.4"', "")
    path.write_text(text)
    model = mj.MjModel.from_xml_path(str(path))
    turn = np.zeros(9)
    mj.mju_quat2Mat(turn, model.geom_quat[0])
    first, count = model.mesh_vertadr[0], model.mesh_vertnum[0]
    theirs = model.mesh_vert[first : first + count] @ turn.reshape(3, 3).T + model.geom_pos[0]
    (shape,) = load(path).mechanism.bodies["b"].shapes
    assert isinstance(shape, MeshFile) and shape.colour == (1, 0, 0)
    ours = piece_of(shape).moved(
        np.array(shape.frame.position),
        Rotation.from_rotvec(shape.frame.rotation).as_matrix(),
    )
    order = [np.lexsort(points.round(4).T) for points in (ours.corners, theirs)]
    assert ours.corners[order[0]] == pytest.approx(theirs[order[1]], abs=2e-6)


def test_a_mesh_that_no_frame_and_scale_give_is_noted(tmp_path):
    (tmp_path / "parts").mkdir()
    write_stl(tmp_path / "parts" / "x.stl", *lump())
    text = MESHES.format(more="").replace('mesh="x"', 'mesh="y"')
    imported = read(text, tmp_path, "model.xml")
    assert not imported.mechanism.bodies["b"].shapes
    assert any("it is turned, and scaled by different factors" in note for note in imported.notes)


@pytest.mark.parametrize(
    ("visual", "collision", "count", "words"),
    [
        ("package://arm/parts/x.stl", "", 1, ""),
        ("parts/x.stl", "parts/x.stl", 1, ""),
        ("x.fbx", "package://arm/parts/x.stl", 1, "meshes are .stl, .obj"),
        ("package://hand/x.stl", "", 0, "its mesh is not there, or lies outside"),
        ("../../x.stl", "", 0, "its mesh is not there, or lies outside"),
    ],
)
def test_meshes_of_links(tmp_path, visual, collision, count, words):
    folder = tmp_path / "arm"
    (folder / "parts").mkdir(parents=True)
    (folder / "x.fbx").write_text("")
    write_stl(folder / "parts" / "x.stl", *lump())
    shown = [
        f'<{tag}><geometry><mesh filename="{file}" scale="1 2 3"/></geometry></{tag}>'
        for tag, file in (("visual", visual), ("collision", collision))
        if file
    ]
    text = f"""<robot name="arm"><link name="base"/><link name="a"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1"/></inertial>{"".join(shown)}</link><joint name="j"
type="continuous"><parent link="base"/><child link="a"/></joint></robot>"""
    imported = read(text, folder, "arm.urdf")
    shapes = imported.mechanism.bodies["a"].shapes
    assert [getattr(shape, "scale", None) for shape in shapes] == [(1, 2, 3)] * count
    assert any(words in note for note in imported.notes)
