"""The viewer in a real headless Chromium: it loads, is dragged, plays, and bears two browsers and
one that vanishes."""

from __future__ import annotations

import numpy as np
import pytest
from playwright.sync_api import sync_playwright

from linkwork import Robot, robots
from linkwork.mechanism import Mechanism
from linkwork.viewer import Viewer

from tests.analysis.test_translating_platforms import wrist
from tests.processes import PATIENCE
from tests.viewer.browser import launch, on_screen, until

SIZE = {"width": 760, "height": 480}
EVIL = "<img src=x onerror=alert(1)>"


@pytest.fixture(scope="module")
def chromium():
    with sync_playwright() as playwright:
        browser = launch(playwright)
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def robot() -> Robot:
    return Robot(robots.prr3())


@pytest.fixture(scope="module")
def viewer(robot):
    with Viewer(robot) as made:
        yield made


class Browser:
    """A page on a viewer, what went wrong in it, and what the server knows of it."""

    def __init__(self, chromium, viewer: Viewer, size: dict[str, int] = SIZE):
        before = set(viewer.server.get_clients())
        self.viewer, self.page, self.wrong = viewer, chromium.new_page(viewport=size), []
        self.page.on(
            "console", lambda message: message.type == "error" and self.wrong.append(message.text)
        )
        self.page.on("pageerror", lambda error: self.wrong.append(str(error)))
        self.page.on("dialog", lambda dialog: (self.wrong.append(dialog.message), dialog.dismiss()))
        self.page.set_default_timeout(1000 * PATIENCE)
        self.page.goto(viewer.url)
        self.page.wait_for_selector("[data-linkwork=facts]")
        until(lambda: set(viewer.server.get_clients()) - before)
        self.client = viewer.server.get_clients()[max(set(viewer.server.get_clients()) - before)]

    def pixel(self, along: float = 0.0) -> tuple[float, float]:
        """Return where the arrow along x of the handle is, at a part of the handle's size."""
        out = self.viewer.session.view()
        assert out.tool is not None and self.viewer.stage.handle is not None
        position, turn = out.tool
        return on_screen(
            self.client.camera, position + along * self.viewer.stage.handle.scale * turn[:, 0]
        )

    def grab(self) -> tuple[float, float]:
        """Take hold of the handle's arrow along x."""
        x, y = self.settled()
        self.page.mouse.move(x, y)
        self.page.wait_for_timeout(300)
        self.page.mouse.down()
        return x, y

    def settled(self) -> tuple[float, float]:
        """Return where the handle is to be grabbed once the page is laid out and the canvas lies
        open there."""
        here = "([x, y]) => document.elementFromPoint(x, y)?.tagName"
        until(lambda: self.page.evaluate(here, list(self.pixel(0.8))) == "CANVAS")
        last = None
        while last != (last := self.pixel(0.8)):
            self.page.wait_for_timeout(300)
        return last

    def text(self) -> str:
        return self.page.inner_text("[data-linkwork=facts]")


def tool(viewer: Viewer) -> np.ndarray:
    return viewer.session.robot.tool_pose(viewer.session.state)


def home(viewer: Viewer) -> None:
    viewer.post(lambda: viewer.session.show(viewer.session.robot.home))
    until(
        lambda: np.allclose(tool(viewer), viewer.session.robot.tool_pose(viewer.session.robot.home))
    )
    viewer.post(lambda: None)


@pytest.mark.long
def test_the_page_loads_without_errors_and_shows_the_robot(chromium, viewer):
    browser = Browser(chromium, viewer)
    assert "3-PRR" in browser.text()
    assert "slide_2 [m]" in browser.page.inner_text("body")
    assert browser.wrong == []
    browser.page.close()


@pytest.mark.long
def test_a_page_as_narrow_as_a_telephone_shows_the_whole_robot_above_the_panel(chromium, robot):
    places = [place for place, _ in robot.body_poses(robot.home).values()]
    with Viewer(robot) as viewer:
        browser = Browser(chromium, viewer, {"width": 390, "height": 844})
        camera = browser.client.camera

        def seen() -> bool:
            pixels = [on_screen(camera, place) for place in places]
            return all(0 < x < 390 and 0 < y < 422 for x, y in pixels)

        until(seen)
        assert browser.wrong == []
        browser.page.close()


@pytest.mark.long
def test_a_drag_moves_the_platform_and_the_loops_stay_closed(chromium, viewer, robot):
    home(viewer)
    browser = Browser(chromium, viewer)
    start, gaps = tool(viewer), []
    x, y = browser.grab()
    for k in range(1, 9):
        browser.page.mouse.move(x + 8 * k, y - 2 * k)
        gaps.append(float(robot.closure_error(viewer.session.state)))
    until(lambda: np.linalg.norm(tool(viewer) - start) > 0.01)
    browser.page.mouse.up()
    until(lambda: not viewer.held)
    assert max(gaps) < 1e-9 and robot.closure_error(viewer.session.state) < 1e-9
    assert browser.wrong == []
    browser.page.close()


@pytest.mark.long
def test_a_pose_out_of_reach_dragged_at_speed_is_refused_with_a_reason(chromium, viewer, robot):
    home(viewer)
    browser = Browser(chromium, viewer)
    x, y = browser.grab()
    browser.page.mouse.move(x + 60, y)
    browser.page.mouse.move(x + 400, y - 100)
    until(lambda: "edge of the workspace" in browser.text())
    assert robot.closure_error(viewer.session.state) < 1e-9
    browser.page.mouse.up()
    until(
        lambda: np.allclose(viewer.stage.handle.position, viewer.session.view().tool[0], atol=1e-6)
    )
    browser.page.close()


@pytest.mark.long
def test_a_run_plays_to_its_end(chromium, viewer):
    home(viewer)
    browser = Browser(chromium, viewer)
    browser.page.get_by_role("tab", name="Simulate").click()
    browser.page.get_by_label("slide_1 [N]").fill("2.875")
    browser.page.get_by_label("Duration [s]").fill("0.505")
    browser.page.get_by_role("button", name="Simulate from here").click()
    until(lambda: viewer.session.playable and viewer.session.player.ended)
    assert viewer.session.player.time == pytest.approx(0.505)
    assert viewer.session.view().forces["slide_1"] == 2.875
    until(lambda: "t = 0.505 s" in browser.text())
    browser.page.get_by_role("tab", name="Run").click()
    browser.page.wait_for_selector(".uplot")
    browser.page.get_by_role("tab", name="Show").click()
    for kind, begins in (("Picture", b"\x89PNG"), ("Scene", b"glTF")):
        with browser.page.expect_download() as download:
            browser.page.get_by_role("button", name=kind, exact=True).click()
        assert download.value.path().read_bytes().startswith(begins)
    assert browser.wrong == []
    browser.page.close()


@pytest.mark.long
def test_a_hand_pulls_while_the_simulation_goes_on(chromium, viewer, robot):
    home(viewer)
    browser = Browser(chromium, viewer)
    browser.page.get_by_role("tab", name="Simulate").click()
    browser.page.get_by_label("slide_1 [N]").fill("0")
    browser.page.get_by_role("button", name="Go on live, and pull").click()
    until(lambda: viewer.session.live is not None and viewer.stage.grip.visible)
    place = np.array(viewer.stage.grip.position)
    x, y = on_screen(browser.client.camera, place + 0.8 * viewer.stage.grip.scale * np.eye(3)[0])
    browser.page.mouse.move(x, y)
    browser.page.wait_for_timeout(300)
    browser.page.mouse.down()
    for k in range(1, 6):
        browser.page.mouse.move(x + 8 * k, y)
    until(lambda: viewer.session.hand is not None)
    until(lambda: tool(viewer)[0] > place[0] + 0.005)
    assert "pull at platform:" in browser.text()
    browser.page.mouse.up()
    until(lambda: viewer.session.hand is None)
    browser.page.get_by_role("button", name="End, and play it").click()
    until(lambda: viewer.session.live is None and viewer.session.player.playing)
    forces = viewer.session.replay.run["external_wrench"].values[:, 0, 3]
    assert forces.max() > 0 and robot.closure_error(viewer.session.state) < 1e-9
    assert browser.wrong == []
    browser.page.close()


@pytest.mark.long
def test_cameras_names_frames_and_the_trail_are_shown_on_request(chromium, viewer, robot):
    home(viewer)
    browser = Browser(chromium, viewer)
    camera, centre = browser.client.camera, viewer.session.parts.centre
    browser.page.get_by_role("tab", name="Show").click()
    for name, towards in (("xz", (0, -1, 0)), ("xy", (0, 0, 1))):
        browser.page.get_by_role("button", name=name, exact=True).click()
        until(lambda t=towards: np.allclose(direction(camera), t, atol=0.01))
        assert camera.look_at == pytest.approx(centre, abs=1e-3)
    until(
        lambda: on_screen(camera, centre + 0.1 * np.eye(3)[0])[0] - on_screen(camera, centre)[0] > 5
    )
    for label in ("Names of joints", "Frames of bodies", "Trail of the tool", "Camera follows"):
        browser.page.get_by_label(label).check()
    until(lambda: viewer.session.trailing and len(viewer.stage.marks) == 2)
    out = viewer.session.view().tool
    viewer.post(lambda: viewer.session.drag(out[0] + (0.05, 0.03, 0), out[1]))
    until(lambda: np.linalg.norm(tool(viewer)[:2] - out[0][:2]) > 0.05)
    until(lambda: np.allclose(camera.look_at, viewer.session.view().tool[0], atol=1e-3))
    assert direction(camera) == pytest.approx([0, 0, 1], abs=0.01)
    until(lambda: viewer.stage.trail.visible)
    for label in ("Names of joints", "Frames of bodies", "Trail of the tool", "Camera follows"):
        browser.page.get_by_label(label).uncheck()
    until(lambda: not viewer.stage.marks and not viewer.stage.trail.visible)
    assert browser.wrong == []
    browser.page.close()


@pytest.mark.long
def test_dexterity_is_chosen_by_name_and_what_is_not_defined_is_refused(chromium):
    """A wrist on a Tripteron: all of its tool's arrows are on the page, left of the panel."""
    with Viewer(wrist(None, (0, 0, 1), (0, 1, 0))) as viewer:
        browser = Browser(chromium, viewer)
        until(lambda: browser.client.camera.aspect < 1)
        browser.settled()
        browser.page.get_by_role("tab", name="Show").click()
        for name, told in (
            ("manipulability", "manipulability 1, 1 times"),
            ("local transmission index", "no unique transmission wrench"),
        ):
            browser.page.get_by_label("Dexterity", exact=True).click()
            browser.page.get_by_role("option", name=name).click()
            until(lambda told=told: told in browser.text())
        chosen = browser.page.get_by_label("Dexterity", exact=True)
        until(lambda: chosen.input_value() == "manipulability")
        assert viewer.session.measure == "manipulability" and browser.wrong == []
        browser.page.close()


def direction(camera) -> np.ndarray:
    """Return the direction from what a camera looks at towards it."""
    arm = camera.position - camera.look_at
    return arm / np.linalg.norm(arm)


KNOCK = """([url, version]) => new Promise(answer => {
    const socket = new WebSocket(url, version);
    socket.onopen = () => answer("open");
    socket.onerror = () => answer("refused");
})"""


@pytest.mark.long
def test_a_page_of_another_origin_cannot_reach_the_robot(chromium, viewer):
    """Even from the browser that knows the token, with its cookie."""
    import viser

    url, version = (
        viewer.url.partition("?")[0].replace("http", "ws", 1),
        f"viser-v{viser.__version__}",
    )
    context = chromium.new_context()
    own, other = context.new_page(), context.new_page()
    own.goto(viewer.url)
    assert own.evaluate(KNOCK, [url, version]) == "open"
    other.goto("data:text/html,<p>elsewhere</p>")
    assert other.evaluate(KNOCK, [url, version]) == "refused"
    context.close()


@pytest.mark.long
def test_two_browsers_see_the_same_robot_and_one_may_vanish_in_the_middle_of_a_drag(
    chromium, viewer, robot
):
    home(viewer)
    first, second = Browser(chromium, viewer), Browser(chromium, viewer)
    start = tool(viewer)
    x, y = first.grab()
    for k in range(1, 5):
        first.page.mouse.move(x + 8 * k, y)
    until(lambda: np.linalg.norm(tool(viewer) - start) > 0.005)
    until(lambda: second.text() == first.text())
    first.page.close()
    until(lambda: not viewer.held)
    second.page.get_by_role("button", name="Reference pose").click()
    until(lambda: np.allclose(tool(viewer), start))
    assert second.wrong == []
    second.page.close()


@pytest.mark.long
def test_names_with_markup_are_text(chromium):
    plain = robots.five_bar().model_dump(mode="json", exclude_none=True)
    plain["name"] = EVIL
    text = Mechanism.model_validate(plain).model_dump_json().replace("motor_1", EVIL)
    with Viewer(Robot(Mechanism.model_validate_json(text))) as viewer:
        browser = Browser(chromium, viewer)
        assert EVIL in browser.text()
        browser.page.get_by_role("tab", name="Show").click()
        browser.page.get_by_label("Names of joints").check()
        until(lambda: viewer.stage.marks)
        viewer.simulate("constant forces", {EVIL: 1.0}, 0.1)
        until(lambda: viewer.session.playable)
        browser.page.get_by_role("tab", name="Run").click()
        browser.page.wait_for_selector(".uplot")
        assert browser.page.locator("img[src=x]").count() == 0
        assert browser.wrong == []
        browser.page.close()
