"""A real headless Chromium for the tests of the viewer, and where things are on its screen."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from time import monotonic, sleep

import numpy as np
import pytest

from tests.processes import PATIENCE

INSTALLED = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
FLAGS = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox")


def launch(playwright):
    """Start Chromium: one that is installed, else playwright's own; without either the test is
    skipped, and says so."""
    found = (
        next(filter(None, map(shutil.which, INSTALLED)), None)
        or playwright.chromium.executable_path
    )
    if not Path(found).exists():
        pytest.skip(
            f"no Chromium: none of {', '.join(INSTALLED)} is installed; 'playwright install "
            "chromium' gets one"
        )
    return playwright.chromium.launch(executable_path=found, args=list(FLAGS))


def until(true: Callable[[], object]) -> None:
    """Wait until something is true."""
    end = monotonic() + PATIENCE
    while not true():
        assert monotonic() < end, "it did not happen in time"
        sleep(0.02)


def on_screen(camera, point: np.ndarray) -> tuple[float, float]:
    """Return the pixel at which a camera (x right, y down, z forwards) sees a point."""
    w, x, y, z = camera.wxyz
    R = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    right, down, ahead = R.T @ (point - camera.position)
    focal = camera.image_height / 2 / np.tan(camera.fov / 2)
    return float(camera.image_width / 2 + focal * right / ahead), float(
        camera.image_height / 2 + focal * down / ahead
    )
