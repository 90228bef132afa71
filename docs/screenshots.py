"""Take the pictures of the viewer for the documentation in a headless Chromium: python
docs/screenshots.py"""

import shutil
from pathlib import Path
from time import sleep

import numpy as np
from playwright.sync_api import Browser, Page, sync_playwright

from linkwork import Robot, robots
from linkwork.viewer import Viewer

FOLDER = Path(__file__).parent / "images"
SIZE = {"width": 1120, "height": 680}
FLAGS = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox"]


def main() -> None:
    """Write all pictures."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=FLAGS)
        hexapod(browser)
        planar(browser)
        browser.close()


def hexapod(browser: Browser) -> None:
    """Show a hexapod in the middle of a run, with its forces as arrows and its curves."""
    robot = Robot(robots.stewart())
    hold = np.asarray(robot.inverse_dynamics(robot.home, np.zeros(6)))
    run = robot.simulate(
        robot.home, hold * (1.1, 1, 1, 1, 1, 1), duration=1.5, save_at=np.linspace(0, 1.5, 151)
    )
    with Viewer(robot, run) as viewer:
        page = opened(browser, viewer)
        page.get_by_role("tab", name="Show").click()
        for kind in ("Actuator forces", "Joint reactions"):
            page.get_by_label(kind).check()
        page.get_by_role("tab", name="Run").click()
        viewer.post(lambda: viewer.session.seek(0.9))
        taken(page, "viewer")


def planar(browser: Browser) -> None:
    """Show a 3-PRR that is dragged to the edge of its workspace, and why it stops there."""
    robot = Robot(robots.prr3())
    with Viewer(robot) as viewer:
        page = opened(browser, viewer)
        tool = viewer.session.view().tool
        assert tool is not None
        viewer.post(lambda: viewer.session.drag(tool[0] + (0.1, 0.6, 0), tool[1]))
        page.wait_for_selector("[data-linkwork=notice]")
        taken(page, "viewer-edge")


def opened(browser: Browser, viewer: Viewer) -> Page:
    """Open the page of a viewer, and close what it says about software rendering."""
    page = browser.new_page(viewport=SIZE)
    page.goto(viewer.url)
    page.wait_for_selector("[data-linkwork=facts]")
    page.get_by_text("Software WebGL").wait_for()
    page.locator(".mantine-Notification-closeButton").first.click()
    return page


def taken(page: Page, name: str) -> None:
    """Take a picture once everything has come to rest."""
    sleep(3)
    page.screenshot(path=FOLDER / f"{name}.png")
    page.close()


if __name__ == "__main__":
    main()
