"""Saved runs on the command line: whose they are."""

from __future__ import annotations

from pathlib import Path

from linkwork import robots
from linkwork.cli.catalogue import find
from linkwork.cli.options import PLAIN
from linkwork.cli.source import Source
from linkwork.errors import LinkworkError
from linkwork.formats.models import warn
from linkwork.mechanism import Mechanism
from linkwork.robot import Robot
from linkwork.simulation import Run

SUFFIX = ".nc"
HOW = {  # options of how a file is read, by their names in `ReadingOptions`
    "floating": "--floating",
    "packages": "--package-path",
    "merging": "--no-merging",
    "includes": "--include-root",
}


def read(file: str) -> Run:
    """Read a saved run; refuse a file whose name is none of a run."""
    if Path(file).suffix.lower() != SUFFIX:
        raise LinkworkError(f"{file!r} is no saved run; give a file that ends in {SUFFIX}")
    return Run.load(file)


def robot_of(run: Run, file: str, of: Source) -> Robot:
    """Return the robot of a run: the one that is named, the one it holds, or the one of the
    catalogue of that name.

    of: what is said of the one that is named; its name is empty where none is
    """
    if of.name:
        return Robot(find(of))
    for name, option in HOW.items():
        if getattr(of.how, name) != getattr(PLAIN, name):
            raise LinkworkError(
                f"{option} says how the robot of --robot is read; without that a run's own robot "
                "is taken"
            )
    if of.how.reference is not None:
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
