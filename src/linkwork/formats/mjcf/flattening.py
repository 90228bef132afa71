"""What no reader here writes out, flattened by MuJoCo itself where it is installed: <composite>, an
<attach> of the model's own parts, and meshes that MuJoCo makes (builtin).

MuJoCo's MjSpec saves the file as its author has it, with these written out in place: every number
to its last digit, paths, classes and units as they are (savecompiled and savecanonical off, which
MuJoCo knows from 3.16 on). It compiles the file before, so that files that it names must be there.
MuJoCo 4 has no <composite> any more.

Source: the MJCF reference of MuJoCo 4, https://mujoco.readthedocs.io (compiler; body/attach;
mesh, builtin), and of MuJoCo 3.17 (body/composite).
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field
from math import prod
from pathlib import Path
from typing import Any

from linkwork import checks
from linkwork.errors import LinkworkError
from linkwork.formats import xml
from linkwork.formats.mjcf.attachments import ATTACH
from linkwork.formats.mjcf.document import Document
from linkwork.formats.mjcf.replicas import every
from linkwork.formats.notes import Notes
from linkwork.formats.xml import Element

COMPOSITE, FLEXIBLE = "composite", "flexcomp"
PARTS = 8  # elements that a composite has for one of its count, at most
REASON = 200  # letters of MuJoCo's own
KNOWING = "mujoco>=3.16"
LAST = "mujoco>=3.16,<4"  # those that know <composite> as well


def made(document: Document) -> list[Element]:
    """Return the elements that MuJoCo may write out; none where something else stays that is no
    part of a mechanism (flexcomp), or where other models are attached, whose settings MuJoCo does
    not save."""
    world = [part for section in document.root.each("worldbody") for part in every(section)]
    whole = [part for section in document.root.children for part in every(section)]
    if any(part.tag == FLEXIBLE for part in world) or [*document.each("asset", "model")]:
        return []
    used = {part.attributes.get("mesh") for part in whole if part.tag == "geom"}
    meshes = (
        mesh
        for mesh in document.each("asset", "mesh")
        if "builtin" in mesh.attributes and mesh.attributes.get("name") in used
    )
    return [*(part for part in world if part.tag in (COMPOSITE, ATTACH)), *meshes]


def flattened(document: Document, makers: list[Element], notes: Notes) -> Document:
    """Return a document with these elements written out by MuJoCo, and note that.

    Raises:
        LinkworkError: half a sentence on why it is not done, and what would do it.
    """
    composite = any(maker.tag == COMPOSITE for maker in makers)
    needed = f"writes it out while the file is read: pip install '{LAST if composite else KNOWING}'"
    mujoco = checks.imported("mujoco", f"MuJoCo, which is not installed, {needed}")
    version = f"MuJoCo {mujoco.__version__}"
    if composite and int(mujoco.__version__.split(".")[0]) > 3:
        raise LinkworkError(f"{version} has no composite any more; one before it {needed}")
    if _Size().of(document.root) > xml.MOST:
        raise LinkworkError(f"written out, the file has more than {xml.MOST} elements")
    try:
        text = _saved(mujoco, document.root.file)
    except AttributeError:
        raise LinkworkError(f"{version} is too old; a later one {needed}") from None
    except (ValueError, RuntimeError, mujoco.FatalError) as error:
        reason = " ".join(str(error).split())[:REASON]
        raise LinkworkError(f"{version} refuses the file: {reason}") from None
    for maker in makers:
        notes.on(
            maker,
            f"is written out by {version} (MjSpec); what that saves is read in place of the file, "
            "so that other remarks name no lines",
        )
    saved = xml.parsed(text.encode(), document.root.file, lined=False)
    return Document.read(saved.with_attributes(document.root.attributes))


def _saved(mujoco: Any, path: Path) -> str:
    """Return the text that MuJoCo saves of a file; what it warns of is told by the reader."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        spec = mujoco.MjSpec.from_file(str(path))
        spec.compiler.savecompiled = spec.compiler.savecanonical = False
        return spec.to_xml()


@dataclass
class _Size:
    """Count the elements that a document has once it is written out, or more: what an <attach>
    names and is not closed yet counts as all before it."""

    count: int = 0
    closed: dict[str, int] = field(default_factory=dict)

    def of(self, element: Element) -> int:
        """Return the count after an element and all in it."""
        before = self.count
        self.count += 1
        if element.tag == ATTACH:
            target = element.attributes.get("body", element.attributes.get("frame", ""))
            self.count += self.closed.get(target, self.count)
        elif element.tag == COMPOSITE:
            self.count += PARTS * int(prod(element.numbers("count", (1, 2, 3), (1.0,))))
        for child in element.children:
            if self.count <= xml.MOST:
                self.of(child)
        self.closed[element.attributes.get("name", "")] = self.count - before
        return self.count
