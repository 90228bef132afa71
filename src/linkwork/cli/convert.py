"""Model files turned into others."""

import warnings
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

from linkwork import formats
from linkwork.cli.catalogue import about, named, refuse_existing
from linkwork.cli.source import Source
from linkwork.cli.terminal import console, facts, patience, show_json
from linkwork.equations import derive
from linkwork.errors import ModelWarning
from linkwork.mechanism import Mechanism, MechanismError


def convert(
    source: Source,
    target: Path,
    loops: Literal["inside", "beside"],
    overwrite: bool,
    as_json: bool,
) -> None:
    """Read a robot of the catalogue or a model file, write it in another format, and say what was
    left out."""
    files = [target, target.with_suffix(".yaml")] if loops == "beside" else [target]
    for file in files:
        refuse_existing(file, overwrite)
    with patience("reading the model"):
        imported = read(source)
    with patience("closing the loops"):
        if target.suffix.lower() in formats.OPEN:
            warn_of_none(imported.mechanism)
        written = formats.save(imported.mechanism, target, loops=loops)
    if as_json:
        found = {"notes": imported.notes, "left_out": written, "written": files}
        show_json(counts(imported.mechanism) | found)
        return
    out = console()
    out.print(facts(summary(imported.mechanism)))
    for file, notes in ((source.name, imported.notes), (str(target), written)):
        if notes:
            out.print(f"notes on {file}:", soft_wrap=True)
        for note in notes:
            out.print(f"- {note}", soft_wrap=True)
    out.print(f"{', '.join(map(str, files))} written", soft_wrap=True)


def warn_of_none(mechanism: Mechanism) -> None:
    """Warn of a mechanism of which no robot is made: its loops do not close, or nothing moves."""
    try:
        derive(mechanism)
    except MechanismError as refusal:
        warnings.warn(
            f"{mechanism.name}: no robot is made of it: {refusal}", ModelWarning, stacklevel=2
        )


def read(source: Source) -> formats.Imported:
    """Read a robot of the catalogue or a model file, about the reference that is asked for."""
    known = not Path(source.name).suffix and not Path(source.name).exists()
    how = source.reading
    imported = (
        formats.Imported(named(source.name, how))
        if known
        else formats.load(source.name, None, how.floating, how.packages, how.merging, how.includes)
    )
    return replace(imported, mechanism=about(imported.mechanism, source))


def counts(mechanism: Mechanism) -> dict[str, Any]:
    """Return what a mechanism holds, as data."""
    kinds = Counter(joint.type for joint in mechanism.joints.values())
    return {
        "name": mechanism.name,
        "bodies": len(mechanism.bodies),
        "joints": dict(kinds),
        "actuators": list(mechanism.actuators),
    }


def summary(mechanism: Mechanism) -> list[tuple[str, str]]:
    """Return what a mechanism holds, by name and count."""
    found = counts(mechanism)
    kinds = ", ".join(f"{count} {kind}" for kind, count in found["joints"].items())
    return [
        ("name", found["name"]),
        ("bodies", str(found["bodies"])),
        ("joints", kinds or "none"),
        ("actuators", ", ".join(found["actuators"]) or "none"),
    ]
