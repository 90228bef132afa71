"""Programs that model files name (`plugin`), which are not run: those by their name that act on the
motion are told apart from those that see, steer and show."""

from __future__ import annotations

from linkwork.formats.notes import Notes
from linkwork.formats.xml import Element

ACTING = ("buoyancy", "hydrodynamics", "lift", "wind", "detachable", "mimic", "disablelink")
"""Words in the names of programs that push bodies, tie them or set them free, whoever steers."""


def note_program(plugin: Element, notes: Notes, done: bool = False) -> None:
    """Note a program that is left out; done: what it does is read elsewhere in the file."""
    said = "".join(plugin.attributes.get(key, "") for key in ("filename", "name")).lower()
    word = next((w for w in ACTING if w in said.replace("_", "").replace("-", "")), None)
    if word is None or done:
        notes.on(plugin, "is left out: it is a program")
        return
    remark = f"is left out: it is a program, which acts on the motion by its name ({word!r})"
    notes.on(plugin, remark, alters=True)
