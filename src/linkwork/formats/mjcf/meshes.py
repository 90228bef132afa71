"""Meshes of an MJCF model: where they lie, how they are moved before use, and what they weigh.

A vertex p of the file stands at  S R' (p - p_ref)  in the geom's frame, R the rotation of refquat
and S the scale. MuJoCo holds files in single precision, and so do the numbers here.

Source: the MJCF reference of MuJoCo 4, https://mujoco.readthedocs.io (asset/mesh; geom, mesh and
fitscale; compiler).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np

from linkwork.errors import LinkworkError
from linkwork.formats import poses
from linkwork.formats.mjcf.attachments import mesh_name
from linkwork.formats.mjcf.document import OWN, Document
from linkwork.formats.mjcf.principal import principal_axes
from linkwork.formats.notes import Notes
from linkwork.formats.xml import Element, shortened
from linkwork.mechanism import MechanismError, Polygon
from linkwork.solids.mesh_files import has_groups, read_mesh
from linkwork.solids.solid import Solid
from linkwork.solids.triangles import MODES, Mode, Triangles, hull_of, weighed

MADE = "it is made by MuJoCo itself (builtin, or a plugin)"


class AbsentMeshError(LinkworkError):
    """Say, in half a sentence, that a mesh's file, whose name is quoted, is not in a folder."""

    def __init__(self, file: str, folder: Path):
        super().__init__(f"its file {file} is not in {str(folder)!r}")
        self.file = file


@dataclass(frozen=True)
class MeshAsset:
    """Hold one <mesh>, with its defaults, in a document."""

    element: Element
    document: Document

    @cached_property
    def path(self) -> Path | None:
        """Return the path of its file: meshdir and strippath of its model's compiler apply, and the
        folder of that model.

        Raises:
            LinkworkError: half a sentence on what is not there.
        """
        if "file" not in self.element.attributes:
            return None
        name = self.element.text("file")
        compiler = self.document.compiler_of(self.element)
        if compiler.strip_path:
            name = name.replace("\\", "/").rpartition("/")[2]
        path = self.document.root.file.parent / compiler.mesh_folder / name
        try:
            there = path.is_file()
        except (OSError, ValueError):
            raise LinkworkError(f"its file {shortened(name)} is no path") from None
        if not there:
            raise AbsentMeshError(shortened(name), path.parent)
        return path

    @property
    def mode(self) -> Mode:
        """Return how it is weighed."""
        return self.element.choice("inertia", MODES, "legacy")  # pyright: ignore

    @cached_property
    def scale(self) -> np.ndarray:
        return np.array(self.element.vector("scale", (1.0, 1.0, 1.0)))

    @cached_property
    def reference(self) -> np.ndarray:
        """Return the pose X_file_mesh that refpos and refquat give."""
        quaternion = self.element.numbers("refquat", (4,), (1.0, 0.0, 0.0, 0.0))
        position = self.element.vector("refpos", (0.0, 0.0, 0.0))
        return poses.pose(position, poses.from_quaternion(*quaternion))

    @cached_property
    def triangles(self) -> Triangles:
        """Return the mesh in the geom's axes.

        Raises:
            LinkworkError: half a sentence on what is wrong with it.
        """
        mesh = self._read()
        R = self.reference[:3, :3]
        moved = mesh.moved(lambda points: (points - self.reference[:3, 3]) @ R)
        return moved.scaled(self.scale)

    @cached_property
    def solid(self) -> Solid:
        """Return mass, centre and inertia for a density of one, in the geom's axes."""
        mesh, mode = self.triangles, self.mode
        most = self.element.number("maxhullvert", -1.0)
        if mode == "convex" and most > 3:
            mesh, mode = hull_of(mesh.vertices, f"Qt Q9 TA{int(most) - 4}"), "exact"
        return weighed(mesh, mode)

    @property
    def plate(self) -> Polygon | None:
        """Return the plate on a convex polygon whose corners are all vertices, those of both faces
        one after the other; None for other meshes."""
        elsewhere = {"scale", "refpos", "refquat", "face", "file"} & {*self.element.attributes}
        if elsewhere or "vertex" not in self.element.attributes:
            return None
        points = _numbers(self.element, "vertex", float)
        low, high = points[::2], points[1::2]
        z = abs(points[0, 2]) if len(points) else 0.0
        if len(low) != len(high) or (low != high * (1, 1, -1)).any() or (high[:, 2] != z).any():
            return None
        try:
            return Polygon(points=tuple(map(tuple, low[:, :2].tolist())), thickness=float(2 * z))
        except MechanismError:
            return None

    def cautions(self) -> list[str]:
        """Return what to know of a mesh that is weighed as MuJoCo weighs it."""
        found = []
        if self.mode != "convex" and (count := self.triangles.open_edges):
            found.append(
                f"is weighed though its mesh is not closed: at {count} edges its triangles do not "
                "meet in pairs; its mass is what MuJoCo makes of it"
            )
        if self.path is not None and has_groups(self.path):
            found.append("has several groups in its OBJ file; MuJoCo takes the first alone")
        return found

    def _read(self) -> Triangles:
        """Return the mesh as the file has it."""
        element = self.element
        if self.path is not None:
            try:
                mesh = read_mesh(self.path, first_group=True)
            except LinkworkError as error:
                raise LinkworkError(f"its file {shortened(self.path.name)} {error}") from None
            return mesh.moved(lambda points: points.astype(np.float32).astype(float))
        if "vertex" not in element.attributes:
            raise LinkworkError(MADE)
        points = _numbers(element, "vertex", float).astype(np.float32).astype(float)
        if "face" not in element.attributes:
            return hull_of(points)
        faces = _numbers(element, "face", int)
        if faces.min(initial=0) < 0 or faces.max(initial=0) >= len(points):
            raise element.refusal("face names vertices that are not there")
        return Triangles(points, faces)


def _numbers(element: Element, name: str, kind: type) -> np.ndarray:
    try:
        return np.array([kind(word) for word in element.text(name).split()]).reshape(-1, 3)
    except ValueError:
        raise element.refusal(f"{name} is not three numbers for each") from None


@dataclass(frozen=True)
class Meshes:
    """Hold the meshes of a document by name."""

    assets: dict[str, MeshAsset] = field(default_factory=dict)

    @classmethod
    def of(cls, document: Document) -> Meshes:
        found: dict[str, MeshAsset] = {}
        for raw in document.each("asset", "mesh"):
            element = document.resolved(raw, "mesh")
            found[mesh_name(element)] = MeshAsset(element, document)
        return cls(found)

    def asset(self, geom: Element) -> MeshAsset:
        """Return the mesh that a geom names.

        Raises:
            LinkworkError: half a sentence.
        """
        name = geom.attributes.get("mesh", "")
        if name not in self.assets:
            raise LinkworkError(f"there is no mesh {shortened(name)}")
        return self.assets[name]

    def solid(self, geom: Element, notes: Notes) -> Solid | None:
        """Return the solid of a geom's mesh for a density of one, in the geom's axes; None with a
        note where there is none."""
        try:
            asset = self.asset(geom)
            solid = asset.solid
        except LinkworkError as error:
            remark = f"is a mesh, whose mass is left out: {error}"
            notes.on(geom, remark, alters=True, words=getattr(error, "file", ""))
            return None
        for caution in asset.cautions():
            notes.on(geom, caution)
        return solid

    def fitted(self, geom: Element, notes: Notes) -> tuple[np.ndarray, np.ndarray] | None:
        """Return the size of a geom of a simple kind that is fitted to its mesh, and its pose in
        the body's frame; None with a note where there is no mesh.

        It is fitted to the box that has the mesh's inertia, or to the box around the mesh along its
        principal axes (fitaabb).
        """
        solid = self.solid(geom, notes)
        if solid is None:
            return None
        asset, (moments, X_own) = self.asset(geom), principal(solid)
        X = asset.document.pose(geom) @ X_own
        # By the model that all is attached to, as MuJoCo does.
        if asset.document.compilers[OWN].fit_box:
            seen = (asset.triangles.vertices - solid.centre) @ X_own[:3, :3]
            low, high = seen.min(axis=0), seen.max(axis=0)
            half, X = (high - low) / 2, X @ poses.shift((low + high) / 2)
            size = _around(geom.attributes.get("type", "sphere"), half)
        else:
            half = np.sqrt(1.5 * (moments.sum() - 2 * moments) / solid.mass)
            size = _alike(geom.attributes.get("type", "sphere"), half)
        return geom.number("fitscale", 1.0) * size, X

    def axes(self, geom: Element) -> np.ndarray | None:
        """Return the principal axes of a geom's mesh in the body's frame, by columns; None where
        there is no mesh."""
        try:
            asset = self.asset(geom)
            X = principal(asset.solid)[1]
        except LinkworkError:
            return None
        return (asset.document.pose(geom) @ X)[:3, :3]

    def reach(self, geom: Element, notes: Notes) -> tuple[np.ndarray, np.ndarray] | None:
        """Return how far a geom's mesh reaches from its mass centre along its principal axes, and
        the pose of these in the body's frame; None with a note where there is no mesh."""
        solid = self.solid(geom, notes)
        if solid is None:
            return None
        asset, (_, X) = self.asset(geom), principal(solid)
        seen = (asset.triangles.vertices - solid.centre) @ X[:3, :3]
        return np.abs(seen).max(axis=0), asset.document.pose(geom) @ X


def principal(solid: Solid) -> tuple[np.ndarray, np.ndarray]:
    """Return a solid's principal moments, the greatest first as MuJoCo has those of meshes, and
    the pose of the axes."""
    axes = principal_axes(solid.inertia)
    return np.diag(axes.T @ solid.inertia @ axes), poses.pose(solid.centre, axes)


def _around(kind: str, half: np.ndarray) -> np.ndarray:
    """Return the size of a shape whose box is not smaller than one of given half sides."""
    radius = half[:2].max()
    match kind:
        case "sphere":
            return np.array([half.max()])
        case "capsule":
            return np.array([radius, half[2] - radius])
        case "cylinder":
            return np.array([radius, half[2]])
    return half


def _alike(kind: str, half: np.ndarray) -> np.ndarray:
    """Return the size of a shape that is about as large as a box of given half sides."""
    radius = half[:2].mean()
    match kind:
        case "sphere":
            return np.array([half.mean()])
        case "capsule":
            return np.array([radius, max(0.0, half[2] - radius / 2)])
        case "cylinder":
            return np.array([radius, half[2]])
    return half
