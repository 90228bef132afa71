"""Files that the viewer hands to a browser, without one."""

from io import BytesIO
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image

import linkwork as lw
from linkwork.viewer.saving import FILM, PICTURE, SCENE, file_of
from linkwork.views import video


class Page:
    """What a browser draws: as many rows and columns as are asked for."""

    camera = SimpleNamespace(image_height=600, image_width=4000)

    def get_render(self, rows, columns, timeout):
        return np.full((rows, columns, 3), 200, np.uint8)


class ClosedPage(Page):
    def get_render(self, rows, columns, timeout):
        raise TimeoutError


@pytest.fixture(scope="module")
def robot():
    return lw.Robot("five_bar")


@pytest.fixture(scope="module")
def run(robot):
    return robot.simulate(robot.home, duration=0.1, samples=3)


def test_a_picture_is_what_the_browser_sees(robot):
    name, content = file_of(PICTURE, Page(), robot, robot.home, None)
    assert name == "picture.png" and Image.open(BytesIO(content)).size == (1920, 600)
    with pytest.raises(lw.LinkworkError, match="drawn no picture in 20 s; keep its page in front"):
        file_of(PICTURE, ClosedPage(), robot, robot.home, None)


def test_a_scene_is_one_of_the_run_or_else_of_the_pose(robot, run):
    contents = [file_of(SCENE, Page(), robot, robot.home, each)[1] for each in (None, run)]
    assert all(content.startswith(b"glTF") for content in contents)
    assert [b'"animations"' in content for content in contents] == [False, True]


@pytest.mark.parametrize("name", ["film.gif", "film.mp4"])
def test_a_film_needs_a_run(robot, run, monkeypatch, name):
    if name == "film.gif":
        monkeypatch.setattr(video, "ffmpeg", lambda: "")
    elif not video.ffmpeg():
        pytest.skip("there is no ffmpeg")
    made, content = file_of(FILM, Page(), robot, robot.home, run, run)
    assert made == name and len(content) > 1000
    with pytest.raises(lw.LinkworkError, match="no run to film; simulate one first"):
        file_of(FILM, Page(), robot, robot.home, None)
