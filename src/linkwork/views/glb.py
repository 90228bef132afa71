"""The container of a binary glTF file: numbers in one block, and a JSON text that says what they
are.

    header: "glTF", version 2, length; a chunk of JSON; a chunk of numbers, all multiples of 4 bytes

Source: Khronos, glTF 2.0 specification, sec. 3 and 4.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Hashable, Sequence
from typing import Any

import numpy as np

MAGIC, VERSION = 0x46546C67, 2
JSON_CHUNK, NUMBERS_CHUNK = 0x4E4F534A, 0x004E4942
FLOAT, WHOLE = 5126, 5125  # types of numbers
LINE_STRIP = 3
VERTICES, CORNERS = 34962, 34963  # what blocks of numbers are for
SHAPES = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}

Triangles = tuple[np.ndarray, np.ndarray, np.ndarray]


class Glb:
    """Collect the nodes, meshes, materials and animation of one scene."""

    def __init__(self, generator: str):
        self.content: dict[str, Any] = {"asset": {"version": "2.0", "generator": generator}}
        self.block = bytearray()
        self.known: dict[Hashable, int] = {}
        self.shapes: dict[Hashable, dict[str, Any]] = {}

    def add(self, kind: str, entry: dict[str, Any]) -> int:
        """Add an entry to a list of the file, and return its number."""
        entries = self.content.setdefault(kind, [])
        entries.append(entry)
        return len(entries) - 1

    def once(self, key: Hashable, make: Callable[[], int]) -> int:
        """Return the number of what was added by this key, or add it."""
        if key not in self.known:
            self.known[key] = make()
        return self.known[key]

    def numbers(self, values: np.ndarray, target: int | None = None) -> int:
        """Add floats (K,) or (K, 3 or 4), or whole numbers (K,), and return their accessor."""
        whole = values.dtype.kind in "iu"
        stored = np.ascontiguousarray(values, "<u4" if whole else "<f4")
        view = {"buffer": 0, "byteOffset": len(self.block), "byteLength": stored.nbytes}
        self.block += stored.tobytes()
        accessor = {
            "bufferView": self.add("bufferViews", view | ({"target": target} if target else {})),
            "componentType": WHOLE if whole else FLOAT,
            "count": len(stored),
            "type": SHAPES[1 if stored.ndim == 1 else stored.shape[1]],
            "min": np.atleast_1d(stored.min(axis=0)).tolist(),
            "max": np.atleast_1d(stored.max(axis=0)).tolist(),
        }
        return self.add("accessors", accessor)

    def node(self, **fields: Any) -> int:
        """Add a node: name, children, mesh, translation (3), rotation (x, y, z, w), scale (3)."""
        plain = {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in fields.items()}
        return self.add("nodes", {k: v for k, v in plain.items() if k != "children" or v})

    def material(self, colour: Sequence[float], opacity: float, roughness: float) -> int:
        """Add a material of a linear colour (3), once."""
        surface = {
            "baseColorFactor": [*colour, opacity],
            "metallicFactor": 0.0,
            "roughnessFactor": roughness,
        }
        entry = {"pbrMetallicRoughness": surface, "doubleSided": True}
        blended = {"alphaMode": "BLEND"} if opacity < 1 else {}
        key = ("material", *colour, opacity, roughness)
        return self.once(key, lambda: self.add("materials", entry | blended))

    def mesh(self, shape: Hashable, material: int, make: Callable[[], Triangles]) -> int:
        """Add a mesh in a material, once; `make` gives a shape's vertices (V, 3), normals (V, 3)
        and triangles (F, 3), which meshes in other materials share."""
        if shape not in self.shapes:
            points, normals, faces = make()
            attributes = {
                "POSITION": self.numbers(points, VERTICES),
                "NORMAL": self.numbers(normals, VERTICES),
            }
            indices = self.numbers(faces.ravel(), CORNERS)
            self.shapes[shape] = {"attributes": attributes, "indices": indices}
        drawn = self.shapes[shape] | {"material": material}
        return self.once((shape, material), lambda: self.add("meshes", {"primitives": [drawn]}))

    def line(self, points: np.ndarray, colour: Sequence[float]) -> int:
        """Add a mesh that is a line through points (K, 3), in a linear colour (3)."""
        drawn = {
            "attributes": {"POSITION": self.numbers(points, VERTICES)},
            "mode": LINE_STRIP,
            "material": self.material(colour, 1.0, 1.0),
        }
        return self.add("meshes", {"primitives": [drawn]})

    def animate(self, node: int, time: np.ndarray, **keys: np.ndarray) -> None:
        """Lead a node through keys at times (K,) [s]: its translation (K, 3), rotation (K, 4) or
        scale (K, 3), linearly between them."""
        given = self.once(("time", time.tobytes()), lambda: self.numbers(time))
        if not self.content.get("animations"):
            self.add("animations", {"name": "motion", "samplers": [], "channels": []})
        motion = self.content["animations"][0]
        for path, values in keys.items():
            sampler = {"input": given, "output": self.numbers(values), "interpolation": "LINEAR"}
            motion["samplers"].append(sampler)
            target = {"node": node, "path": path}
            motion["channels"].append({"sampler": len(motion["samplers"]) - 1, "target": target})

    def bytes(self, root: int) -> bytes:
        """Return the file, whose scene is a node with all below it."""
        scene = {"scene": 0, "scenes": [{"nodes": [root]}]}
        block = bytes(self.block) + bytes(-len(self.block) % 4)
        whole = self.content | scene | {"buffers": [{"byteLength": len(block)}]}
        text = json.dumps(whole, separators=(",", ":"), allow_nan=False).encode()
        text += b" " * (-len(text) % 4)
        chunks = [(JSON_CHUNK, text), (NUMBERS_CHUNK, block)]
        body = b"".join(struct.pack("<II", len(part), kind) + part for kind, part in chunks)
        return struct.pack("<III", MAGIC, VERSION, 12 + len(body)) + body
