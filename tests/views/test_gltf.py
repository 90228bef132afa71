"""Motions as glTF: read back by trimesh, and by the specification, at every key."""

from __future__ import annotations

import json
import struct

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

import linkwork as lw
from linkwork.errors import LinkworkError
from linkwork.scene.fixtures import fixtures_of
from linkwork.scene.layout import PartLayout, turned_by
from linkwork.views import write_gltf
from linkwork.views.gltf import shaded

from tests.catalogue import built


class Reader:
    """Read a binary glTF file as the specification says."""

    def __init__(self, path):
        content = path.read_bytes()
        magic, version, length = struct.unpack_from("<4sII", content)
        assert (magic, version, length) == (b"glTF", 2, len(content))
        size, kind = struct.unpack_from("<I4s", content, 12)
        assert kind == b"JSON" and size % 4 == 0
        self.told = json.loads(content[20 : 20 + size])
        assert struct.unpack_from("<I4s", content, 20 + size)[1] == b"BIN\0"
        self.block = content[28 + size :]
        assert self.told["buffers"] == [{"byteLength": len(self.block)}]
        self.names = {node["name"]: k for k, node in enumerate(self.nodes) if "name" in node}

    @property
    def nodes(self) -> list[dict]:
        return self.told["nodes"]

    def numbers(self, accessor: int) -> np.ndarray:
        told = self.told["accessors"][accessor]
        width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[told["type"]]
        kind = {5126: "<f4", 5125: "<u4"}[told["componentType"]]
        start = self.told["bufferViews"][told["bufferView"]]["byteOffset"]
        found = np.frombuffer(self.block, kind, told["count"] * width, start).reshape(-1, width)
        assert (found.min(axis=0) == told["min"]).all() and (found.max(axis=0) == told["max"]).all()
        return found

    def keys(self, node: int) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """Return the times of a node's keys, and its fields at these."""
        (motion,) = self.told["animations"]
        found, time = {}, np.zeros(0)
        for channel in motion["channels"]:
            if channel["target"]["node"] == node:
                sampler = motion["samplers"][channel["sampler"]]
                assert sampler["interpolation"] == "LINEAR"
                time = self.numbers(sampler["input"])[:, 0]
                found[channel["target"]["path"]] = self.numbers(sampler["output"])
        return time, found

    def upright(self) -> Rotation:
        (root,) = self.told["scenes"][0]["nodes"]
        return Rotation.from_quat(self.nodes[root]["rotation"])


@pytest.mark.parametrize("name", ["prr3", "stewart", "delta"])
def test_nodes_of_bodies_are_where_the_bodies_are_at_every_key(name, tmp_path):
    robot = built(name)
    run = robot.simulate(robot.home, duration=0.4, save_at=np.linspace(0, 0.4, 9))
    found = Reader(write_gltf(robot, run, tmp_path / "run.glb"))
    states = robot.state(run.variables["joint_position"].values)
    for body, (place, turn) in robot.body_poses(states).items():
        time, keys = found.keys(found.names[body])
        assert time == pytest.approx(run.time)
        np.testing.assert_allclose(keys["translation"], place, atol=1e-6)
        np.testing.assert_allclose(
            Rotation.from_quat(keys["rotation"]).as_matrix(), turn, atol=1e-6
        )
        assert ((keys["rotation"][1:] * keys["rotation"][:-1]).sum(axis=1) > 0).all()
        node = found.nodes[found.names[body]]
        assert node["translation"] == pytest.approx(place[0], abs=1e-6)


def test_legs_are_stretched_from_joint_to_joint(tmp_path):
    robot = built("stewart")
    run = robot.simulate(robot.home, duration=0.4, save_at=np.linspace(0, 0.4, 9))
    found = Reader(write_gltf(robot, run, tmp_path / "run.glb"))
    for k in range(1, 7):
        _, keys = found.keys(found.names[f"tube_{k} - rod_{k}"])
        length = run["joint_position"].sel(coordinate=f"leg_{k}").values
        np.testing.assert_allclose(keys["scale"][:, 2], length, rtol=1e-6)
        np.testing.assert_array_equal(keys["scale"][:, :2], 1)


def test_trimesh_sees_the_robot_upright_with_its_colours(tmp_path):
    robot = built("stewart")
    scene = trimesh.load_scene(write_gltf(robot, robot.home, tmp_path / "still.glb"))
    parts = fixtures_of(robot)
    placed = PartLayout(robot, parts).place(robot.home)
    points = np.concatenate(
        [
            position + turned_by(turn[None], part.mesh.vertices * scale)
            for part, position, turn, scale in zip(
                parts.parts, placed.positions, placed.turns, placed.scales, strict=True
            )
        ]
    )
    upright = points[:, [0, 2, 1]] * (1, 1, -1)
    ends = np.array([upright.min(axis=0), upright.max(axis=0)])
    np.testing.assert_allclose(scene.bounds, ends, atol=1e-5)
    colours = {tuple(mesh.visual.material.baseColorFactor[:3]) for mesh in scene.geometry.values()}
    assert len(colours) > 3
    assert "animations" not in Reader(tmp_path / "still.glb").told


@pytest.mark.parametrize(
    ("gravity", "up"), [((0, 0, -9.81), 2), ((0, -9.81, 0), 1), ((9.81, 0, 0), 0)]
)
def test_what_is_up_is_up_in_the_file(gravity, up, tmp_path):
    joints = {"hinge": lw.SphericalJoint(connects=("ground", "arm"))}
    body = lw.Body(mass=1.0, inertia=lw.Inertia(xx=1.0, yy=1.0, zz=1.0))
    robot = lw.Robot(lw.Mechanism(bodies={"arm": body}, joints=joints, gravity=gravity))
    found = Reader(write_gltf(robot, robot.home, tmp_path / "still.glb"))
    sense = -np.sign(gravity[up])
    assert found.upright().apply(sense * np.eye(3)[up]) == pytest.approx([0, 1, 0], abs=1e-12)


def test_normals_are_units_and_look_outwards():
    for part in fixtures_of(built("prr3")).parts:
        points, normals, faces = shaded(part.mesh)
        a, b, c = (points[faces[:, k]] for k in range(3))
        assert np.linalg.norm(normals, axis=1) == pytest.approx(1)
        across = np.cross(b - a, c - a)
        for k in range(3):
            assert ((across * normals[faces[:, k]]).sum(axis=1) > 0).all()
        volume = (a * np.cross(b, c)).sum() / 6
        assert volume == pytest.approx(part.mesh.volume)


def test_keys_are_samples_no_more_than_asked(tmp_path):
    robot = built("prr3")
    run = robot.simulate(robot.home, duration=1.0, save_at=np.linspace(0, 1, 301))
    found = Reader(write_gltf(robot, run, tmp_path / "run.glb", fps=10))
    time, _ = found.keys(found.names["platform"])
    assert len(time) <= 12 and time[0] == 0 and time[-1] == 1
    assert np.abs(time[:, None] - run.time).min(axis=1).max() < 1e-7


def test_refusals(tmp_path):
    robot = built("prr3")
    run, stack = (
        robot.simulate(robot.home, duration=0.1),
        robot.state(np.tile(robot.home.positions, (3, 1))),
    )
    path = tmp_path / "x.glb"
    with pytest.raises(LinkworkError, match=r"a scene is written as \.glb, not as 'x\.obj'"):
        write_gltf(robot, run, tmp_path / "x.obj")
    with pytest.raises(LinkworkError, match="has no times; give a run, a motion or one state"):
        write_gltf(robot, stack, path)
    with pytest.raises(LinkworkError, match="fps is 0; give a number above 0"):
        write_gltf(robot, run, path, fps=0)
    with pytest.raises(LinkworkError, match="cannot be written: no such file"):
        write_gltf(robot, run, tmp_path / "no" / "x.glb")
    with pytest.raises(LinkworkError, match="not one of the robot"):
        write_gltf(built("five_bar"), run, path)
    assert not path.exists()
