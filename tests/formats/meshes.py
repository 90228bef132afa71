"""Files of meshes for tests."""

from __future__ import annotations

from pathlib import Path

import numpy as np


def lump(seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices and triangles of a closed body that is neither convex nor symmetric, about as
    large as a hand."""
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=1)
    heights = np.random.default_rng(seed).uniform(0.6, 1.4, (len(ball.vertices), 1))
    points = ball.vertices * heights * [0.05, 0.1, 0.08] + [0.03, 0.01, 0.02]
    return points.astype(np.float32).astype(float), np.array(ball.faces)


def write_stl(path: Path, vertices: np.ndarray, faces: np.ndarray) -> Path:
    triangles = np.zeros(len(faces), dtype=[("numbers", "<f4", (4, 3)), ("word", "<u2")])
    triangles["numbers"][:, 1:] = vertices[faces]
    path.write_bytes(bytes(80) + np.uint32(len(faces)).tobytes() + triangles.tobytes())
    return path


def write_obj(path: Path, vertices: np.ndarray, faces: np.ndarray) -> Path:
    points = "".join(f"v {x!r} {y!r} {z!r}\n" for x, y, z in vertices.tolist())
    path.write_text(points + "".join(f"f {a} {b} {c}\n" for a, b, c in (faces + 1).tolist()))
    return path


def write_msh(path: Path, vertices: np.ndarray, faces: np.ndarray) -> Path:
    counts = np.array([len(vertices), 0, 0, len(faces)], "<i4")
    parts = counts, vertices.astype("<f4"), faces.astype("<i4")
    path.write_bytes(b"".join(part.tobytes() for part in parts))
    return path
