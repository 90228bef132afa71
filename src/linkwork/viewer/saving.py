"""Files of what the viewer shows, for the browser that asks: a picture of its page, the run as a
film, and the run, or the pose, as a scene for other programs."""

from __future__ import annotations

from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import numpy as np

from linkwork.errors import LinkworkError
from linkwork.robot import Robot, State
from linkwork.simulation import Run

if TYPE_CHECKING:
    from viser import ClientHandle

FILES = PICTURE, FILM, SCENE = "Picture", "Film", "Scene"
PATIENCE = 20.0  # time in which a browser draws a picture [s]
SIZE = 1080, 1920  # of a picture at most, rows and columns
FPS, FRAMES = 20.0, 600  # of a film: a second, and at most

File = tuple[str, bytes]


def file_of(
    kind: str,
    client: ClientHandle,
    robot: Robot,
    state: State,
    run: Run | None,
    over: Run | None = None,
) -> File:
    """Return the name and the content of one of FILES.

    kind: a picture (.png) as the browser sees it; a film of the run (.mp4 where there is ffmpeg,
    else .gif), at its own speed up to 30 s, with another run faintly over it; a scene (.glb) of
    the run, or of the state where there is none.

    Raises:
        LinkworkError: a film without a run, a browser that draws no picture.
    """
    if kind == PICTURE:
        return picture(client)
    if kind == SCENE:
        return scene(robot, state if run is None else run)
    if run is None:
        raise LinkworkError("there is no run to film; simulate one first")
    return film(robot, run, over)


def picture(client: ClientHandle) -> File:
    """Return what a browser sees."""
    from PIL import Image

    rows = min(client.camera.image_height or SIZE[0], SIZE[0])
    columns = min(client.camera.image_width or SIZE[1], SIZE[1])
    try:
        drawn = client.get_render(rows, columns, timeout=PATIENCE)
    except TimeoutError:
        raise LinkworkError(
            f"the browser has drawn no picture in {PATIENCE:g} s; keep its page in front"
        ) from None
    content = BytesIO()
    Image.fromarray(drawn).save(content, "PNG")
    return "picture.png", content.getvalue()


def film(robot: Robot, run: Run, over: Run | None = None) -> File:
    """Return a run as a film."""
    from linkwork.views.video import ffmpeg, write_video

    speed = max(1.0, float(np.ptp(run.time)) * FPS / (FRAMES - 1))
    name = "film.mp4" if ffmpeg() else "film.gif"
    return written(
        name, lambda path: write_video(robot, run, path, fps=FPS, speed=speed, over=over)
    )


def scene(robot: Robot, motion: Run | State) -> File:
    """Return a run or a state as a scene for other programs."""
    from linkwork.views import write_gltf

    return written("scene.glb", lambda path: write_gltf(robot, motion, path))


def written(name: str, write: Callable[[Path], object]) -> File:
    """Return what is written to a file of a name."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / name
        write(path)
        return name, path.read_bytes()
