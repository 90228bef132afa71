"""The scene in the browser: nodes for a robot's parts, moved by frames; arrows; the handle on the
tool."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import viser

from linkwork.mechanism import GROUND
from linkwork.scene.colours import GREEN, ORANGE, PINK, VERMILION, rgb
from linkwork.scene.colours import SKY as SKY_BLUE
from linkwork.scene.fixtures import OPACITY, Fixture
from linkwork.scene.layout import Placement, of_mesh, quaternions, turned_by
from linkwork.scene.rails import Rail
from linkwork.viewer.arrows import ArrowLines
from linkwork.viewer.cameras import FIELD_OF_VIEW, camera, distance, follow, look, outlook
from linkwork.viewer.conditioning import colour
from linkwork.viewer.marks import FRAMES, Marks, Pose, written
from linkwork.viewer.reach import Reach
from linkwork.viewer.session import Pulled, Session

ARROWS = {
    "actuator forces": rgb("#b35900"),
    "joint reactions": rgb("#a3437f"),
    "velocities": rgb(GREEN),
}
BODILY = ("member", "plate", "shell")  # roles of what takes the colour of the conditioning
REACHED, SINGULAR = 0.25, 0.5  # opacity of the surfaces of what the tool reaches
FAINT = 0.3  # opacity of the run that is laid over
# Radii and length of arrows, relative to the mechanism.
SHAFT, HEAD, HEAD_LENGTH = 0.006, 0.016, 0.04
ARC = 0.008  # thickness of arcs
HANDLE = 0.22  # of the tool's handle
GRID_CELLS = 20
# Light from all around: reflections and shadows cost too much.
SKY, EARTH, LIGHT = (255, 255, 255), (150, 150, 160), 1.0
TRAIL = 2.5  # width of the tools' trail [pixels]
SPRING = 4.0  # width of the line from a body to the hand that pulls [pixels]
AXIS, AXIS_RADIUS = 0.09, 0.0025  # of frames, relative to the mechanism


@dataclass(frozen=True, eq=False)
class Batch:
    """Hold the node of parts of one mesh: their numbers (k), colours (k, 3), which are coloured by
    conditioning (k).

    stretched: whether their scales change
    """

    node: viser.BatchedMeshHandle
    group: np.ndarray
    colours: np.ndarray
    coloured: np.ndarray
    stretched: bool


class BrowserStage:
    """Show one robot in the scene of a server.

    placed, rails: where parts that stand still are, among them the rails
    shown: where all parts are now, rails excepted
    lift: by which the trail and the frames of a planar mechanism are raised, to lie on its plates
        and not in them (3) [m]
    away: how far from its middle the whole mechanism is seen [m]
    """

    def __init__(self, server: viser.ViserServer, session: Session):
        self.server, self.robot, self.parts = server, session.robot, session.parts
        moving, placement = session.layout.moving, session.layout.place(session.state)
        self.moving, self.faint = moving, []
        self.reach: list[Any] = []
        self.batches = [
            self._add_batch(group, placement) for group in of_mesh(self.parts.parts, moving)
        ]
        self.still = [
            self._add_batch(group, placement) for group in of_mesh(self.parts.parts, ~moving)
        ]
        self.placed = self.shown = placement
        self.rails: tuple[Rail, ...] = ()
        self.lay(session.rails)
        self.handle = (
            self._add_handle(session.pursuit.turns) if self.robot.mechanism.tools else None
        )
        self.grip, self.spring = self._add_grip(), self._add_spring()
        self.arrows: dict[str, tuple[Any, Any]] = {}
        self.marks: dict[str, list[Any]] = {}
        points = points_of(self.parts.parts, placement)
        self.lift = np.array([0.0, 0.0, points[:, 2].max()]) * self.robot.planar
        self.away = distance(np.linalg.norm(points - self.parts.centre, axis=1).max())
        self.trail = self._add_trail()
        self.shade: tuple[int, int, int] | None = None
        self._furnish(points)

    # Nodes

    def _add_batch(self, group: np.ndarray, placement: Placement, *, faint: bool = False) -> Batch:
        """Add parts of one mesh, by their numbers, as one node; faint ones belong to the run that
        is laid over."""
        parts = [self.parts.parts[k] for k in group]
        tools = [tool.body for tool in self.robot.mechanism.tools.values()][:1] or list(
            self.robot.bodies
        )
        colours = np.array([rgb(part.colour) for part in parts], np.uint8)
        coloured = np.array([part.role in BODILY and part.carrier in tools for part in parts])
        name = "over" if faint else "ground" if parts[0].carrier == GROUND else "robot"
        node = self.server.scene.add_batched_meshes_simple(
            f"/{name}/{group[0]}",
            parts[0].mesh.vertices,
            parts[0].mesh.faces,
            placement.turns[group],
            placement.positions[group],
            batched_scales=placement.scales[group],
            batched_colors=np.full_like(colours, rgb(PINK)) if faint else colours,
            opacity=FAINT if faint else OPACITY.get(parts[0].role),
            flat_shading=not parts[0].mesh.smooth,
            side="front" if parts[0].mesh.convex else "double",
            lod="off",
        )
        stretched = any(isinstance(part.carrier, int) for part in parts)
        return Batch(node, group, colours, coloured, stretched)

    def _add_handle(self, rotating: bool) -> viser.TransformControlsHandle:
        return self.server.scene.add_transform_controls(
            "/tool",
            scale=HANDLE * self.parts.size,
            line_width=3.0,
            disable_rotations=not rotating,
            active_axes=(True, True, not self.robot.planar),
            depth_test=False,
        )

    def _furnish(self, points: np.ndarray) -> None:
        """Set the ground, the direction that is up, and where the camera starts."""
        size, centre = self.parts.size, self.parts.centre
        scene, start = self.server.scene, self.server.initial_camera
        up, towards = outlook(self.robot)
        scene.set_up_direction(tuple(up))
        scene.configure_environment_map(None)
        scene.configure_default_lights(cast_shadow=False)
        scene.add_light_hemisphere("/light", sky_color=SKY, ground_color=EARTH, intensity=LIGHT)
        scene.add_grid(
            "/grid",
            width=GRID_CELLS * size / 5,
            height=GRID_CELLS * size / 5,
            plane="xy",
            cell_size=size / 5,
            section_size=size,
            cell_color=(225, 229, 233),
            section_color=(200, 206, 212),
            position=(centre[0], centre[1], points[:, 2].min()),
        )
        start.fov = FIELD_OF_VIEW
        start.up, start.look_at = up, centre
        start.position = centre + self.away * towards
        start.near, start.far = size / 100, 100 * size

    # What changes

    def show(self, placement: Placement) -> None:
        """Move all parts to their places."""
        self.shown = placement
        self._move(self.batches, placement)

    def _move(self, batches: Sequence[Batch], placement: Placement) -> None:
        for batch in batches:
            batch.node.batched_positions = placement.positions[batch.group]
            batch.node.batched_wxyzs = placement.turns[batch.group]
            if batch.stretched:
                batch.node.batched_scales = placement.scales[batch.group]

    def show_faintly(self, placement: Placement | None) -> None:
        """Show the bodies of the run that is laid over, or none."""
        if placement is not None and not self.faint:
            axes = np.array([part.role == "tool" for part in self.parts.parts])
            chosen = self.moving & ~axes
            self.faint = [
                self._add_batch(group, placement, faint=True)
                for group in of_mesh(self.parts.parts, chosen)
            ]
        for batch in self.faint:
            batch.node.visible = placement is not None
        if placement is not None:
            self._move(self.faint, placement)

    def lay(self, rails: tuple[Rail, ...]) -> None:
        """Show rails as long as they are now."""
        if rails is self.rails:
            return
        self.rails = rails
        for rail in rails:
            self.placed.positions[rail.part] = rail.start
            self.placed.scales[rail.part, 2] = rail.length
        for batch in self.still:
            if not {rail.part for rail in rails}.isdisjoint(batch.group.tolist()):
                batch.node.batched_positions = self.placed.positions[batch.group]
                batch.node.batched_scales = self.placed.scales[batch.group]

    def hold(self, tool: tuple[np.ndarray, np.ndarray] | None) -> None:
        """Bring the handle to the tool, or hide it."""
        if self.handle is not None:
            self.handle.visible = tool is not None
            if tool is not None:
                self.handle.position, self.handle.wxyz = tool[0], quaternions(tool[1][None])[0]

    def pull(self, pulled: Pulled | None) -> None:
        """Show where a body may be pulled at, and the spring to the hand that does."""
        self.grip.visible, self.spring.visible = pulled is not None, False
        if pulled is None:
            return
        if pulled.hand is None:
            self.grip.position = pulled.place
            return
        self.spring.visible = True
        self.spring.points = np.stack([pulled.place, pulled.hand])[None].astype(np.float32)

    def show_reach(self, reach: Reach | None, base: Pose | None = None) -> None:
        """Show what the tool reaches, and where it is singular, relative to a frame; or nothing."""
        for node in self.reach:
            node.remove()
        self.reach = []
        if reach is None or base is None:
            return
        # Of the outer surface in space the far walls: the near ones would hide what is within.
        walls = "double" if self.robot.planar else "back"
        singular = reach.singular_corners, reach.singular_triangles
        self._add_surface("singular", *singular, rgb(VERMILION), SINGULAR, "double", base)
        whole = reach.corners, reach.triangles
        self._add_surface("reached", *whole, rgb(SKY_BLUE), REACHED, walls, base)
        if len(reach.singular_lines):
            added = self.server.scene.add_line_segments(
                "/reach/lines",
                reach.singular_lines.astype(np.float32),
                rgb(VERMILION),
                thickness=SPRING,
                thickness_units="screen",
                position=base[0],
                wxyz=quaternions(base[1][None])[0],
            )
            self.reach.append(added)

    def _add_surface(
        self,
        name: str,
        corners: np.ndarray,
        triangles: np.ndarray,
        colour: tuple[int, int, int],
        opacity: float,
        side: Literal["double", "back"],
        base: Pose,
    ) -> None:
        if len(triangles):
            node = self.server.scene.add_mesh_simple(
                f"/reach/{name}",
                corners.astype(np.float32),
                triangles.astype(np.uint32),
                color=colour,
                opacity=opacity,
                side=side,
                position=base[0],
                wxyz=quaternions(base[1][None])[0],
            )
            self.reach.append(node)

    def _add_grip(self) -> viser.TransformControlsHandle:
        return self.server.scene.add_transform_controls(
            "/grip",
            scale=HANDLE * self.parts.size,
            line_width=3.0,
            disable_rotations=True,
            active_axes=(True, True, not self.robot.planar),
            depth_test=False,
            visible=False,
        )

    def _add_spring(self) -> Any:
        return self.server.scene.add_line_segments(
            "/spring",
            np.zeros((1, 2, 3), np.float32),
            rgb(PINK),
            thickness=SPRING,
            thickness_units="screen",
            visible=False,
        )

    def paint(self, share: float | None) -> None:
        """Colour the tool's body by a share from 0 to 1, or as other bodies are without one."""
        shade = None if share is None or not np.isfinite(share) else colour(share)
        if shade == self.shade:
            return
        self.shade = shade
        for batch in self.batches:
            if batch.coloured.any():
                colours = batch.colours.copy()
                colours[batch.coloured] = colours[batch.coloured] if shade is None else shade
                batch.node.batched_colors = colours

    def draw(self, arrows: Mapping[str, ArrowLines]) -> None:
        """Show these arrows, by kind, and no others."""
        for kind in [kind for kind in self.arrows if kind not in arrows]:
            for node in self.arrows.pop(kind):
                node.remove()
        for kind, found in arrows.items():
            if kind not in self.arrows:
                self.arrows[kind] = self._add_arrows(kind)
            shafts, arcs = self.arrows[kind]
            for node, points in ((shafts, found.arrows), (arcs, found.arcs)):
                node.visible = len(points) > 0
                if len(points):
                    node.points = points.astype(np.float32)

    def trace(self, lines: np.ndarray) -> None:
        """Show the tools' trail as these lines (s, 2, 3); none hide it."""
        self.trail.visible = len(lines) > 0
        if len(lines):
            self.trail.points = lines.astype(np.float32)

    def _add_trail(self) -> Any:
        return self.server.scene.add_line_segments(
            "/trail",
            np.zeros((1, 2, 3), np.float32),
            rgb(ORANGE),
            thickness=TRAIL,
            thickness_units="screen",
            position=self.lift,
            visible=False,
        )

    def mark(self, shown: Mapping[str, Marks]) -> None:
        """Show these names and frames, by kind, and no others."""
        for kind in [kind for kind in self.marks if kind not in shown]:
            for node in self.marks.pop(kind):
                node.remove()
        for kind, marks in shown.items():
            if kind not in self.marks:
                add = self._add_frames if kind in FRAMES else self._add_names
                self.marks[kind] = add(kind, marks)
            if kind in FRAMES:
                (axes,) = self.marks[kind]
                axes.batched_positions = marks.positions
                axes.batched_wxyzs = quaternions(marks.turns)
                continue
            texts = written(marks, self.parts.size)
            for node, text, place in zip(self.marks[kind], texts, marks.positions, strict=True):
                node.visible, node.position = bool(text), place
                if text and node.text != text:
                    node.text = text

    def _add_frames(self, kind: str, marks: Marks) -> list[Any]:
        axes = self.server.scene.add_batched_axes(
            f"/marks/{kind}",
            quaternions(marks.turns),
            marks.positions,
            axes_length=AXIS * self.parts.size,
            axes_radius=AXIS_RADIUS * self.parts.size,
            position=self.lift,
        )
        return [axes]

    def _add_names(self, kind: str, marks: Marks) -> list[Any]:
        anchor = "bottom-left" if kind == "names of joints" else "top-left"  # above, below
        return [
            self.server.scene.add_label(f"/marks/{kind}/{k}", name, anchor=anchor)
            for k, name in enumerate(marks.names)
        ]

    def look(self, client: viser.ClientHandle, name: str, centre: np.ndarray | None) -> None:
        """Let one browser look from one of `CAMERAS`, at a point (3) [m] or at the mechanism's
        middle, from so far away that all of it is seen as it stands now."""
        up, towards = camera(name, self.robot)
        middle = self.parts.centre if centre is None else centre
        extent = np.linalg.norm(points_of(self.parts.parts, self.shown) - middle, axis=1).max()
        look(client, middle, up, max(self.away, distance(extent)) * towards)

    def welcome(self, client: viser.ClientHandle) -> None:
        """Let a browser that is higher than wide see the whole mechanism, once it stands where all
        begin."""
        begun, looked = self.server.initial_camera.position, []

        def on_update(camera: viser.CameraHandle) -> None:
            narrow = camera.aspect < 1 and not looked
            if narrow and np.allclose(camera.position, begun, rtol=1e-3):
                looked.append(True)
                up, towards = outlook(self.robot)
                look(client, self.parts.centre, up, self.away * towards)

        client.camera.on_update(on_update)

    def follow(self, centre: np.ndarray) -> None:
        """Keep a point (3) [m] in the middle of all browsers."""
        follow(self.server.get_clients(), centre)

    def _add_arrows(self, kind: str) -> tuple[Any, Any]:
        size, nothing = self.parts.size, np.zeros((1, 2, 3), np.float32)
        nodes = self.server.scene.add_arrows(
            f"/arrows/{kind}",
            nothing,
            ARROWS[kind],
            shaft_radius=SHAFT * size,
            head_radius=HEAD * size,
            head_length=HEAD_LENGTH * size,
            visible=False,
        )
        arcs = self.server.scene.add_line_segments(
            f"/arcs/{kind}", nothing, ARROWS[kind], thickness=ARC * size, visible=False
        )
        return nodes, arcs


def points_of(parts: Sequence[Fixture], placement: Placement) -> np.ndarray:
    """Return the points (N, 3) [m] of parts."""
    each = zip(parts, placement.positions, placement.turns, placement.scales, strict=True)
    return np.concatenate(
        [
            position + turned_by(turn[None], part.mesh.vertices * scale)
            for part, position, turn, scale in each
        ]
    )
