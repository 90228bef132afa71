"""The controls beside the scene: what is wrong, joints and branches, the run with its curves, a
simulation, what is shown."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from html import escape
from time import monotonic
from typing import Any, Protocol

import numpy as np
import viser
from viser import uplot

from linkwork.mechanism import GROUND
from linkwork.scene.colours import INK
from linkwork.simulation import Run
from linkwork.viewer.cameras import CAMERAS
from linkwork.viewer.conditioning import colour
from linkwork.viewer.marks import FRAMES, NAMES
from linkwork.viewer.named_dexterity import CONDITIONING, MEASURES
from linkwork.viewer.player import SPEEDS
from linkwork.viewer.saving import FILES
from linkwork.viewer.session import KINDS, Session, View
from linkwork.viewer.simulating import CONTROLLERS
from linkwork.viewer.traces import Traces, quantities, traces
from linkwork.views.style import COLOURS

STEPS = 1000  # of a slider
DIGITS = 6  # behind the point that can be typed; without it as many as the first value has
UNTOUCHED = 0.5  # how long after a touch a control is left to the hand that holds it [s]
NONE = "none"
PIXELS = ((), (8, 3))  # dashes of curves, those of the second round of colours [pixels]
GO_ON, END = "Go on live, and pull", "End, and play it"
LAY_OVER, TAKE_AWAY = "Lay this run over the next", "Take away what is laid over"
ANGLE, HALF_TURN = "the tool's angle", 3.142  # the slider's ends [rad]
MEASURE = "the dexterity"


class Desk(Protocol):
    """Carry out wishes; `post` hands one to the thread that owns the session."""

    session: Session

    def post(self, wish: Callable[[], None], about: object = None) -> None: ...
    def find_branches(self, same: str) -> None: ...
    def show_branch(self, index: int) -> None: ...
    def show_reach(self) -> None: ...
    def hide_reach(self) -> None: ...
    def simulate(self, controller: str, forces: dict[str, float], duration: float) -> None: ...
    def go_on(self, controller: str, forces: dict[str, float], body: str) -> None: ...
    def measure(self, name: str) -> None: ...
    def look(self, client: viser.ClientHandle, name: str) -> None: ...
    def save(self, client: viser.ClientHandle, kind: str) -> None: ...


class Panels:
    """Hold the controls of a server for a session; refreshed by what is to be seen."""

    def __init__(self, server: viser.ViserServer, desk: Desk):
        self.gui, self.desk, self.session = server.gui, desk, desk.session
        self.touched: dict[str, float] = {}
        self.traces: Traces | None = None
        self.plot: viser.GuiUplotHandle | None = None
        self.facts = self.gui.add_html("")
        tabs = self.gui.add_tab_group()
        with tabs.add_tab("Pose"):
            self._add_pose()
        with tabs.add_tab("Run") as self.run_tab:
            self._add_run()
        with tabs.add_tab("Simulate"):
            self._add_simulation()
        with tabs.add_tab("Show"):
            self._add_choices()
        self.show_run(None)

    # Pose

    def _add_pose(self) -> None:
        self.sliders = {
            name: self._add_slider(name, *ends) for name, ends in self.session.sliders.items()
        }
        self.angle = self._add_angle()
        home = self.gui.add_button("Reference pose")
        home.on_click(lambda _: self._post(lambda: self.session.show(self.session.robot.home)))
        self.branches = self._add_dropdown(
            "Branch", ("1 of 1",), "Other ways to assemble the robot"
        )
        self.branches.on_update(self._by_hand(lambda: self.desk.show_branch(self._index())))
        for what, same in (("Assembly modes", "actuators"), ("Working modes", "tool")):
            hint = (
                f"Find all configurations with the {same} where "
                f"{'they are' if same == 'actuators' else 'it is'}"
            )
            button = self.gui.add_button(what, hint=hint)
            button.on_click(lambda _, same=same: self.desk.find_branches(same))

    def _add_slider(self, name: str, low: float, high: float) -> viser.GuiSliderHandle:
        here = float(self.session.robot.home[name])
        label = f"{name} [{self.session.robot.unit(name)}]"
        step = fine_step(high - low)
        slider = self.gui.add_slider(label, low, high, step, here)

        def wished() -> None:
            self.touched[name] = monotonic()
            value = float(slider.value)
            self.desk.post(lambda: self.session.slide(name, value), ("slide", name))

        slider.on_update(self._by_hand(wished))
        return slider

    def _add_angle(self) -> viser.GuiSliderHandle | None:
        """Add a slider for the angle of a planar tool, if it can be turned where it is."""
        session = self.session
        if session.view().angle is None or not session.pursuit.turns:
            return None
        here = session.view().angle or 0.0
        slider = self.gui.add_slider("tool's angle [rad]", -HALF_TURN, HALF_TURN, 1e-3, here)

        def wished() -> None:
            self.touched[ANGLE] = monotonic()
            value = float(slider.value)
            self.desk.post(lambda: session.turn(value), "turn")

        slider.on_update(self._by_hand(wished))
        return slider

    def _index(self) -> int:
        return int(str(self.branches.value).partition(" ")[0]) - 1

    def show_branches(self, count: int, index: int) -> None:
        """Offer some branches, the one at an index shown."""
        self.branches.options = tuple(f"{k + 1} of {count}" for k in range(max(count, 1)))
        self.branches.value = self.branches.options[index]

    # Run

    def _add_run(self) -> None:
        self.no_run = self.gui.add_html(
            "<p style='margin:0.5em 1em'>There is no run yet: simulate one.</p>"
        )
        self.play = self.gui.add_button("Play")
        self.play.on_click(lambda _: self._post(self.session.play))
        self.clock = self.gui.add_slider("Time [s]", 0.0, 1.0, 0.001, 0.0)
        self.clock.on_update(self._by_hand(self._scrubbed))
        self.speed = self.gui.add_dropdown("Speed", SPEEDS, initial_value="1")
        self.speed.on_update(self._by_hand(lambda: self._post(self._set_speed)))
        self.loop = self.gui.add_checkbox("Loop", False)
        self.loop.on_update(self._by_hand(lambda: self._post(self._set_loop)))
        self.over = self.gui.add_button(
            LAY_OVER, hint="Show this run faintly beside the next one, at the same times"
        )
        self.over.on_click(lambda _: self._post(self._lay_over))
        self.quantity = self._add_dropdown("Curves", (NONE,), "What is drawn over time")
        self.quantity.on_update(self._by_hand(lambda: self._post(self.show_curves)))

    def _lay_over(self) -> None:
        """Lay the present run over those that come, or take the one away that is."""
        session = self.session
        session.lay_over(session.replay.run if session.over is None and session.replay else None)
        self.show_run(session.replay.run if session.replay else None)

    def _scrubbed(self) -> None:
        self.touched["time"] = monotonic()
        time = float(self.clock.value)
        self.desk.post(lambda: self.session.seek(time), "seek")

    def _set_speed(self) -> None:
        self.session.player = self.session.player.at_speed(str(self.speed.value))

    def _set_loop(self) -> None:
        self.session.player = replace(self.session.player, looping=bool(self.loop.value))

    def show_run(self, run: Run | None) -> None:
        """Offer a run's controls and curves; none where there is no run or it has no samples."""
        playable = self.session.playable
        self.no_run.visible = not playable
        for control in (self.play, self.clock, self.speed, self.loop, self.quantity, self.over):
            control.visible = playable
        if run is None or not playable:
            return
        self.over.label = LAY_OVER if self.session.over is None else TAKE_AWAY
        player = self.session.player
        span = max(player.end - player.start, 1e-9)
        self.clock.min = player.start
        self.clock.max = player.start + span
        self.clock.step = fine_step(span)
        self.clock.value = player.time
        self._set_speed()
        self._set_loop()
        names = (*quantities(run), NONE)
        first = "joint_position" if "joint_position" in names else NONE
        chosen = first if self.traces is None else str(self.quantity.value)
        self.quantity.options = names
        self.quantity.value = chosen if chosen in names else first
        self.show_curves()

    def show_curves(self) -> None:
        """Draw the chosen quantity of the run."""
        if self.plot is not None:
            self.plot.remove()
            self.plot = None
        replay, name = self.session.replay, str(self.quantity.value)
        if replay is None or replay.empty or name == NONE:
            return
        self.traces = found = traces(replay.run.smooth, name, tuple(self.sliders))
        curves = [
            uplot.Series(
                label=label,
                stroke=COLOURS[k % len(COLOURS)],
                dash=PIXELS[k // len(COLOURS)],
                width=2,
                points=uplot.Series_Points(show=False),
            )
            for k, label in enumerate(found.labels)
        ]
        mark = uplot.Series(
            label="now", stroke=INK, width=1, points=uplot.Series_Points(show=False)
        )
        low, high = found.range
        with self.run_tab:
            self.plot = self.gui.add_uplot(
                found.at(self.session.player.time),
                (uplot.Series(label="time [s]"), *curves, mark),
                title=f"{name.replace('_', ' ')} [{found.unit}]",
                scales={"x": uplot.Scale(time=False), "y": uplot.Scale(range=(low, high))},
                aspect=1.4,
            )

    # Simulation

    def _add_simulation(self) -> None:
        self.controller = self.gui.add_dropdown(
            "Drive", tuple(CONTROLLERS), hint="What drives the actuators"
        )
        robot = self.session.robot
        self.forces = {
            name: self.gui.add_number(f"{name} [{'N' if robot.unit(name) == 'm' else 'N m'}]", 0.0)
            for name in robot.actuators
        }
        self.duration = self.gui.add_number("Duration [s]", 2.0, min=0.01, max=1000.0)
        for number in (*self.forces.values(), self.duration):
            number.precision = DIGITS
        self.start = self.gui.add_button("Simulate from here")
        self.start.on_click(lambda _: self._simulate())

        tools = [tool.body for tool in robot.mechanism.tools.values()]
        self.body = self._add_dropdown("Pull at", tuple(robot.bodies), "The body that a hand holds")
        self.body.value = (*tools, *robot.bodies)[0]
        self.going = self.gui.add_button(
            GO_ON, hint="Simulate as long as you watch, and pull at a body by its handle"
        )
        self.going.on_click(lambda _: self._go_on())

    def _simulate(self) -> None:
        self.desk.simulate(*self._drive(), float(self.duration.value))

    def _go_on(self) -> None:
        self.desk.go_on(*self._drive(), str(self.body.value))

    def _drive(self) -> tuple[str, dict[str, float]]:
        forces = {name: float(number.value) for name, number in self.forces.items()}
        return str(self.controller.value), forces

    def _add_dropdown(
        self, label: str, options: tuple[str, ...], hint: str
    ) -> viser.GuiDropdownHandle[str]:
        return self.gui.add_dropdown(label, options, hint=hint)

    # What is shown

    def _add_choices(self) -> None:
        cameras = self.gui.add_button_group("Camera", CAMERAS, hint="From where it is seen")
        cameras.on_click(lambda event: self._look(event.client, str(cameras.value)))
        tools = bool(self.session.robot.mechanism.tools)
        self.followed = self.gui.add_checkbox(
            "Camera follows",
            False,
            hint=f"Keep the {'tool' if tools else 'first body'} in the middle",
        )
        self.followed.on_update(self._by_hand(lambda: self._post(lambda: None)))
        self.trail = self.gui.add_checkbox(
            "Trail of the tool", False, hint="Where it was in the run so far, or was led by hand"
        )
        self.trail.visible = tools
        self.trail.on_update(self._by_hand(lambda: self._post(self._choose)))
        self.kinds = {
            kind: self.gui.add_checkbox(kind.capitalize(), False)
            for kind in (*KINDS, *NAMES, *FRAMES)
        }
        for box in self.kinds.values():
            box.on_update(self._by_hand(lambda: self._post(self._choose)))
        self._add_measures()
        if tools:
            self._add_reach()
        files = self.gui.add_button_group(
            "Save",
            FILES,
            hint="What is seen as a picture, the run as a film, and the run or the pose as a "
            "scene (glTF) for other programs",
        )
        files.on_click(lambda event: self._save(event.client, str(files.value)))

    def _add_measures(self) -> None:
        """Add the choice of what is told of the pose, and whether it colours the tool's body."""
        self.measure = self._add_dropdown(
            "Dexterity", tuple(MEASURES), "How well the actuators move the tool, and it them"
        )

        def wished() -> None:
            self.touched[MEASURE] = monotonic()
            self.desk.measure(str(self.measure.value))

        self.measure.on_update(self._by_hand(wished))
        self.coloured = self.gui.add_checkbox(
            "Dexterity as colour", True, hint="Blue: good; yellow; vermilion: nearly singular"
        )
        self.coloured.on_update(self._by_hand(lambda: self._post(lambda: None)))

    def _add_reach(self) -> None:
        reach = self.gui.add_button(
            "Workspace from here",
            hint="What the tool reaches as it is turned now, and, vermilion, where it is "
            "actuator-singular",
        )
        reach.on_click(lambda _: self.desk.show_reach())
        hide = self.gui.add_button("Hide the workspace")
        hide.on_click(lambda _: self.desk.hide_reach())

    def _look(self, client: viser.ClientHandle | None, name: str) -> None:
        if client is not None:
            self.desk.look(client, name)

    def _save(self, client: viser.ClientHandle | None, kind: str) -> None:
        if client is not None:
            self.desk.save(client, kind)

    def _choose(self) -> None:
        self.session.shown = frozenset(kind for kind, box in self.kinds.items() if box.value)
        self.session.trailing = bool(self.trail.value)

    # What changes

    def refresh(self, view: View, *, texts: bool) -> None:
        """Show where joints and the run stand; `texts`: also what is written and drawn beside the
        scene."""
        if not texts:
            return
        now = monotonic()
        for name, slider in self.sliders.items():
            if not self._held(name, now):
                stand(slider, view.coordinates[name], turns=self.session.robot.unit(name) == "rad")
        if self.angle is not None and view.angle is not None and not self._held(ANGLE, now):
            self.angle.value = float(np.clip(view.angle, -HALF_TURN, HALF_TURN))
        if view.time is not None and not self._held("time", now):
            self.clock.value = float(np.clip(view.time, self.clock.min, self.clock.max))
        self.play.label = "Pause" if self.session.player.playing else "Play"
        self.going.label = GO_ON if self.session.live is None else END
        self.facts.content = facts(self.session, view)
        if not self._held(MEASURE, now):
            self.measure.value = view.measured.name
        if self.plot is not None and self.traces is not None:
            self.plot.data = self.traces.at(self.session.player.time)

    def _held(self, name: str, now: float) -> bool:
        """Tell whether a hand touched a control lately."""
        return now - self.touched.get(name, -1.0) <= UNTOUCHED

    def settled(self, now: float) -> bool:
        """Tell whether no hand has touched a control lately."""
        return all(now - touch > UNTOUCHED for touch in self.touched.values())

    # Callbacks

    def _post(self, wish: Callable[[], None]) -> None:
        self.desk.post(wish)

    def _by_hand(self, act: Callable[[], None]) -> Callable[[Any], None]:
        """Return a callback that acts on what a browser changed, and not on what `refresh` did."""

        def callback(event: Any) -> None:
            if event.client is not None:
                act()

        return callback


def fine_step(span: float) -> float:
    """Return a power of ten of which a span holds a thousand or more."""
    return float(10.0 ** np.floor(np.log10(span / STEPS)))


def stand(slider: viser.GuiSliderHandle, value: float, *, turns: bool) -> None:
    """Let a slider stand at a value: an angle beyond a range of a whole turn stands where it is the
    same one but for whole turns; for any other value the range grows."""
    if turns and slider.max - slider.min >= 2 * np.pi and not slider.min <= value <= slider.max:
        value = slider.min + (value - slider.min) % (2 * np.pi)
    if value < slider.min:
        slider.min = float(np.floor(value / slider.step) * slider.step)
    if value > slider.max:
        slider.max = float(np.ceil(value / slider.step) * slider.step)
    slider.value = float(np.clip(value, slider.min, slider.max))


def facts(session: Session, view: View) -> str:
    """Return what is known of the present pose as HTML; names are escaped."""
    return "".join(lines(session, view))


def lines(session: Session, view: View) -> Iterator[str]:
    yield "<div style='margin:0.6em 1em;font-size:0.85em;line-height:1.5' data-linkwork='facts'>"
    yield f"<strong>{escape(session.robot.mechanism.name)}</strong>"
    if view.time is not None:
        yield f" &middot; t = {view.time:.3f} s"
    yield f"<br>closure error {view.closure:.1e} &middot; conditioning {view.conditioning:.3f}"
    if view.measured.name != CONDITIONING:
        yield f"<br>{view.measured.name} {escape(view.measured.told)}"
    if np.isfinite(view.measured.share):
        red, green, blue = colour(view.measured.share)
        yield (
            f" <span style='background:rgb({red},{green},{blue});margin-left:0.4em;"
            "padding:0 0.8em;border-radius:2px'></span>"
        )
    if view.tool is not None:
        yield f"<br>tool at {placed(session, view, view.tool[0])}"
    if view.pulled is not None:
        force = ", ".join(f"{x:.3g}" for x in np.round(view.pulled.force, 9) + 0.0)
        size = float(np.linalg.norm(view.pulled.force))
        yield f"<br>pull at {escape(view.pulled.body)}: {size:.3g} N ({force})"
    if view.notice:
        yield f"<br><span style='color:#b34700' data-linkwork='notice'>{escape(view.notice)}</span>"
    yield "</div>"


def placed(session: Session, view: View, tool: np.ndarray) -> str:
    """Return where the tool is and how a planar one is turned, in the frame of what its pose is
    relative to; tool: position (3) in the ground's axes [m]."""
    (p, R), base = session.base(), session.robot.mechanism.first_tool.relative_to
    own = (R.T @ (tool - p))[: 2 if session.robot.planar else 3]
    place = ", ".join(f"{x:.4f}" for x in np.round(own, 4) + 0.0)
    turned = "" if view.angle is None else f", {np.round(view.angle, 4) + 0.0:.4f} rad"
    return f"{place} m{turned}" + ("" if base == GROUND else f", relative to {escape(base)}")
