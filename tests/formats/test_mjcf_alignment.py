"""Free bodies whose frames MuJoCo puts into their principal axes (align, alignfree): poses,
coordinates and accelerations are MuJoCo's."""

import numpy as np
import pytest

import linkwork as lw
from linkwork.formats import load
from linkwork.formats.mjcf.principal import principal_axes

from tests.formats import mujoco_side as side
from tests.model_collections import MuJoCoSide, apart

BOX = '<geom name="{0}" type="box" size="0.1 0.2 0.3" pos="0.1 -0.2 0.3" quat="1 2 -1 0.5"/>'
OTHER = '<geom type="capsule" size="0.1 0.2" pos="-0.2 0.1 0" euler="10 50 0" density="700"/>'
FULL = '<inertial pos="0.1 0 0.2" mass="2" fullinertia="0.3 0.4 0.35 0.05 -0.02 0.03"/>'
TURNED = '<inertial pos="0 0.2 0" quat="1 1 0 3" mass="2" diaginertia="0.3 0.4 0.2"/>'
BODIES = {
    "one geom": BOX.format("g"),
    "two geoms": BOX.format("g") + OTHER,
    "a frame": f'<frame pos="0.1 0.1 0" euler="0 30 20">{BOX.format("g")}</frame>{OTHER}',
    "full inertia": FULL + BOX.format("g"),
    "turned inertia": TURNED + BOX.format("g") + OTHER,
    "a mesh": '<geom type="mesh" mesh="m" pos="0.1 0 0" euler="20 0 10"/>',
}
MODEL = """<mujoco><compiler alignfree="{alignfree}"/>
<option density="30" viscosity="0.2" wind="1 0.3 -2"/>
<default><geom contype="0" conaffinity="0"/></default>
<asset><mesh name="m" vertex="0 0 0 1 0 0 0 2 0 0 0 3 0.5 0.5 4" scale="0.2 0.2 0.2"/></asset>
<worldbody>
 <body name="a" pos="1 2 3" euler="20 0 10">
  {joint}{body}<site name="s" pos="0.3 0 0.1" euler="0 20 0"/></body>
 <body name="b" pos="-1 0 3" euler="0 70 10"><freejoint name="q" align="{own}"/>{other}
  {child}<site name="t" pos="0.2 0.1 0"/></body>
</worldbody>
<tendon><spatial name="rope" stiffness="20" damping="0.5" springlength="0.2">
 <site site="s"/><site site="t"/></spatial></tendon>
{more}</mujoco>"""
LOOSE = '<joint name="p" type="free" damping="0.3" armature="0.2"/>'
CHILD = '<body name="c" pos="0.3 0 0"><joint name="h" axis="0 1 1"/><geom size="0.1"/></body>'


def written(tmp_path, **parts):
    path = tmp_path / "loose.xml"
    path.write_text(
        MODEL.format(
            **{
                "alignfree": "true",
                "own": "auto",
                "joint": LOOSE,
                "body": BODIES["two geoms"],
                "other": BOX.format("f"),
                "child": "",
                "more": "",
            }
            | parts
        )
    )
    return path


def stands_as_in_mujoco(path, close=1e-8):
    """Compare the poses of all bodies, and their coordinates, at home."""
    robot = lw.Robot(load(path).mechanism)
    model, data = side.compiled(path)
    own = dict(zip(robot.coordinates, robot.home.positions, strict=True))
    for joint, labels, _ in side.joints(model):
        q = np.array([own[label] for label in labels])
        want = model.qpos0[joint.qposadr[0] :][: len(q)]
        if len(q) > 1 and q[-4:] @ want[-4:] < 0:
            q[-4:] *= -1
        np.testing.assert_allclose(q, want, rtol=0, atol=close)
    side.mj.mj_kinematics(model, data)
    for name, (p, R) in robot.body_poses(robot.home).items():
        np.testing.assert_allclose(p, data.body(name).xpos, rtol=0, atol=close)
        np.testing.assert_allclose(R, data.body(name).xmat.reshape(3, 3), rtol=0, atol=close)


def moves_apart(path):
    return apart(lw.Robot(load(path).mechanism), MuJoCoSide(path))


@pytest.mark.sample(2)
@pytest.mark.parametrize("body", BODIES)
def test_frames_of_free_bodies_are_put_into_their_axes(body, tmp_path):
    path = written(tmp_path, body=BODIES[body])
    assert not load(path).mechanism.caveats
    single = "mesh" in body  # the precision in which MuJoCo holds meshes
    stands_as_in_mujoco(path, 1e-6 if single else 1e-8)
    assert moves_apart(path) < (1e-7 if single else 1e-10)


@pytest.mark.sample(3)
@pytest.mark.parametrize("alignfree", ["true", "false"])
@pytest.mark.parametrize("own", ["true", "false", "auto"])
@pytest.mark.parametrize("child", ["", CHILD], ids=["", "carrying"])
def test_who_is_aligned(alignfree, own, child, tmp_path):
    """The joint's own word goes first, and a body that carries another one stays as it is."""
    path = written(tmp_path, alignfree=alignfree, own=own, child=child)
    stands_as_in_mujoco(path)
    assert moves_apart(path) < 1e-10


def test_coordinates_of_keyframes_and_anchors_are_told_of_the_new_frame(tmp_path):
    weld = (
        '<equality><weld body1="a" body2="b"/><connect body1="a" anchor="0.3 0.2 0.1"/></equality>'
    )
    stands_as_in_mujoco(written(tmp_path, more=weld.replace('<weld body1="a" body2="b"/>', "")))
    stands_as_in_mujoco(written(tmp_path, more=weld))
    qpos = "1 2 3 0.8 0.6 0 0 0 0.1 2 1 0 0 0"
    key = f'<keyframe><key name="home" qpos="{qpos}"/></keyframe>'
    robot = lw.Robot(load(written(tmp_path, more=key)).mechanism)
    np.testing.assert_allclose(robot.home.positions, [float(x) for x in qpos.split()], atol=1e-12)


@pytest.mark.parametrize("size", [1e-9, 1.0, 1e6])
def test_principal_axes_have_mujocos_order_and_signs(size):
    random = np.random.default_rng(3)
    for case in range(30):
        parts = random.normal(size=(3, 3)) * (case % 3 + 1, 1, 1)
        tensor = np.trace(parts @ parts.T) * np.eye(3) - parts @ parts.T
        if case % 5 == 0:  # of revolution
            moments = random.permutation([1.0, 1.0, 1.5])
            turn, _ = np.linalg.qr(parts)
            tensor = turn @ np.diag(moments) @ turn.T
        tensor = size * (tensor + tensor.T) / 2
        places = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
        full = " ".join(repr(float(tensor[at])) for at in places)
        model, _ = side.compiled(
            f'<mujoco><worldbody><body><freejoint/><inertial pos="0 0 0" mass="1" '
            f'fullinertia="{full}"/></body></worldbody></mujoco>'
        )
        want = side.rotation(model.body_iquat[1])
        np.testing.assert_allclose(principal_axes(tensor), want, atol=1e-6)
        R = principal_axes(tensor)
        off = R.T @ tensor @ R
        assert np.abs(off - np.diag(np.diag(off))).max() < 1e-11 * size


@pytest.mark.parametrize("from_geoms", ["true", "auto"])
@pytest.mark.parametrize("geom", ['group="5"', 'mass="0"', ""], ids=["hidden", "massless", "heavy"])
def test_inertial_counts_where_geoms_that_shall_give_it_have_none(from_geoms, geom, tmp_path):
    compiler = f'<compiler inertiafromgeom="{from_geoms}" inertiagrouprange="0 3"/>'
    path = tmp_path / "model.xml"
    path.write_text(
        f'<mujoco>{compiler}<worldbody><body name="a"><joint name="j" axis="0 1 0"/>{TURNED}'
        f'<geom size="0.1" pos="0.2 0 0" {geom}/></body></worldbody></mujoco>'
    )
    body = load(path).mechanism.bodies["a"]
    model, _ = side.compiled(path)
    assert body.mass == pytest.approx(model.body_mass[1])
    np.testing.assert_allclose(body.centre_of_mass, model.body_ipos[1], atol=1e-12)
    assert moves_apart(path) < 1e-9
