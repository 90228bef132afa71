"""Model files turned into others."""

from collections import Counter
from pathlib import Path

from linkwork import formats
from linkwork.cli.catalogue import find, refuse_existing
from linkwork.cli.terminal import console, facts, patience
from linkwork.mechanism import Mechanism


def convert(source: str, target: Path, overwrite: bool) -> None:
    """Read a robot of the catalogue or a model file, write it in another format, and say what was left out."""
    refuse_existing(target, overwrite)
    named = not Path(source).suffix and not Path(source).exists()
    imported = formats.Imported(find(source)) if named else formats.load(source)
    with patience("closing the loops"):
        written = formats.save(imported.mechanism, target)
    out = console()
    out.print(facts(summary(imported.mechanism)))
    for file, notes in ((source, imported.notes), (str(target), written)):
        if notes:
            out.print(f"notes on {file}:", soft_wrap=True)
        for note in notes:
            out.print(f"- {note}", soft_wrap=True)
    out.print(f"{target} written", soft_wrap=True)


def summary(mechanism: Mechanism) -> list[tuple[str, str]]:
    """Return what a mechanism holds, by name and count."""
    kinds = Counter(joint.type for joint in mechanism.joints.values())
    return [
        ("name", mechanism.name),
        ("bodies", str(len(mechanism.bodies))),
        ("joints", ", ".join(f"{count} {kind}" for kind, count in kinds.items()) or "none"),
        ("actuators", ", ".join(mechanism.actuators) or "none"),
    ]
