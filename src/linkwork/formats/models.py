"""Model files by suffix and root element: which reader or writer a file needs."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Literal

from linkwork.checks import among, file_path, needed, shown
from linkwork.errors import LinkworkError, ModelWarning
from linkwork.formats import xml
from linkwork.formats.floating import floated
from linkwork.formats.notes import Notes
from linkwork.formats.reading import PLAIN, Paths, Reading
from linkwork.formats.references import Reference, referred
from linkwork.mechanism import Mechanism, MechanismError
from linkwork.mechanism.files import NATIVE as NATIVE
from linkwork.mechanism.record import swapped
from linkwork.patience import announced


@dataclass(frozen=True)
class Format:
    """Describe a format of model files.

    Attributes:
        name: what it is called.
        suffixes: of its files.
        root: its root element, by which it is known.
        module: the module that has `read(root, notes, reading)` and `write(mechanism, path)`.
        closed: whether it is written at home, where loops are closed, so that what has no home is
            refused.
    """

    name: str
    suffixes: tuple[str, ...]
    root: str
    module: str
    closed: bool = True

    def opened(self) -> ModuleType:
        """Import and return the module."""
        return import_module(self.module)


FORMATS = (
    Format("MJCF", (".xml", ".mjcf"), "mujoco", "linkwork.formats.mjcf"),
    Format("URDF", (".urdf",), "robot", "linkwork.formats.urdf", closed=False),
    Format("SDF", (".sdf", ".world"), "sdf", "linkwork.formats.sdf"),
)
MODELS = tuple(suffix for form in FORMATS for suffix in form.suffixes)
READ = (*NATIVE, *MODELS)
OPEN = (*NATIVE, *(s for form in FORMATS if not form.closed for s in form.suffixes))
MACROS = ".xacro"


@dataclass(frozen=True)
class Imported:
    """Hold a mechanism read from a file, and sentences on what was left out, taken otherwise or
    decided.

    Those by which it moves otherwise than the file says are also the mechanism's `caveats`, and
    stay with it.
    """

    mechanism: Mechanism
    notes: tuple[str, ...] = ()


def load(
    path: str | Path,
    reference: Reference | None = None,
    floating: bool = False,
    packages: Paths = (),
    merging: bool = True,
    includes: Paths = (),
) -> Imported:
    """Read a mechanism from a model file.

    Args:
        path: .yaml or .yml, the native format; .xml, .mjcf, .urdf, .sdf or .world, MJCF, URDF or
            SDF as the root element says.
        reference: joint coordinates from which the loops are closed, by name, in place of the
            file's own: numbers [m, rad], text such as "40 deg" or "12 mm", or a YAML or JSON file
            of them; URDF has none, so that a linkage that is drawn in a line needs them.
        floating: let the body that the file fixes to ground, for URDF the root link, move freely,
            by a free joint `floating_base`.
        packages: folders in which package://NAME/... and model://NAME/... are looked for, beside
            those around the file that are called NAME; also one text, as in ROS_PACKAGE_PATH.
        merging: make one spherical joint of three hinges that meet but for 0.1 mm and links of
            10 mg, where robot.yaml closes loops; what that leaves out is a caveat.
        includes: folders whose files the model file may include (MJCF), beside those of its own.

    Returns:
        The mechanism, and notes: sentences, each with its place, on what the mechanism does not
            hold of the file.

    Raises:
        MechanismError: one sentence that names file, line and element; also for XML with a document
            type or entities, files larger than 20 MB, and files that include others from outside
            their folder; nothing or more than one body is fixed to ground where it is to float.
        LinkworkError: a folder of packages that is not there.

    Warns:
        ModelWarning: each of the mechanism's caveats.
    """
    imported = read(path, Reading.asked(floating, packages, merging, includes))
    warn(imported.mechanism, stacklevel=3)
    return replace(imported, mechanism=referred(imported.mechanism, reference))


def warn(mechanism: Mechanism, stacklevel: int) -> None:
    """Warn of a mechanism's caveats, as of the caller so many levels above."""
    for caveat in mechanism.caveats:
        warnings.warn(caveat, ModelWarning, stacklevel)


def read(path: str | Path, reading: Reading = PLAIN) -> Imported:
    """Read a mechanism from a model file as `load` does, without warnings."""
    path = file_path(path, "the path of a model file")
    with announced(f"reading {path.name}"):
        return _read(path, reading)


def _read(path: Path, reading: Reading) -> Imported:
    suffix = path.suffix.lower()
    # The native format, and what is none that can be read.
    if suffix in NATIVE:
        mechanism, notes = Mechanism.load(path), Notes()
        if reading.floating:
            mechanism = floated(mechanism, path.name, notes)
        return Imported(mechanism, (*notes.sentences(), *mechanism.caveats))
    if suffix == MACROS:
        raise MechanismError(
            f"{path}: holds macros; expand the file first: xacro {path.name} > robot.urdf"
        )
    if suffix not in READ:
        raise MechanismError(f"{path}: a model file ends in {', '.join(READ)}, not {suffix!r}")
    # XML, by its root element.
    root, notes = xml.read(path), Notes()
    form = next((form for form in FORMATS if form.root == root.tag), None)
    if form is None:
        first, *others = FORMATS
        known = [
            f"{first.name} begins with <{first.root}>",
            *(f"{form.name} with <{form.root}>" for form in others),
        ]
        raise root.refusal(f"is not the root of a model known here; {', '.join(known)}")
    mechanism = form.opened().read(root, notes, reading)
    if reading.floating:
        mechanism = floated(mechanism, path.name, notes)
    # What its reference, its masses and its springs make of the motion.
    from linkwork.equations.reference import described
    from linkwork.formats.meeting_ends import tell_of_ends
    from linkwork.formats.weightless import tell

    try:
        described(mechanism)
    except MechanismError as refusal:  # of the reference, which another may replace
        notes.say(f"{path.name}: {refusal}", alters=True)
    else:
        tell(mechanism, path.name, notes)
        tell_of_ends(mechanism, path.name, notes)
    return Imported(swapped(mechanism, caveats=notes.caveats()), notes.sentences())


def save(
    mechanism: Mechanism, path: str | Path, *, loops: Literal["inside", "beside"] = "inside"
) -> tuple[str, ...]:
    """Write a mechanism as a model file, replacing one of that name.

    Args:
        mechanism: what is written; for MJCF and SDF its loops are closed first, from its reference.
        path: .yaml or .yml, the native format; .xml or .mjcf, MJCF; .urdf, URDF with loops;
            .sdf or .world, SDF.
        loops: of URDF: "inside" the file as <loop> and <constraint>, or "beside" it, in a file of
            its name that ends in .yaml, as LAAS's example-parallel-robots have them.

    Returns:
        Notes: sentences on what the file does not hold or others take otherwise.

    Raises:
        MechanismError: the suffix is another, the format cannot hold the mechanism, or the file
            cannot be written.
    """
    needed(mechanism, Mechanism)
    path = file_path(path, "the path of a model file")
    suffix = path.suffix.lower()
    if not among(loops, ("inside", "beside")):
        raise LinkworkError(f'loops is {shown(loops)}; give "inside" or "beside"')
    if loops == "beside" and suffix != ".urdf":
        raise LinkworkError(
            f"{path}: loops stand beside URDF alone; name a file that ends in .urdf, or leave the "
            "loops inside"
        )
    if suffix in NATIVE:
        mechanism.save(path)
        return ()
    form = next((form for form in FORMATS if suffix in form.suffixes), None)
    if form is None:
        raise MechanismError(f"{path}: a model is written as {', '.join(READ)}, not {suffix!r}")
    beside = {"beside": True} if loops == "beside" else {}
    return form.opened().write(mechanism, path, **beside)
