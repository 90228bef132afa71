"""The models of an SDF file as scopes, with those that it includes from other files."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

from linkwork.formats import xml
from linkwork.formats.notes import Notes
from linkwork.formats.reading import Reading
from linkwork.formats.sdf.scopes import BETWEEN, PARTS, WORLD, Scope
from linkwork.formats.xml import Element, shortened
from linkwork.mechanism import MechanismError

DEEPEST = 50  # models inside one another
MOST = 500  # models that are included


@dataclass
class ScopeReader:
    """Read models as scopes; `count` of them were included, and for others, which are left out,
    nothing is there: refusals of theirs say where it is looked for."""

    reading: Reading
    notes: Notes
    count: int = 0
    absent: list[MechanismError] = field(default_factory=list)

    def top(self, root: Element) -> Scope:
        """Return the scope of the file's first world, or that of its models."""
        world = root.first(WORLD) or replace(root, tag=WORLD)
        scope = Scope(world, world)
        alone = sum(1 for _ in world.each("model", "include")) == 1
        self._fill(scope, 1, not alone)
        return scope

    def _fill(self, scope: Scope, depth: int, named: bool) -> None:
        """Read what a scope holds; `named`: whether its models' names stand before their links'."""
        if depth > DEEPEST:
            raise scope.element.refusal(f"is nested deeper than {DEEPEST} models")
        for tag in PARTS:
            for part in scope.element.each(tag):
                part = self._apart(scope, part)
                scope.named[part.text("name")] = part
        for part in scope.element.each("model", "include"):
            included = part.tag == "include"
            element = self._included(part) if included else part
            if element is None:
                continue
            name = (part.inner("name") or element).text("name")
            merge = included and part.attributes.get("merge", "false") in ("true", "1")
            place = part if included and part.first("pose") else element
            if included and part.first("placement_frame"):
                place = replace(place, children=[*place.children, part.named("placement_frame")])
            model = Scope(
                element,
                place,
                scope,
                scope.path if merge or not named else f"{scope.path}{name}{BETWEEN}",
                scope.static or element.inner_flag("static") or part.inner_flag("static"),
            )
            if merge:
                scope.merged.append(model)
            else:
                self._check_free(scope, part, name)
                scope.models[name] = model
            self._fill(model, depth + 1, True)

    def _apart(self, scope: Scope, part: Element) -> Element:
        """Return a part; a joint that has a link's name, as in old files, with another one, as
        libsdformat does it."""
        name = part.text("name")
        if part.tag == "joint" and name in scope.named and scope.named[name].tag != "joint":
            name = f"{name}_joint"
            self.notes.on(part, "has the name of a link or a frame, and _joint behind it here")
            part = part.with_attributes({**part.attributes, "name": name})
        self._check_free(scope, part, name)
        return part

    def _check_free(self, scope: Scope, part: Element, name: str) -> None:
        if name in scope.named or name in scope.models:
            raise part.refusal("has the name of another part of its model; names are given once")

    def _included(self, include: Element) -> Element | None:
        """Return the <model> of another file; None, with a note, where there is no such file."""
        uri = include.inner("uri")
        if uri is None:
            raise include.refusal("holds no <uri>; add one")
        self.count += 1
        if self.count > MOST:
            raise include.refusal(f"comes after more than {MOST} others; that is refused")
        try:
            path = self.reading.found(uri.text("uri"), uri)
        except MechanismError as error:
            self.absent.append(error)
            self.notes.on(
                include,
                f"is left out: {shortened(uri.text('uri'))} is not there; state the folder that "
                "holds it (packages=, --package-path)",
                alters=True,
            )
            return None
        try:
            root = xml.read(_model_file(path, uri) if path.is_dir() else path)
            if root.tag != "sdf":
                raise root.refusal("is not the root of an SDF file; that begins with <sdf>")
            return root.named("model")
        except MechanismError as error:
            raise MechanismError(f"{include.file}: line {include.line}: {error}") from None


def _model_file(folder: Path, uri: Element) -> Path:
    """Return the SDF file of a model's folder: the last that its model.config names, or
    model.sdf."""
    config = folder / "model.config"
    names = ["model.sdf"]
    if config.is_file():
        names = [each.content for each in xml.read(config).each("sdf") if each.content] or names
    path = (folder / names[-1]).resolve()
    if not path.is_file() or not path.is_relative_to(folder.resolve()):
        raise uri.refusal(f"the folder {str(folder)!r} holds no {names[-1]}")
    return path
