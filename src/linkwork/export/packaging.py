"""What goes with the header and the source: how it is built, found and tested, and a page on it."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.metadata import version

from linkwork.export.calls import Call
from linkwork.export.selftest import selftest_text
from linkwork.export.statements import Dialect
from linkwork.export.templates import filled
from linkwork.robot import Robot


def package_files(
    robot: Robot,
    dialect: Dialect,
    calls: Sequence[Call],
    free: bool,
    notes: Sequence[str],
    misra: bool,
) -> dict[str, str]:
    """Return the files by their names, with lw for the prefix; misra: with the deviations."""
    told = "\n".join(f"- `lw_{call.name}`: {call.says}" for call in calls)
    noted = "".join(f"- {note}.\n" for note in notes)
    words = {
        "ROBOT_NAME": robot.mechanism.name,
        "LINKWORK_VERSION": version("linkwork"),
        "FUNCTIONS": told,
        "NOTES": f"\nNotes on this robot:\n\n{noted}" if notes else "",
    }
    files = {
        "CMakeLists.txt": "CMakeLists.txt",
        "LW_FILE.pc.in": "pkgconfig.pc.in",
        "README.md": "README.md",
    } | ({"MISRA.md": "MISRA.md"} if misra else {})
    found = {name: filled(piece, dialect, words) for name, piece in files.items()}
    return {**found, "LW_FILE_selftest.c": selftest_text(robot, dialect, calls, free)}
