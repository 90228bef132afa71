"""A robot as a Functional Mock-up Unit: one file that simulation tools import, for model exchange
and co-simulation."""

from __future__ import annotations

import hashlib
import io
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from linkwork import checks
from linkwork.control.drives import Drive
from linkwork.errors import LinkworkError
from linkwork.export.fmi.binaries import PLATFORMS, binary, chosen
from linkwork.export.fmi.description import Version, build_description, described, source_names
from linkwork.export.fmi.driven import Driven
from linkwork.export.fmi.source import TOKEN, abilities, sources
from linkwork.export.fmi.variables import kinds_of, variables
from linkwork.export.identifiers import given_prefix, named, prefix
from linkwork.export.notes import drives_left_out
from linkwork.patience import announced
from linkwork.robot import Robot

DATE = (1980, 1, 1, 0, 0, 0)  # of all files: the same robot gives the same bytes
VERSIONS = ("3.0", "2.0")


@dataclass(frozen=True)
class FmuExport:
    """Hold an FMU.

    name: its model identifier; version: of FMI
    files: their contents, by their paths in the FMU
    variables: names of its variables in the order of their value references
    platforms: that it has binaries for; notes: sentences on what was left out or mapped
    """

    name: str
    version: str
    files: Mapping[str, bytes]
    variables: tuple[str, ...]
    platforms: tuple[str, ...]
    notes: tuple[str, ...]

    @property
    def content(self) -> bytes:
        """The FMU's bytes: the same for the same robot."""
        held = io.BytesIO()
        with zipfile.ZipFile(held, "w", zipfile.ZIP_DEFLATED) as packed:
            for path, content in self.files.items():
                entry = zipfile.ZipInfo(path, DATE)
                entry.compress_type = zipfile.ZIP_DEFLATED
                entry.external_attr = 0o644 << 16
                packed.writestr(entry, content)
        return held.getvalue()

    def write(self, file: str | Path) -> Path:
        """Write the FMU; return its path.

        Raises:
            LinkworkError: a name that does not end in .fmu, or a file that cannot be written.
        """
        place = checks.file_path(file, "the file")
        if place.suffix.lower() != ".fmu":
            raise LinkworkError(f"{place}: an FMU ends in .fmu, not {place.suffix!r}")
        with checks.writing_to(place, "file"):
            place.write_bytes(self.content)
        return place

    def __repr__(self) -> str:
        built = ", ".join(self.platforms) or "sources alone"
        return f"FmuExport({self.name!r}: FMI {self.version}, {built})"


def fmu(
    robot: Robot,
    version: Version = "3.0",
    *,
    outputs: Sequence[str] | None = None,
    platforms: Sequence[str] | None = None,
    drives: Mapping[str, Drive] | None = None,
    name: str | None = None,
) -> FmuExport:
    """Write a robot as a Functional Mock-up Unit, for model exchange and for co-simulation.

    Inputs are the forces of the actuators, or the commands of drives; parameters are the robot's
    free numbers (tunable) and where a motion begins; states are the coordinates and rates of the
    joints of the spanning tree, and those of drives.

    Args:
        robot: the robot; what is free of it (`Robot.free`) can be tuned.
        version: of FMI, "3.0" or "2.0".
        outputs: what is told: some of "positions", "rates", "accelerations" (of all joints), "tool"
            (its pose), "twist" (of the tool), "reactions" (the wrenches in all joints, in the
            ground's axes about the origins of the first frames), "closure" (the largest gap of the
            loops); positions, rates, tool and closure if left out.
        platforms: that binaries are built for: some of "x86_64-linux", "aarch64-linux",
            "x86_64-windows"; all that a compiler is found for if left out. () gives sources alone.
        drives: by actuator, as for `Robot.simulate`: part of the FMU, whose inputs are their
            commands; `robot.drives` are those of the description.
        name: the model identifier; made of the robot's name if left out.

    Returns:
        An `FmuExport`: `write(file)`, and `notes` on what was left out.

    Raises:
        LinkworkError: a robot with friction that sticks by bristles or of bearings, an output that
            it cannot tell, a drive that reads turns which it does not know, a platform without a
            compiler, or another choice that there is not.
    """
    checks.needed(robot, Robot)
    if not checks.among(version, VERSIONS):
        raise LinkworkError(f'version is {checks.shown(version)}; give "3.0" or "2.0"')
    own = prefix(robot.mechanism.name) if name is None else given_prefix(name)
    kinds = kinds_of(robot, outputs)
    compilers, notes = chosen(platforms)
    # What it is made of, with a token of all of it.
    with announced(f"writing the equations of {robot.mechanism.name} for an FMU"):
        driven = Driven.of(robot, drives)
        can = abilities(driven)
        known = variables(driven, kinds, can.by_tree, can.by_tool)
        written = sources(driven, version, known, can, kinds)
    texts = {named(path, own): named(text, own) for path, text in written.items()}
    whole = described(robot, own, TOKEN, version, known).decode() + "".join(texts.values())
    token = guid(whole)
    texts = {path: text.replace(TOKEN, token) for path, text in texts.items()}
    # The files.
    files = {"modelDescription.xml": described(robot, own, token, version, known)}
    for place, command in compilers.items():
        folder = place if version == "3.0" else PLATFORMS[place].fmi2
        library = binary(place, command, texts, source_names(own, version))
        files[f"binaries/{folder}/{own}{PLATFORMS[place].suffix}"] = library
    if version == "3.0":
        files["sources/buildDescription.xml"] = build_description(own)
    files |= {f"sources/{path}": text.encode() for path, text in texts.items()}
    notes += [*can.notes, *known.notes]
    notes += [] if drives else drives_left_out(robot, "the FMU", "its inputs")
    notes += wrapped(robot, kinds)
    return FmuExport(
        own, version, files, tuple(each.name for each in known.all), tuple(compilers), tuple(notes)
    )


def guid(text: str) -> str:
    """Return a token of a text, in the form of a GUID."""
    digest = hashlib.sha256(text.encode()).hexdigest()
    return (
        "{"
        + "-".join(digest[a:b] for a, b in ((0, 8), (8, 12), (12, 16), (16, 20), (20, 32)))
        + "}"
    )


def wrapped(robot: Robot, kinds: Sequence[str]) -> list[str]:
    """Return sentences on coordinates that are read off others, which leave whole turns and signs
    open."""
    tree = robot.equations.tree.coordinates
    read = [name for name in robot.coordinates if "positions" in kinds and name not in tree]
    told = {
        unit: ", ".join(name for name in read if robot.unit(name) == unit) for unit in ("rad", "1")
    }
    said = {
        "rad": f"the angles {told['rad']} of joints that close loops are told within a turn",
        "1": f"the quaternions {told['1']} of joints that close loops are told but for their sign",
    }
    return [said[unit] for unit, names in told.items() if names]
