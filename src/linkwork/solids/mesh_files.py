"""Files of meshes: STL, OBJ, PLY, OFF and glTF by trimesh, COLLADA, and MSH, the binary format of
MuJoCo.

MSH: four whole numbers (vertices, normals, texture coordinates, triangles), then the vertices as
three floats each, normals, texture coordinates, and the corners of the triangles as whole numbers.

Source: MuJoCo's documentation, https://mujoco.readthedocs.io (asset/mesh, MSH).
"""

from __future__ import annotations

import re
from functools import lru_cache
from io import BytesIO
from pathlib import Path

import numpy as np

from linkwork.errors import LinkworkError
from linkwork.solids.collada import read_collada
from linkwork.solids.polygons import in_triangles
from linkwork.solids.triangles import Triangles, hull_of

SUFFIXES = (".stl", ".obj", ".msh", ".ply", ".off", ".glb", ".gltf", ".dae")
LARGEST = 200_000_000  # bytes
KEPT = 64  # meshes in memory
POLYGON = re.compile(rb"^[ \t]*f([ \t]+\S+){4}", re.MULTILINE)  # of an OBJ file
GROUPS = (b"g", b"o")  # keywords with which a group of an OBJ file begins


def read_mesh(path: Path, first_group: bool = False) -> Triangles:
    """Read the triangles of a file, in its own units and axes, those of COLLADA in metres; one that
    has points only is their convex hull.

    Args:
        first_group: of an OBJ file with several groups or objects only the first, as MuJoCo does,
            and polygons in the triangles that it cuts them into.

    Raises:
        LinkworkError: half a sentence about the file, such as "is not there".
    """
    try:
        status = path.stat()
        if not path.is_file():
            raise LinkworkError("is no file")
        return _kept(path, first_group, status.st_mtime_ns, status.st_size)
    except LinkworkError:
        raise
    except FileNotFoundError:
        raise LinkworkError("is not there") from None
    except (OSError, ValueError) as error:
        reason = (getattr(error, "strerror", None) or str(error)).lower()
        raise LinkworkError(f"cannot be read: {reason}") from None


@lru_cache(maxsize=KEPT)
def _kept(path: Path, first_group: bool, changed: int, size: int) -> Triangles:
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise LinkworkError(f"is no mesh known here; give one of {', '.join(SUFFIXES)}")
    if size > LARGEST:
        raise LinkworkError(f"is larger than {LARGEST // 1_000_000} MB")
    content = path.read_bytes()
    if suffix == ".obj" and first_group:
        content = of_first_group(content)
        content = in_triangles(content) if POLYGON.search(content) else content
    if suffix == ".dae":
        vertices, faces = read_collada(content)
    else:
        vertices, faces = _msh(content) if suffix == ".msh" else _by_trimesh(content, path)
    if not len(vertices) or not np.isfinite(vertices).all():
        raise LinkworkError("holds no mesh of finite points")
    if len(faces) and not (faces.min() >= 0 and faces.max() < len(vertices)):
        raise LinkworkError("has triangles on points that it does not hold")
    for array in (vertices, faces):
        array.flags.writeable = False
    return Triangles(vertices, faces) if len(faces) else hull_of(vertices)


def of_first_group(content: bytes) -> bytes:
    """Return the text of an OBJ file without the faces after those of its first group."""
    lines, begun, over = [], False, False
    for line in content.splitlines():
        word = line.split(maxsplit=1)[0] if line.strip() else b""
        over |= begun and word in GROUPS
        begun |= word == b"f"
        if not (over and word == b"f"):
            lines.append(line)
    return b"\n".join(lines)


def has_groups(path: Path) -> bool:
    """Tell whether an OBJ file has faces in several groups."""
    content = path.read_bytes()
    return path.suffix.lower() == ".obj" and of_first_group(content).count(b"\nf ") < (
        content.count(b"\nf ")
    )


def _msh(content: bytes) -> tuple[np.ndarray, np.ndarray]:
    if len(content) < 16:
        raise LinkworkError("is too short for an MSH file")
    points, normals, textures, triangles = map(int, np.frombuffer(content, "<i4", 4))
    counts = 3 * points, 3 * normals, 2 * textures, 3 * triangles
    if min(counts) < 0 or len(content) != 4 * (4 + sum(counts)):
        raise LinkworkError("is not as long as an MSH file with its numbers of points is")
    vertices = np.frombuffer(content, "<f4", counts[0], 16).reshape(-1, 3).astype(float)
    faces = np.frombuffer(content, "<i4", counts[3], 4 * (4 + sum(counts[:3])))
    return vertices, faces.reshape(-1, 3).astype(np.int64)


def _by_trimesh(content: bytes, path: Path) -> tuple[np.ndarray, np.ndarray]:
    import trimesh
    from trimesh.resolvers import FilePathResolver

    kind = path.suffix.lower()[1:]
    if kind == "obj" and b"\nf " not in content.replace(b"\r", b"\n"):
        points = [line.split()[1:4] for line in content.splitlines() if line[:2] == b"v "]
        return np.array(points, dtype=float).reshape(-1, 3), np.zeros((0, 3), dtype=np.int64)
    resolver = FilePathResolver(str(path)) if kind == "gltf" else None
    try:
        found = trimesh.load_scene(
            BytesIO(content), file_type=kind, resolver=resolver, process=False,
            maintain_order=True, skip_materials=True,
        )  # fmt: skip
        mesh = found.to_mesh()
    except Exception as error:  # whatever a broken file does to a parser
        reason = " ".join(str(error).split())[:100] or type(error).__name__
        raise LinkworkError(f"is not a mesh that can be read: {reason}") from None
    return np.array(mesh.vertices, dtype=float), np.array(mesh.faces, dtype=np.int64)
