"""A motion as glTF, which browsers, Blender and other programs play: the mechanism's solids as they
are shown in the viewer, moved by their bodies.

What is fixed in a body hangs on the body's node, whose place and turn are keys over time; springs
and rods between two bodies hang on nodes that are stretched, too. Between keys programs interpolate
(places linearly, turns on the shortest way), so that loops stay closed at the keys alone.

Source: Khronos, glTF 2.0 specification (y is up there; colours are linear).
"""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from linkwork.checks import file_path, writing
from linkwork.errors import LinkworkError
from linkwork.mechanism import GROUND
from linkwork.robot import Motion, Robot, State
from linkwork.scene.colours import BLUE, Colour, rgb
from linkwork.scene.fixtures import OPACITY, Fixture, Fixtures, Stretch, fixtures_of
from linkwork.scene.layout import quaternions, quaternions_along
from linkwork.scene.meshes import Mesh
from linkwork.scene.rails import along, rails_of
from linkwork.scene.scene import upwards
from linkwork.scene.seen_runs import shown_robot
from linkwork.scene.skeleton import poses_of
from linkwork.simulation import Run
from linkwork.views.glb import Glb
from linkwork.views.motion import nearest_samples, timed_states, tool_places

FPS = 30.0
MOST = 20_000  # keys
ROUGH = 0.75  # of all surfaces
OPPOSITE = 1e-9  # one more than the cosine of half a turn

Keys = tuple[np.ndarray, np.ndarray, np.ndarray | None]


def write_gltf(
    robot: Robot, motion: Run | Motion | State, path: str | Path, *, fps: float = FPS
) -> Path:
    """Write a robot with its motion as a binary glTF file; a file that exists is replaced.

    Args:
        robot: whose motion it is; of a run with the numbers that it had.
        motion: a run, a motion along a path, or one state, which stands still.
        path: of the file, ending in .glb.
        fps: keys per second, where there are as many samples; each key is one of the samples.

    Returns:
        The path.

    Raises:
        LinkworkError: a motion of another robot or of no sample, another suffix, more than 20,000
            keys, a file that cannot be written.
    """
    path = file_path(path, "the path of a scene")
    if path.suffix.lower() != ".glb":
        raise LinkworkError(f"a scene is written as .glb, not as {path.name!r}")
    if isinstance(fps, bool) or not isinstance(fps, int | float) or not 0 < fps < np.inf:
        raise LinkworkError(f"fps is {fps!r}; give a number above 0")
    robot = shown_robot(robot, motion)
    content = scene_file(robot, *keys_of(robot, motion, fps))
    with writing(path):
        path.write_bytes(content)
    return path


def keys_of(robot: Robot, motion: Run | Motion | State, fps: float) -> tuple[np.ndarray, State]:
    """Return the times (K,) [s] of keys, from zero on, and the states (K,) at these: samples that
    are the nearest to equally spaced times."""
    if isinstance(motion, State) and not motion.batch:
        return np.zeros(1), robot.make_state(robot.own(motion).q[None], motion.rates[None])
    if isinstance(motion, State):
        raise LinkworkError(
            f"a stack of states of shape {motion.batch} has no times; give a run, a motion or one "
            "state"
        )
    time, states = timed_states(robot, motion)
    count = int(np.ptp(time) * fps) + 2
    if min(count, len(time)) > MOST:
        raise LinkworkError(
            f"the scene would have {min(count, len(time))} keys, more than {MOST}; give a lower "
            f"fps than {fps:g}"
        )
    if count < len(time):
        chosen = np.unique(nearest_samples(time, np.linspace(time[0], time[-1], count)))
        return time[chosen] - time[0], states.at(chosen)
    return time - time[0], states


def scene_file(robot: Robot, time: np.ndarray, states: State) -> bytes:
    """Return the bytes of a file with a robot in states (K,) at times (K,) [s]."""
    file, shown = Glb(f"Linkwork {version('linkwork')}"), fixtures_of(robot)
    poses = poses_of(robot, states)
    # What stands still: the ground, with rails as long as the motion needs, and the tool's path.
    rails = along(rails_of(robot, [part.role for part in shown.parts]), robot, states)
    laid = {rail.part: rail for rail in rails}
    moved = {
        k: {"translation": rail.start, "scale": [*shown.parts[k].scale[:2], rail.length]}
        for k, rail in laid.items()
    }
    still = [*on_carrier(file, shown, GROUND, moved), *tool_path(file, robot, states)]
    nodes = [file.node(name=GROUND, children=still)]
    # What moves: bodies, and spans between points of two of them.
    carried: list[tuple[str | int, str, Keys]] = [
        (name, name, (poses[name][0], quaternions(poses[name][1]), None)) for name in robot.bodies
    ]
    carried += [
        (k, " - ".join(span.bodies), stretched(span, poses)) for k, span in enumerate(shown.spans)
    ]
    for carrier, name, keys in carried:
        children = on_carrier(file, shown, carrier, {})
        node = file.node(name=name, children=children, **first(keys))
        nodes.append(node)
        if len(time) > 1:
            file.animate(node, time, **animated(keys))
    root = file.node(name=robot.mechanism.name, children=nodes, rotation=upright(robot))
    return file.bytes(root)


def on_carrier(
    file: Glb, shown: Fixtures, carrier: str | int, moved: dict[int, dict[str, Any]]
) -> list[int]:
    """Add nodes for the parts that are fixed in a carrier.

    moved: where some of them are instead
    """
    found = []
    for k, part in enumerate(shown.parts):
        if part.carrier != carrier or not len(part.mesh.faces):
            continue
        place = {
            "translation": part.position,
            "rotation": xyzw(quaternions(part.turn[None]))[0],
            "scale": part.scale,
        }
        found.append(file.node(mesh=mesh_of(file, part), **place | moved.get(k, {})))
    return found


def mesh_of(file: Glb, part: Fixture) -> int:
    """Add the mesh of a part in its colour, once."""
    look = file.material(linear(part.colour), OPACITY.get(part.role, 1.0), ROUGH)
    return file.mesh(id(part.mesh), look, lambda: shaded(part.mesh))


def shaded(mesh: Mesh) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return vertices (V, 3), unit normals (V, 3) and triangles (F, 3): facets of round surfaces
    share the normals of their corners, flat polygons have their own."""
    points, normals, faces, count = [], [], [], 0
    if len(mesh.facets):
        round_faces = Mesh(mesh.vertices, facets=mesh.facets).faces
        towards = np.zeros_like(mesh.vertices)
        a, b, c = (mesh.vertices[round_faces[:, k]] for k in range(3))
        for k in range(3):
            np.add.at(towards, round_faces[:, k], np.cross(b - a, c - a))
        points, normals, faces = [mesh.vertices], [towards], [round_faces]
        count = len(mesh.vertices)
    for polygon in mesh.flat:
        corners = mesh.vertices[np.asarray(polygon)]
        towards = np.cross(corners[1] - corners[0], corners[2] - corners[0])
        k = np.arange(1, len(corners) - 1)
        points.append(corners)
        normals.append(np.tile(towards, (len(corners), 1)))
        faces.append(count + np.stack([0 * k, k, k + 1], axis=1))
        count += len(corners)
    found = np.concatenate(normals)
    length = np.linalg.norm(found, axis=1, keepdims=True)
    up = np.array([0.0, 0.0, 1.0])  # of corners of no triangle, or of flat ones
    found = np.where(length > 0, found / np.where(length > 0, length, 1.0), up)
    return np.concatenate(points), found, np.concatenate(faces)


def stretched(span: Stretch, poses: dict[str, tuple[np.ndarray, np.ndarray]]) -> Keys:
    """Return where a span begins, how it is turned, and its scales, in all poses (K)."""
    start, end = (
        poses[body][0] + poses[body][1] @ point
        for body, point in zip(span.bodies, span.points, strict=True)
    )
    lengths = np.linalg.norm(end - start, axis=1)
    scales = np.column_stack([np.ones_like(lengths), np.ones_like(lengths), lengths])
    return start, quaternions_along(end - start, lengths), scales


def first(keys: Keys) -> dict[str, Any]:
    """Return where a node is at the first key."""
    place, turn, scale = keys
    found = {"translation": place[0], "rotation": xyzw(turn)[0]}
    return found if scale is None else found | {"scale": scale[0]}


def animated(keys: Keys) -> dict[str, np.ndarray]:
    """Return what changes of a node: of two quaternions of a turn the one that is nearer to the
    last."""
    place, turn, scale = keys
    flips = np.cumprod(np.where((turn[1:] * turn[:-1]).sum(axis=1) < 0, -1.0, 1.0))
    turn = np.concatenate([turn[:1], turn[1:] * flips[:, None]])
    found = {"translation": place, "rotation": xyzw(turn)}
    return found if scale is None else found | {"scale": scale}


def tool_path(file: Glb, robot: Robot, states: State) -> list[int]:
    """Add the path of the tool as a line, where it moves."""
    if not robot.mechanism.tools or len(states.q) < 2:
        return []
    points = tool_places(robot, states)
    return [file.node(name="path of the tool", mesh=file.line(points, linear(BLUE)))]


def upright(robot: Robot) -> np.ndarray:
    """Return the shortest turn (x, y, z, w) that brings what is up to y."""
    up, y = upwards(robot), np.eye(3)[1]
    if up @ y < -1 + OPPOSITE:
        return np.array([1.0, 0.0, 0.0, 0.0])
    turn = np.append(np.cross(up, y), 1 + up @ y)
    return turn / np.linalg.norm(turn)


def xyzw(turns: np.ndarray) -> np.ndarray:
    """Return quaternions (K, 4) in glTF's order: the real part last."""
    return turns[:, [1, 2, 3, 0]]


def linear(colour: Colour) -> list[float]:
    """Return red, green and blue in proportion to light, from 0 to 1 (IEC 61966-2-1)."""
    parts = np.array(rgb(colour)) / 255
    return np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4).tolist()
