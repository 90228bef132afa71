"""The models of an SDF file as scopes, with those that it includes from other files."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

from linkwork.formats import xml
from linkwork.formats.notes import Notes
from linkwork.formats.programs import note_program
from linkwork.formats.reading import Reading
from linkwork.formats.sdf.scopes import BETWEEN, PARTS, WORLD, Scope, version_of
from linkwork.formats.xml import Element, shortened
from linkwork.mechanism import MechanismError

DEEPEST = 50  # models inside one another
USUAL = "model.sdf"  # file of a model's folder
MOST = 500  # models that are included
OF_INCLUDES = ("uri", "name", "pose", "static", "placement_frame")
TAKEN = "has the name of a link or a frame, or of the world"
SECOND = "is left out: of a file that is included the first model counts"


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
        for other in list(root.each(WORLD))[1:]:
            self.notes.on(other, "is left out: the first world counts", alters=True)
        scope = Scope(world, world, version=version_of(root))
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
            found = self._included(part) if part.tag == "include" else (part, scope.version)
            if found is None:
                continue
            model, name = _model_of(scope, part, found, named)
            if merge := _merges(part):
                scope.merged.append(model)
            else:
                self._check_free(scope, part, name)
                scope.models[name] = model
            self._fill(model, depth + 1, True)
            if merge:
                self._check_merged(scope, model, part)

    def _apart(self, scope: Scope, part: Element) -> Element:
        """Return a part; a joint that has a link's name, as in old files, or the world's, with
        another one, as libsdformat does it."""
        name = part.text("name")
        taken = name == WORLD or (name in scope.named and scope.named[name].tag != "joint")
        if part.tag == "joint" and taken:
            name = f"{name}_joint"
            self.notes.on(part, f"{TAKEN}, and _joint behind it here")
            part = part.with_attributes({**part.attributes, "name": name})
        self._check_free(scope, part, name)
        return part

    def _check_merged(self, scope: Scope, model: Scope, include: Element) -> None:
        """Refuse parts of a model that become those of another one, which has their names."""
        others = [scope, *(other for other in scope.merged if other is not model)]
        taken = {name for other in others for name in (*other.named, *other.models)}
        for name in (*model.named, *model.models):
            if name in taken:
                raise include.refusal(
                    f"brings {shortened(name)}, and its model has a part of that name; names are "
                    "given once"
                )

    def _check_free(self, scope: Scope, part: Element, name: str) -> None:
        if name in ("", BETWEEN):
            raise part.refusal(f"is called {name!r}, which is no name; give it one")
        if name in scope.named or name in scope.models:
            raise part.refusal("has the name of another part of its model; names are given once")

    def _included(self, include: Element) -> tuple[Element, tuple[int, int]] | None:
        """Return the <model> of another file, and the version of that; None, with a note, where
        there is no such file."""
        # What it says of the model.
        for part in include.children:
            if part.tag == "plugin":
                note_program(part, self.notes)
            elif part.tag not in OF_INCLUDES:
                self.notes.on(part, "is left out: it is not known here", alters=True)
        # Where its file is.
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
        return self._opened(include, _model_file(path, uri) if path.is_dir() else path)

    def _opened(self, include: Element, path: Path) -> tuple[Element, tuple[int, int]]:
        """Return the <model> of a file that is there, and the version of that."""
        try:
            root = xml.read(path)
            if root.tag == "robot":
                target = path.with_suffix(Path(USUAL).suffix).name
                raise root.refusal(f"is URDF; convert it: linkwork convert {path.name} {target}")
            if root.tag != "sdf":
                raise root.refusal("is not the root of an SDF file; that begins with <sdf>")
            for other in list(root.each("model"))[1:]:
                self.notes.on(other, SECOND, alters=True)
            return root.named("model"), version_of(root)
        except MechanismError as error:
            raise MechanismError(f"{include.file}: line {include.line}: {error}") from None


def _merges(part: Element) -> bool:
    """Tell whether the parts of a model that is included count as those of the one around it."""
    return part.tag == "include" and part.attributes.get("merge", "false") in ("true", "1")


def _model_of(
    scope: Scope, part: Element, found: tuple[Element, tuple[int, int]], named: bool
) -> tuple[Scope, str]:
    """Return the scope of a model inside another one, and its name there; what includes it may say
    its name, its pose, and whether it stands still."""
    element, version = found
    name = (part.inner("name") or element).text("name")
    place = part if part.first("pose") else element
    if part is not element and part.first("placement_frame"):
        place = replace(place, children=[*place.children, part.named("placement_frame")])
    stated = part if part.first("static") else element
    path = scope.path if _merges(part) or not named else f"{scope.path}{name}{BETWEEN}"
    still = scope.static or stated.inner_flag("static")
    return Scope(element, place, scope, path, still, version), name


def _model_file(folder: Path, uri: Element) -> Path:
    """Return the SDF file of a model's folder: that of the latest version which its model.config
    names, or model.sdf."""
    config, name = folder / "model.config", USUAL
    if config.is_file():
        try:
            named = [each for each in xml.read(config).each("sdf") if each.content]
            versions = [version_of(each) if "version" in each.attributes else () for each in named]
        except MechanismError as error:
            raise MechanismError(f"{uri.file}: line {uri.line}: {error}") from None
        if named:
            name = max(zip(versions, range(len(named)), named, strict=True))[-1].content
    path = (folder / name).resolve()
    if not path.is_file() or not path.is_relative_to(folder.resolve()):
        raise uri.refusal(f"the folder {str(folder)!r} holds no {name}")
    return path
