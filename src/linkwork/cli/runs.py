"""Saved runs on the command line: whose they are."""

from __future__ import annotations

from pathlib import Path

from linkwork import robots
from linkwork.cli.catalogue import find
from linkwork.cli.source import Source
from linkwork.errors import LinkworkError
from linkwork.formats.models import warn
from linkwork.mechanism import Mechanism
from linkwork.robot import Robot
from linkwork.simulation import Run

SUFFIX = ".nc"


def read(file: str) -> Run:
    """Read a saved run; refuse a file whose name is none of a run."""
    if Path(file).suffix.lower() != SUFFIX:
        raise LinkworkError(f"{file!r} is no saved run; give a file that ends in {SUFFIX}")
    return Run.load(file)


def robot_of(run: Run, file: str, of: str | None, reference: str | None = None) -> Robot:
    """Return the robot of a run: the one that is named, the one it holds, or the one of the
    catalogue of that name.

    reference: joint coordinates in place of those of the reference of the one that is named, as
    text
    """
    if of is not None:
        return Robot(find(Source(of, reference)))
    if reference is not None:
        raise LinkworkError(
            "--reference says where the loops of the robot of --robot are closed from; without "
            "that a run's own robot is taken"
        )
    if run.description:
        mechanism = Mechanism.parse(run.description)
        warn(mechanism, stacklevel=2)
        return Robot(mechanism)
    wanted = str(run.attrs.get("mechanism", ""))
    for name in robots.__all__:
        mechanism = getattr(robots, name)()
        if mechanism.name == wanted:
            return Robot(mechanism)
    raise LinkworkError(
        f"{file} does not hold its mechanism, and {wanted!r} is not in the catalogue; say whose "
        "run it is by --robot, a mechanism file"
    )
