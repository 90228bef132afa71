"""An MJCF document as its author means it: files included, models attached, defaults
applied, angles and orientations understood.

Source: the MJCF reference of MuJoCo 4, https://mujoco.readthedocs.io (elements, attributes and
their defaults).
"""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import inf, radians
from pathlib import Path

import numpy as np

from linkwork.formats import poses, xml
from linkwork.formats.mjcf.attachments import Attachable, AttachmentWriter, Remark
from linkwork.formats.mjcf.options import MERGE, mode_of
from linkwork.formats.mjcf.presets import joined, of_actuator
from linkwork.formats.mjcf.replicas import ReplicaWriter
from linkwork.formats.xml import Element
from linkwork.mechanism import MechanismError

ORIENTATIONS = ("quat", "axisangle", "euler", "xyaxes", "zaxis")
ACTUATORS = (
    "motor", "general", "position", "velocity", "intvelocity", "orientation", "pid", "damper",
    "cylinder", "muscle", "adhesion", "dcmotor", "plugin",
)  # fmt: skip
EQUALITIES = ("connect", "weld", "joint", "tendon", "flex", "flexstrain", "flexvert")
INCLUDES = 50
MAIN = "main"
OWN = ""  # the scope of what is not attached
MODELS = 8  # attached in one another
TIED = "is left out, as MuJoCo does: it ties a replica to what is none"
OVERRULED = "is left out: the options of the model that it is attached to hold"
UNSET = "is left out: the keyframes of attached models are not read"
CLASSED = ("asset", "tendon", "equality", "actuator")  # whose elements stand in no body


@dataclass(frozen=True)
class Class:
    """Hold a class of defaults: the class that it begins with, and its own settings by kind of
    element, in their order."""

    parent: Class | None = None
    own: dict[str, list[Element]] = field(default_factory=dict)

    def settings(self, kind: str) -> dict[str, str]:
        """Return the attributes of a kind of element, those of the parent first."""
        known = {} if self.parent is None else self.parent.settings(kind)
        for element in self.own.get(kind, ()):
            known = overridden(known, element.attributes)
        return known

    @cached_property
    def actuators(self) -> tuple[Mapping[str, str], ...]:
        """Return the attributes of actuators in this class and those around it, the nearest
        first."""
        states = () if self.parent is None else self.parent.actuators
        known = states[0] if states else {}
        for element in self.own.get("actuator", ()):
            known = of_actuator(element, (known, *states))
        return known, *states


def overridden(known: Mapping[str, str], own: Mapping[str, str]) -> dict[str, str]:
    """Return attributes in place of known ones; an orientation replaces one in another form."""
    if any(form in own for form in ORIENTATIONS):
        known = {key: value for key, value in known.items() if key not in ORIENTATIONS}
    return joined(known, own)


Defaults = dict[str, Class]


@dataclass(frozen=True)
class Compiler:
    """Hold how numbers are to be read.

    Attributes:
        degrees: angles are in degrees.
        euler: order of the axes of Euler angles; small letters turn about the moving axes, capitals
            about the fixed ones.
        autolimits: a range alone makes a limit.
        from_geoms: "true", "false", or "auto" where the geoms give the inertia of bodies without
            <inertial>.
        groups: first and last group of geoms that have mass.
        least_mass, least_inertia: smaller ones of moving bodies are raised to these [kg, kg m^2].
        total_mass: all masses are scaled to this sum, if positive [kg].
        balance: moments of inertia that no rigid body has are replaced by their mean.
        mesh_folder: folder of mesh files, relative to the model's own.
        strip_path: names of files without their folders.
        fit_box: geoms are fitted to the box around a mesh, not to that of equal inertia.
        align_free: frames of free bodies are put into their principal axes.
        fuses: bodies without joints are made part of those that they stand in.
    """

    degrees: bool = True
    euler: str = "xyz"
    autolimits: bool = True
    from_geoms: str = "auto"
    groups: tuple[int, int] = (0, 5)
    least_mass: float = 0.0
    least_inertia: float = 0.0
    total_mass: float = -1.0
    balance: bool = False
    mesh_folder: str = ""
    strip_path: bool = False
    fit_box: bool = False
    align_free: bool = False
    fuses: bool = False

    def angle(self, value: float) -> float:
        """Return an angle of the file in radians."""
        return radians(value) if self.degrees else value

    def euler_rotation(self, angles: np.ndarray) -> np.ndarray:
        """Return the rotation matrix of Euler angles."""
        R = np.eye(3)
        for letter, angle in zip(self.euler, angles, strict=True):
            axis = np.eye(3)["xyz".index(letter.lower())]
            turn = poses.turn(axis, self.angle(angle))[:3, :3]
            R = R @ turn if letter.islower() else turn @ R
        return R

    def updated(self, section: Element) -> Compiler:
        """Return the settings after one <compiler> section."""
        # What MuJoCo does not take any more, and what makes no sense, is refused.
        if section.attributes.get("coordinate", "local") != "local":
            raise section.refusal(
                "coordinate must be 'local'; global coordinates are not part of MJCF any more"
            )
        euler = section.attributes.get("eulerseq", self.euler)
        if len(euler) != 3 or set(euler.lower()) - set("xyz"):
            raise section.refusal(
                f"eulerseq {xml.shortened(euler)} is not three letters of x, y, z"
            )
        low, high = section.numbers("inertiagrouprange", (2,), tuple(map(float, self.groups)))
        # What the section does not say stays as it was.
        return Compiler(
            degrees=section.choice(
                "angle", ("degree", "radian"), "degree" if self.degrees else "radian"
            )
            == "degree",
            euler=euler,
            autolimits=flag(section, "autolimits", self.autolimits),
            from_geoms=section.choice(
                "inertiafromgeom", ("false", "true", "auto"), self.from_geoms
            ),
            groups=(int(low), int(high)),
            least_mass=section.number("boundmass", self.least_mass),
            least_inertia=section.number("boundinertia", self.least_inertia),
            total_mass=section.number("settotalmass", self.total_mass),
            balance=flag(section, "balanceinertia", self.balance),
            mesh_folder=section.attributes.get(
                "meshdir", section.attributes.get("assetdir", self.mesh_folder)
            ),
            strip_path=flag(section, "strippath", self.strip_path),
            fit_box=flag(section, "fitaabb", self.fit_box),
            align_free=flag(section, "alignfree", self.align_free),
            fuses=flag(section, "fusestatic", self.fuses),
        )


def flag(element: Element, name: str, default: bool) -> bool:
    """Return an attribute that is true or false."""
    return element.choice(name, ("true", "false"), "true" if default else "false") == "true"


SWITCHED = {
    "spring": (("joint", "tendon"), "stiffness"),
    "damper": (("joint", "tendon", "actuator"), "damping"),
    "frictionloss": (("joint", "tendon"), "frictionloss"),
}
"""What flags of options switch off: attributes of some kinds of elements."""
CONSTRAINTS = {"equality", "frictionloss", "limit"}  # what the flag `constraint` switches off


@dataclass(frozen=True)
class Document:
    """Hold the root element with all files included, attachments and replicas written out, the
    compilers' settings by scope and the defaults by class.

    remarks: on what was left out of that
    """

    root: Element
    compilers: dict[str, Compiler]
    defaults: Defaults
    remarks: tuple[Remark, ...] = ()

    @classmethod
    def read(
        cls, root: Element, includes: Sequence[Path] = (), around: tuple[Path, ...] = ()
    ) -> Document:
        """Complete a document whose root is <mujoco>.

        Args:
            includes: folders whose files it may include beside those of its own.
            around: files of the models that it is attached to.
        """
        root = _Including(root, includes).complete(root)
        compiler, defaults = Compiler(), {MAIN: Class()}
        for section in root.each("compiler"):
            compiler = compiler.updated(section)
        for section in root.each("default"):
            defaults[section.attributes.get("class", MAIN)] = defaults[MAIN]
            _read_defaults(section, MAIN, defaults)
        document = cls(root, {OWN: compiler}, defaults)
        # Attached models first: they may stand in a replica.
        models = _Models(document, includes, (*around, root.file.resolve()))
        attaching = AttachmentWriter(root, models.opened)
        root = attaching.written()
        writer = ReplicaWriter(document.turned)
        root = writer.written(root)
        tied = [(element, TIED, False) for element in writer.lost]
        return replace(document, root=root, remarks=(*models.remarks, *attaching.remarks, *tied))

    def compiler_of(self, element: Element) -> Compiler:
        """Return the settings of the model that an element comes from."""
        return self.compilers[element.scope]

    @cached_property
    def off(self) -> frozenset[str]:
        """Names of the flags that the options switch off; the last word on each holds."""
        said, states = dict[str, str](), ("enable", "disable")
        for option in self.root.each("option"):
            for switches in option.each("flag"):
                said |= {key: switches.choice(key, states, "") for key in switches.attributes}
        off = {name for name, state in said.items() if state == "disable"}
        return frozenset(off | CONSTRAINTS if "constraint" in off else off)

    @cached_property
    def named(self) -> frozenset[str]:
        """Return whatever the sections beside the bodies say, names of bodies among it."""
        found, left = set(), [part for part in self.root.children if part.tag != "worldbody"]
        while left:
            element = left.pop()
            found |= {*element.attributes.values()}
            left += element.children
        return frozenset(found)

    @property
    def passive(self) -> bool:
        """Whether fluids and gravcomp act: without springs and dampers MuJoCo leaves them out."""
        return not {"spring", "damper"} <= self.off

    def is_limited(self, element: Element, name: str = "range", limited: str = "limited") -> bool:
        """Tell whether a range holds: where nothing says so, one whose ends are in their order."""
        said = element.choice(limited, ("true", "false", "auto"), "auto")
        if said == "false" or name not in element.attributes:
            return False
        if said == "true" or not self.compiler_of(element).autolimits:
            return said == "true"
        low, high = element.numbers(name, (2,), most=inf)
        return low < high

    def turned(self, element: Element, count: int) -> np.ndarray:
        """Return the rotation matrix of so many times an element's Euler angles."""
        angles = element.vector("euler", (0.0, 0.0, 0.0))
        return self.compiler_of(element).euler_rotation(count * np.array(angles))

    def each(self, section: str, *tags: str) -> Iterator[Element]:
        """Yield the elements of some tags in all sections of a name."""
        return (
            element
            for part in self.root.each(section)
            for element in part.children
            if not tags or element.tag in tags
        )

    def resolved(self, element: Element, kind: str, childclass: str = MAIN) -> Element:
        """Return an element with the defaults of its class, or of the class its body gives to its
        children, without what flags switch off.

        Args:
            kind: what defaults call the element; all actuators share one entry, as do all
                equalities and all tendons.
        """
        name = element.attributes.get("class", childclass)
        if name not in self.defaults:
            raise element.refusal(f"there is no default class {xml.shortened(name)}")
        table = self.defaults[name]
        if kind == "actuator":
            attributes = of_actuator(element, table.actuators)
        else:
            attributes = overridden(table.settings(kind), element.attributes)
        for switch, (kinds, attribute) in SWITCHED.items():
            if switch in self.off and kind in kinds:
                attributes.pop(attribute, None)
        if "limit" in self.off and kind in ("joint", "tendon"):
            attributes["limited"] = "false"
        return element.with_attributes(attributes)

    def pose(self, element: Element) -> np.ndarray:
        """Return the pose that pos and one form of orientation give."""
        return poses.pose(element.vector("pos", (0.0, 0.0, 0.0)), self.rotation(element))

    def rotation(self, element: Element) -> np.ndarray:
        """Return the rotation matrix of quat, axisangle, euler, xyaxes or zaxis."""
        # One form at most; none is no turn.
        given = [form for form in ORIENTATIONS if form in element.attributes]
        if len(given) > 1:
            raise element.refusal(
                f"gives its orientation as {' and '.join(given)}; keep one of them"
            )
        if not given:
            return np.eye(3)
        # Directions have a length.
        (form,) = given
        count = {"quat": 4, "axisangle": 4, "euler": 3, "xyaxes": 6, "zaxis": 3}[form]
        numbers = np.array(element.numbers(form, (count,)))
        heads = {
            "quat": [numbers],
            "axisangle": [numbers[:3]],
            "xyaxes": [numbers[:3], numbers[3:]],
            "zaxis": [numbers],
        }
        if any(np.linalg.norm(head) < 1e-12 for head in heads.get(form, [])):
            raise element.refusal(
                f"{form} '{element.attributes[form]}' has no length; give a direction"
            )
        # Each form by its own definition in MuJoCo's reference.
        match form:
            case "quat":
                return poses.from_quaternion(*numbers)
            case "axisangle":
                return poses.turn(
                    poses.unit(numbers[:3]), self.compiler_of(element).angle(numbers[3])
                )[:3, :3]
            case "euler":
                return self.compiler_of(element).euler_rotation(numbers)
            case "zaxis":
                return poses.from_z(numbers)
        # xyaxes: y is taken square to x, as MuJoCo does.
        x, y = poses.unit(numbers[:3]), poses.unit(numbers[3:])
        y = y - (y @ x) * x
        if np.linalg.norm(y) < 1e-12:
            raise element.refusal("xyaxes gives two parallel axes; turn one of them")
        y = poses.unit(y)
        return np.column_stack([x, y, np.cross(x, y)])


def _read_defaults(section: Element, name: str, defaults: Defaults) -> None:
    """Add a class: its own settings first, then its subclasses, which begin with them."""
    table = defaults[name]
    for element in section.children:
        if element.tag != "default":
            kind = "actuator" if element.tag in ACTUATORS else element.tag
            table.own.setdefault(kind, []).append(element)
    for subclass in section.each("default"):
        child = subclass.text("class")
        if child in defaults:
            raise subclass.refusal(f"gives class {xml.shortened(child)} again; keep one of both")
        defaults[child] = Class(table)
        _read_defaults(subclass, child, defaults)


def scoped(element: Element, scope: str, main: str, classes: Container[str]) -> Element:
    """Return an element of an attached model that knows its scope, and its classes by it; main: the
    class of what is in no body and has none."""
    attributes = dict(element.attributes)
    for key in ("class", "childclass"):
        if key in attributes:
            if scope + attributes[key] not in classes:
                raise element.refusal(f"there is no default class {xml.shortened(attributes[key])}")
            attributes[key] = scope + attributes[key]
    if main:
        attributes.setdefault("class", main)
    children = [scoped(child, scope, main, classes) for child in element.children]
    return replace(element, attributes=attributes, children=children, scope=scope + element.scope)


@dataclass
class _Models:
    """Read the models that are attached to a document, which takes over their settings.

    includes, around: as of Document.read
    """

    document: Document
    includes: Sequence[Path]
    around: tuple[Path, ...]
    remarks: list[Remark] = field(default_factory=list)
    count: int = 0

    def opened(self, asset: Element) -> Attachable | None:
        """Return the model that an asset names, or None with a remark where its file is not to be
        opened."""
        name, own = asset.text("file"), self.document.root.file.parent.resolve()
        path = _path_of(asset, name, (own, *(folder.resolve() for folder in self.includes)))
        if path is None:
            self.remarks.append((asset, f"is not read: file {xml.shortened(name)} {OUTSIDE}", True))
            return None
        if path in self.around:
            raise asset.refusal(f"file {xml.shortened(name)} is attached to itself")
        if len(self.around) > MODELS:
            raise asset.refusal(f"more than {MODELS} models are attached in one another")
        try:
            root = xml.read(path)
            if root.tag != "mujoco":
                raise root.refusal("is no MJCF model; attach a file whose root is <mujoco>")
            model = Document.read(root, self.includes, self.around)
        except MechanismError as error:
            raise MechanismError(f"{asset.file}: line {asset.line}: {error}") from None
        return self.taken(model)

    def taken(self, model: Document) -> Attachable:
        """Return a model whose compilers and defaults this document has."""
        # Settings by a scope of their own; mesh files lie beside their own model's.
        self.count += 1
        scope, folder = f"{self.count}/", model.root.file.parent.resolve()
        for inner, compiler in model.compilers.items():
            where = str(folder / compiler.mesh_folder)
            self.document.compilers[scope + inner] = replace(compiler, mesh_folder=where)
        for name, table in model.defaults.items():
            self.document.defaults[scope + name] = table
        # What is not taken over.
        self.remarks += model.remarks
        if mode_of(self.document.root) != MERGE:
            self.remarks += [(each, OVERRULED, False) for each in model.root.each("option")]
        self.remarks += [(keys, UNSET, False) for keys in model.root.each("keyframe")]
        # Bodies give their class to what is in them; all else has one.
        classes, main = self.document.defaults, scope + MAIN
        children = [
            scoped(section, scope, main if section.tag in CLASSED else "", classes)
            for section in model.root.children
        ]
        return Attachable(replace(model.root, children=children, scope=scope), scope + MAIN)


OUTSIDE = (
    "lies outside the model's folder and is not opened; state a folder around both (includes=, "
    "--include-root)"
)


def _path_of(element: Element, name: str, allowed: Sequence[Path]) -> Path | None:
    """Return the path of a file that an element names, or None where it lies outside the folders
    that are allowed; told from the model's own, then from the element's file's, as in MuJoCo."""
    folders = (allowed[0], element.file.parent, *allowed[1:])
    try:
        paths = [(folder / name).resolve() for folder in folders]
    except (OSError, ValueError):
        raise element.refusal(f"file {xml.shortened(name)} is no path") from None
    inside = [path for path in paths if any(path.is_relative_to(folder) for folder in allowed)]
    return next((path for path in inside if path.is_file()), inside[0] if inside else None)


class _Including:
    """Put the contents of files in the place of <include file="...">; they lie in the model's own
    folder, or in one that is stated. What is too much for one file is so for all together."""

    def __init__(self, root: Element, includes: Sequence[Path]):
        self.allowed = (root.file.parent.resolve(), *(folder.resolve() for folder in includes))
        self.seen = {root.file.resolve()}
        self.bytes = self.count = 0

    def complete(self, element: Element, depth: int = 1) -> Element:
        """Return an element with all that it includes; depth: of elements around it, and itself."""
        self.count += 1
        if depth > xml.DEEPEST:
            raise element.refusal(
                f"is nested deeper than {xml.DEEPEST}, with the files that include its own"
            )
        if self.count > xml.MOST:
            raise element.refusal(
                f"comes after more than {xml.MOST} elements of all files; a mechanism has fewer"
            )
        children: list[Element] = []
        for child in element.children:
            if child.tag == "include":
                children += self._included(child, depth)
            else:
                children.append(self.complete(child, depth + 1))
        return replace(element, children=children)

    def _included(self, element: Element, depth: int) -> list[Element]:
        name = element.text("file")
        path = _path_of(element, name, self.allowed)
        if path is None:
            raise element.refusal(f"file {xml.shortened(name)} {OUTSIDE}")
        if path in self.seen:
            raise element.refusal(f"file {xml.shortened(name)} is included twice; include it once")
        if len(self.seen) > INCLUDES:
            raise element.refusal(f"more than {INCLUDES} files are included; that is refused")
        self.seen.add(path)
        try:
            self.bytes += path.stat().st_size if path.is_file() else 0
            if self.bytes > xml.LARGEST:
                raise element.refusal(
                    f"the files included are larger than {xml.LARGEST // 1_000_000} MB together"
                )
            return self.complete(xml.read(path), depth).children
        except MechanismError as error:
            raise MechanismError(f"{element.file}: line {element.line}: {error}") from None
