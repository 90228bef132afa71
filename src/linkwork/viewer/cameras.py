"""From where the robot is seen: views along axes and between them, which a browser goes to.

In xy and xz the first axis leads to the right and the second one upwards. The isometric view makes
equal angles with all axes; what is up in it is up in the mechanism.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import viser

from linkwork.robot import Robot
from linkwork.scene.scene import upwards

CAMERAS = ("iso", "xy", "xz", "yz")
FIELD_OF_VIEW = np.radians(40)
NARROW = 0.7  # width over height of a picture over which the panel lies, as on telephones
AXES = dict(zip("xyz", np.eye(3), strict=True))


def sideways(up: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return directions to the right and to the front that go with what is up."""
    side = AXES["x"] if abs(up[0]) < 0.9 else AXES["y"]
    return side, np.cross(side, up)


def outlook(robot: Robot) -> tuple[np.ndarray, np.ndarray]:
    """Return the directions that are up and towards the viewer when a page is opened; a planar
    mechanism is seen along z."""
    up = upwards(robot)
    side, front = sideways(up)
    towards = AXES["z"] - 0.35 * up if robot.planar else 0.8 * front + 0.55 * side + 0.5 * up
    return up, towards / np.linalg.norm(towards)


def camera(name: str, robot: Robot) -> tuple[np.ndarray, np.ndarray]:
    """Return the directions that are up and towards the viewer of one of `CAMERAS`."""
    if name == "iso":
        up = upwards(robot)
        towards = sum(sideways(up), up)
        return up, towards / np.linalg.norm(towards)
    right, up = (AXES[letter] for letter in name)
    return up, np.cross(right, up)


def distance(radius: float) -> float:
    """Return how far away the whole of a ball of a radius [m] is seen."""
    return radius / np.sin(FIELD_OF_VIEW / 2)


def look(client: viser.ClientHandle, centre: np.ndarray, up: np.ndarray, arm: np.ndarray) -> None:
    """Let one browser look at a point (3) [m] from this arm (3) [m] away.

    One that is higher than wide sees in its width what others see in their height; one that is much
    higher in its upper half, for the panel covers the lower one.
    """
    aspect = client.camera.aspect
    arm = arm / min(aspect, 1.0)
    if aspect < NARROW:
        away = np.linalg.norm(arm)
        upright = up - (up @ arm) * arm / away**2
        rise = 0.5 * away * np.tan(FIELD_OF_VIEW / 2)  # a quarter of the picture's height
        centre = centre - rise * upright / np.linalg.norm(upright)
    with client.atomic():
        client.camera.up_direction = up
        client.camera.position = centre + arm
        client.camera.look_at = centre


def follow(clients: Mapping[int, viser.ClientHandle], centre: np.ndarray) -> None:
    """Keep a point (3) [m] in the middle of all browsers; each looks from where it looked."""
    for client in clients.values():
        with client.atomic():
            client.camera.position = centre + client.camera.position - client.camera.look_at
            client.camera.look_at = centre
