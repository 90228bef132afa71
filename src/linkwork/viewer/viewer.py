"""The viewer: a server for browsers, and one thread that moves the robot as they wish, 30 times a
second."""

from __future__ import annotations

import sys
import traceback
from collections.abc import Callable
from threading import Event, Thread
from time import monotonic
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from linkwork import checks
from linkwork.errors import LinkworkError
from linkwork.robot import Robot, State
from linkwork.scene.seen_runs import shown_robot
from linkwork.simulation import Run
from linkwork.viewer.access import LOOPBACK, serve
from linkwork.viewer.mailbox import Mailbox
from linkwork.viewer.named_dexterity import require_measure
from linkwork.viewer.session import Session

if TYPE_CHECKING:
    from viser import ClientHandle

    from linkwork.viewer.pulling import Live

# Between two pictures, and how long to wait for a wish while nothing moves [s].
FRAME, IDLE = 1 / 30, 0.25
LONGEST = 0.2  # time that may pass in one picture [s]
TEXTS = 0.12  # how often what is written is refreshed [s]
FAILED = "this failed unexpectedly; the terminal shows why"


class Viewer:
    """Show a robot, and a run of it, to browsers until it is closed.

    The platform is dragged by a handle on the tool, actuated joints are set by sliders, runs are
    played, and new ones are started from the present pose. Everybody who opens the page sees and
    moves the same robot. With no other thread touching it, `session` holds what is shown.

    Args:
        robot: the robot.
        run: a run of it, to be played.
        over: another run of it, which is shown faintly at the same times.
        host: address to listen on; the default one is reached from this computer alone.
        port: port to listen on; left out, the first free one from 8080 on.

    Attributes:
        url: where browsers find it, with the token that they are let in by

    Raises:
        LinkworkError: a run of another robot, an address that cannot be listened on, a port in use,
            viser not installed.
    """

    def __init__(
        self,
        robot: Robot,
        run: Run | None = None,
        *,
        over: Run | None = None,
        host: str = LOOPBACK,
        port: int | None = None,
    ):
        if not isinstance(robot, Robot):
            raise LinkworkError(f"the viewer shows a Robot, not {robot!r}")
        self.session = Session(shown_robot(robot, run))
        if run is not None:
            self.session.load(run)
        self.session.lay_over(over)
        self.branches: list[State] = [robot.home]
        self.mailbox = Mailbox()
        self.busy = False
        self.moved, self.held, self.last_texts = True, False, 0.0
        self.server, self.url = serve(host, port)
        self._build(run)
        self._stopped = Event()
        self._thread = Thread(target=self._loop, name="linkwork viewer", daemon=True)
        self._thread.start()

    def _build(self, run: Run | None) -> None:
        from linkwork.viewer.panels import Panels
        from linkwork.viewer.stage import BrowserStage

        session = self.session
        self.server.gui.configure_theme(
            show_logo=False, show_share_button=False, control_width="medium"
        )
        self.server.gui.set_panel_label("Linkwork")
        self.server.gui.main_panel.dock_right()
        self.stage = BrowserStage(self.server, session)
        self.panels = Panels(self.server, self)
        if run is not None:
            self.panels.show_run(run)
        if self.stage.handle is not None:
            self.stage.handle.on_update(self._dragged)
        self.stage.grip.on_update(self._pulled)
        self.server.on_client_connect(self.stage.welcome)
        self.server.on_client_disconnect(lambda _: self.post(self._released))
        self.refresh(monotonic())

    # Wishes

    def post(self, wish: Callable[[], None], about: object = None) -> None:
        """Hand a wish to the thread that owns the session; a later one about the same takes its
        place."""
        self.mailbox.post(wish, about)

    async def _dragged(self, event: Any) -> None:
        if event.client is None:
            return
        position, wxyz = event.target.position, event.target.wxyz
        if event.phase == "end":
            self.post(self._released, "drag")
        else:
            self.post(lambda: self._drag(position, wxyz), "drag")

    def _drag(self, position: ArrayLike, wxyz: ArrayLike) -> None:
        place, turn = vector("position", position, 3), vector("orientation", wxyz, 4)
        self.held = True
        self.session.drag(place, matrix(turn))

    def _released(self) -> None:
        self.held = False
        self.session.release()
        self.session.hand = None

    async def _pulled(self, event: Any) -> None:
        if event.client is None:
            return
        position = None if event.phase == "end" else event.target.position
        self.post(lambda: self._pull(position), "pull")

    def _pull(self, position: ArrayLike | None) -> None:
        place = None if position is None else vector("position", position, 3)
        self.session.hand = place if self.session.live is not None else None

    def go_on(self, controller: str, forces: dict[str, float], body: str) -> None:
        """Simulate from the present pose for as long as one watches, a hand at a body; where that
        goes on, end it and play it from the start.

        controller: one of those that are offered; forces: of the actuators by name [N, N m]; body:
        its name.
        """

        def toggle() -> None:
            live = self.session.live
            if live is None:
                self._work("preparing", self._going_on(controller, forces, body))
            else:
                self.session.end()
                self._work("keeping what happened", self._kept(live))

        self.post(toggle)

    def _going_on(
        self, controller: str, forces: dict[str, float], body: str
    ) -> Callable[[], Callable[[], None]]:
        from linkwork.viewer.pulling import HandPull, Live
        from linkwork.viewer.simulating import driving

        robot = self.session.robot
        state = self.session.state.with_rates(np.zeros(robot.mobility))

        def prepare() -> Callable[[], None]:
            drive = driving(robot, state, controller, forces)
            live = Live(robot, state, drive, HandPull.at(robot, state, body))
            live.prepare()
            return lambda: self.session.begin(live)

        return prepare

    def _kept(self, live: Live) -> Callable[[], Callable[[], None]]:
        def keep() -> Callable[[], None]:
            run, notice = live.kept()

            def show() -> None:
                self._show_run(run)
                self.session.notice = notice or self.session.notice

            return show

        return keep

    def find_branches(self, same: str) -> None:
        """Look for all configurations with the same "actuators" or the same "tool" pose, and offer
        them."""
        self.post(
            lambda: self._work(
                f"looking for all configurations with the same {same}", self._branches_of(same)
            )
        )

    def _branches_of(self, same: str) -> Callable[[], Callable[[], None]]:
        from linkwork.viewer.branches import branches

        robot, state = self.session.robot, self.session.state

        def search() -> Callable[[], None]:
            found, index = branches(robot, state, same)
            return lambda: self._offer(found, index)

        return search

    def _offer(self, found: list[State], index: int) -> None:
        self.branches = found
        self.panels.show_branches(len(found), index)
        self.session.notice = f"{len(found)} found" if len(found) > 1 else "there is no other one"

    def show_reach(self) -> None:
        """Look for what the tool reaches from here, and show it."""
        self.post(lambda: self._work("looking for what the tool reaches", self._reach()))

    def hide_reach(self) -> None:
        """Show no longer what the tool reaches."""
        self.post(lambda: self.stage.show_reach(None))

    def _reach(self) -> Callable[[], Callable[[], None]]:
        from linkwork.viewer.reach import reach_of

        robot, state, base = self.session.robot, self.session.state, self.session.base()

        def look() -> Callable[[], None]:
            found = reach_of(robot, state, self.session.parts.size)

            def show() -> None:
                self.stage.show_reach(found, base)
                told = "the tool reaches farther than is shown" if found.cut else ""
                self.session.notice = told

            return show

        return look

    def measure(self, name: str) -> None:
        """Tell a measure of `named_dexterity` of the pose, if it is defined for this robot.

        name: of the measure.
        """

        def prepare() -> Callable[[], None]:
            require_measure(self.session.robot, name)
            return lambda: setattr(self.session, "measure", name)

        self.post(lambda: self._work(f"preparing the {name}", prepare))

    def show_branch(self, index: int) -> None:
        """Show one of the configurations that were found last.

        index: its number, from 0 on.
        """
        self.post(
            lambda: self.session.show(self.branches[index]) if index < len(self.branches) else None
        )

    def look(self, client: ClientHandle, name: str) -> None:
        """Let one browser look from one of `cameras.CAMERAS`.

        client: the browser; name: of the view.
        """

        def turn() -> None:
            followed = self.panels.followed.value
            self.stage.look(client, name, self.session.view().focus if followed else None)

        self.post(turn)

    def save(self, client: ClientHandle, kind: str) -> None:
        """Hand one browser a file of what is shown, one of `saving.FILES`.

        client: the browser; kind: of the file.
        """
        self.post(lambda: self._work(f"saving the {kind.lower()}", self._saved(client, kind)))

    def _saved(self, client: ClientHandle, kind: str) -> Callable[[], Callable[[], None]]:
        from linkwork.viewer.saving import file_of

        session = self.session
        run, over = (each and each.run for each in (session.replay, session.over))
        shown = kind, client, session.robot, session.state, run, over

        def carry_out() -> Callable[[], None]:
            name, content = file_of(*shown)
            return lambda: client.send_file_download(name, content, save_immediately=True)

        return carry_out

    def simulate(self, controller: str, forces: dict[str, float], duration: float) -> None:
        """Simulate from the present pose and play the run.

        controller: one of those that are offered; forces: of the actuators by name [N, N m];
        duration: [s].
        """
        self.post(lambda: self._work("simulating", self._run_of(controller, forces, duration)))

    def _run_of(
        self, controller: str, forces: dict[str, float], duration: float
    ) -> Callable[[], Callable[[], None]]:
        from linkwork.viewer.simulating import simulate

        robot = self.session.robot
        state = self.session.state.with_rates(np.zeros(self.session.robot.mobility))

        def carry_out() -> Callable[[], None]:
            run = simulate(robot, state, controller, forces, duration)
            return lambda: self._show_run(run)

        return carry_out

    def _show_run(self, run: Run) -> None:
        self.session.load(run)
        self.panels.show_run(run)
        self.session.play()

    def _work(self, what: str, work: Callable[[], Callable[[], None]]) -> None:
        """Carry out what takes long beside the scene, one at a time, and then what it returns in
        the session's thread."""
        if self.busy:
            self.session.notice = "one thing at a time: the last wish is still being carried out"
            return
        self.busy, self.session.notice = True, f"{what} ..."

        def carry_out() -> None:
            try:
                done = work()
            except LinkworkError as error:
                done = self._saying(str(error))
            except Exception:
                traceback.print_exc()
                done = self._saying(FAILED)

            def finish() -> None:
                self.busy, self.session.notice = False, ""
                done()

            self.post(finish)

        Thread(target=carry_out, daemon=True).start()

    def _saying(self, sentence: str) -> Callable[[], None]:
        def say() -> None:
            self.session.notice = sentence

        return say

    # Time

    def _loop(self) -> None:
        last = monotonic()
        while not self._stopped.is_set():
            wishes = self.mailbox.take(0.0 if self.moved or self.session.active else IDLE)
            now = monotonic()
            self._attempt(
                lambda wishes=wishes, now=now, last=last: self.tick(
                    wishes, min(now - last, LONGEST), now
                )
            )
            last = now
            self._stopped.wait(max(0.0, FRAME - (monotonic() - now)))

    def tick(self, wishes: list[Callable[[], None]], seconds: float, now: float) -> None:
        """Carry out wishes, let time pass, and show what has changed.

        wishes: what browsers asked for; seconds: since the last tick; now: the time of a clock [s].
        """
        for wish in wishes:
            self._attempt(wish)
        moved = self.session.advance(seconds)
        self.moved = self.moved or moved or bool(wishes)
        if self.moved:
            self.refresh(now)

    def _attempt(self, act: Callable[[], None]) -> None:
        """Carry something out; what goes wrong is said, and nothing is wanted further."""
        try:
            act()
        except LinkworkError as error:
            self.session.notice = str(error)
        except Exception:
            traceback.print_exc(file=sys.stderr)
            self.session.release()
            self.session.notice = FAILED

    def refresh(self, now: float) -> None:
        """Show what is to be seen.

        now: the time of a clock [s].
        """
        view, texts = self.session.view(), now - self.last_texts > TEXTS
        with self.server.atomic():
            self.stage.show(view.placement)
            self.stage.lay(view.rails)
            self.stage.show_faintly(view.over)
            self.stage.pull(view.pulled)
            self.stage.draw(view.arrows)
            self.stage.mark(view.marks)
            self.stage.trace(view.trail)
            if self.panels.followed.value and not self.held:
                self.stage.follow(view.focus)
            self.stage.paint(view.measured.share if self.panels.coloured.value else None)
            if view.tool is not None and not self.held:
                self.stage.hold(view.tool if view.pulled is None else None)
            self.panels.refresh(view, texts=texts)
        if texts:
            self.last_texts = now
        self.moved = not (texts and self.panels.settled(now))

    # Its end

    def wait(self) -> None:
        """Serve until interrupted (Ctrl-C)."""
        try:
            while not self._stopped.wait(0.5):
                pass
        except KeyboardInterrupt:
            pass
        finally:
            self.close()

    def close(self) -> None:
        """Stop serving; browsers say that the connection is lost."""
        if not self._stopped.is_set():
            self._stopped.set()
            self._thread.join(2.0)
            self.server.stop()

    def __enter__(self) -> Viewer:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"Viewer({self.session.robot.mechanism.name!r} at {self.url})"


def vector(what: str, values: ArrayLike, size: int) -> np.ndarray:
    """Return what a browser sends as a vector of finite numbers (size)."""
    found = checks.finite(values, f"the handle's {what}")
    if found.shape != (size,):
        raise LinkworkError(f"the handle's {what} has the shape {found.shape}; give {size} numbers")
    return found


def matrix(wxyz: np.ndarray) -> np.ndarray:
    """Return the rotation matrix of a quaternion w, x, y, z."""
    from scipy.spatial.transform import Rotation

    if not np.linalg.norm(wxyz) > 0:
        raise LinkworkError(
            "the handle's orientation is a quaternion of zeros; give one of length 1"
        )
    w, x, y, z = wxyz
    return Rotation.from_quat([x, y, z, w]).as_matrix()
