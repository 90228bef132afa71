"""Meshes that URDF and SDF show: in files of a kind that is read, and not scaled to nothing."""

from __future__ import annotations

from pathlib import Path

from linkwork.formats.notes import Notes
from linkwork.formats.xml import Element
from linkwork.solids.mesh_files import SUFFIXES


def can_be_shown(visual: Element, path: Path, scale: tuple[float, ...], notes: Notes) -> bool:
    """Tell whether the mesh of a <visual> whose file is there can be shown; note why not."""
    if path.suffix.lower() not in SUFFIXES:
        kind = path.suffix or "without a suffix"
        notes.on(visual, f"is not shown: meshes are {', '.join(SUFFIXES)} here, not {kind}")
        return False
    if not path.stat().st_size:
        notes.on(visual, "is not shown: its mesh's file is empty")
        return False
    if 0 in scale:
        notes.on(visual, "is not shown: its mesh has a scale of 0")
        return False
    return True
