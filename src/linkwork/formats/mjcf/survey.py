"""What an MJCF document says that is not read: every element and attribute without an effect here
is named.

Three kinds of attributes: read (in the readers), without an effect on the motion (how things look,
how MuJoCo solves), and all others, which are noted. The same holds for elements.
"""

from __future__ import annotations

from linkwork.formats.mjcf.document import ACTUATORS, EQUALITIES, ORIENTATIONS, Document
from linkwork.formats.notes import Notes
from linkwork.formats.xml import Element

POSE = {"pos", *ORIENTATIONS}
COMMON = {"name", "class", "group", "user", "rgba", "material"}

READ_SECTIONS = {
    "compiler",
    "option",
    "default",
    "worldbody",
    "equality",
    "tendon",
    "actuator",
    "keyframe",
}
SILENT_SECTIONS = {"asset", "visual", "statistic", "size", "custom"}
SECTIONS = {
    "contact": "is left out: contacts are no part of a mechanism",
    "sensor": "is left out: sensors do not act on the motion",
    "deformable": "is left out: bodies are rigid here",
    "extension": "is left out: plugins are not run",
}
BODY_ELEMENTS = {"body", "frame", "joint", "freejoint", "geom", "site", "inertial"}
SILENT_ELEMENTS = {
    "camera",
    "light",
    "flag",
    "texture",
    "material",
    "mesh",
    "pair",
    "lengthrange",
    "layer",
}

OFF = "actuatorgroupdisable"
GROUPS_OFF = (
    "switches off actuators of some groups, which is left out: take these out of the file instead"
)
UNDRIVEN = "switches actuators off, which is left out: the forces are yours"
MAKERS = ("composite", "attach", "flexcomp")
"""Elements of bodies by which MuJoCo's compiler makes others."""
SOFT = (
    "is soft, and bodies are rigid here; put bodies with joints and springs in its place, or take "
    "it out"
)
UNMADE = (
    "makes bodies, joints and sites that are not read; write them out first, as "
    "MuJoCo's own compiler saves them (MjSpec.to_xml, mj_saveLastXML)"
)

SOLVING = {
    "solreflimit",
    "solimplimit",
    "solreffriction",
    "solimpfriction",
    "margin",
    "solref",
    "solimp",
}
JOINT = {
    "type", "pos", "axis", "ref", "range", "limited", "stiffness", "springref", "damping",
    "frictionloss", "armature", "actuatorfrcrange", "actuatorfrclimited", "springdamper",
    "actuatorgravcomp",
}  # fmt: skip
GEOM = {
    "type", "size", "fromto", "mass", "density", "mesh", "hfield", "shellinertia", "contype",
    "conaffinity", "condim", "priority", "friction", "solmix", "gap", "fitscale", "castshadow",
    "surfacevel", "adhesion", "fluidshape", "fluidcoef",
}  # fmt: skip
TENDON = {
    "actuatorfrcrange", "actuatorfrclimited", "stiffness", "damping", "springlength", "limited",
    "range", "frictionloss", "armature",
}  # fmt: skip
DRIVE = {
    "joint", "jointinparent", "tendon", "body", "site", "refsite", "slidersite", "cranksite",
    "gear", "ctrllimited", "forcelimited", "actlimited", "lengthrange", "cranklength", "interp",
    "ctrlrange", "forcerange", "actrange", "inheritrange", "area", "diameter", "bias", "armature",
    "damping", "nsample",
}  # fmt: skip

ATTRIBUTES: dict[str, set[str]] = {
    "compiler": {
        "angle", "autolimits", "coordinate", "eulerseq", "inertiafromgeom", "inertiagrouprange",
        "boundmass", "boundinertia", "settotalmass", "balanceinertia", "meshdir", "texturedir",
        "assetdir", "strippath", "discardvisual", "usethread", "fitaabb", "fusestatic",
        "saveinertial", "convexhull", "exactmeshinertia", "savecanonical", "savecompiled",
        "passthrough", "conflict", "alignfree",
    },
    "option": {
        "gravity", "collision",
        "timestep", "integrator", "solver", "iterations", "tolerance", "ls_iterations",
        "ls_tolerance", "noslip_iterations", "noslip_tolerance", "ccd_iterations", "ccd_tolerance",
        "cone", "jacobian", "impratio", "apirate", "magnetic", "o_margin", "o_solref", "o_solimp",
        "o_friction", "sdf_iterations", "sdf_initpoints",
        OFF, "sleep_tolerance", "density", "viscosity", "wind",
    },
    "body": POSE | {"childclass", "fuse", "sleep", "simple", "gravcomp"},
    "worldbody": POSE | {"childclass"},
    "frame": POSE | {"childclass"},
    "inertial": POSE | {"mass", "diaginertia", "fullinertia"},
    "joint": JOINT | SOLVING,
    "freejoint": {"align"},
    "geom": POSE | GEOM | SOLVING,
    "site": POSE | {"type", "size", "fromto", "mesh"},
    "connect": {"active", "body1", "body2", "anchor", "site1", "site2"} | SOLVING,
    "weld": SOLVING
    | {"active", "body1", "body2", "anchor", "relpose", "torquescale", "site1", "site2"},
    "spatial": TENDON | {"width"} | SOLVING,
    "fixed": TENDON | SOLVING,
    "key": {"time", "qpos", "qvel", "act", "ctrl", "mpos", "mquat"},
    "default": set(),
}  # fmt: skip
ATTRIBUTES["tendon"] = ATTRIBUTES["spatial"]
EQUALITY = {"active", "joint1", "joint2", "tendon1", "tendon2", "polycoef"} | SOLVING
SERVO = {
    "kp",
    "kv",
    "ki",
    "dampratio",
    "timeconst",
    "gainprm",
    "biasprm",
    "gaintype",
    "biastype",
    "dyntype",
    "dynprm",
    "actdim",
    *("input", "imax", "slewmax", "posrange", "velrange", "ffrange"),
    *("motorconst", "resistance", "nominal", "inductance", "thermal", "saturation", "cogging"),
    *("lugre", "controller"),
    *("range", "tausmooth", "force", "scale", "lmin", "lmax", "vmax", "fpmax", "fvmax"),
}

CONSEQUENCES = {
    ("body", "mocap"): "the body is fixed in the world, where the keyframe 'home' or it says",
    ("joint", "springyield"): "springs do not yield",
    ("actuator", "delay"): "drives act at once",
}
NOTHING = {"0", "false", "none", "auto", ""}
# Elements whose unread attributes move nothing.
UNFELT = (
    "actuator",
    "default",
    "geom",
    "key",
    "keyframe",
    "site",
)
# Attributes of that kind.
BOUNDS = (
    "range",
    "actuatorfrcrange",
    "actuatorfrclimited",
    "mocap",
)


RANGES = {"range", "ctrlrange", "forcerange", "actrange", "actuatorfrcrange"}
OUT_OF_ORDER = "no limit, here as in MuJoCo, for the lower end is above the upper one"


NAMED = {
    "asset": "mesh", "tendon": "tendon", "equality": "equality", "actuator": "actuator",
    "keyframe": "key",
}  # fmt: skip
"""Sections whose elements have names of their own, with what is called so there."""


def require_names(document: Document) -> None:
    """Refuse names that two elements of one kind have, as MuJoCo does, where they bear on the
    motion; those of bodies, joints and sites are looked at where these are read."""
    seen: set[tuple[str, str]] = set()

    def once(element: Element, kind: str) -> None:
        name = element.attributes.get("name")
        if name and (kind, name) in seen:
            raise element.refusal(f"has the name of another {kind}; names are given once")
        seen.add((kind, name or ""))

    for section, kind in NAMED.items():
        for element in document.each(section):
            if section != "asset" or element.tag == kind:
                once(element, kind)
    left = [*document.root.each("worldbody")]
    while left:
        element = left.pop()
        if element.tag == "geom":
            once(element, "geom")
        left += element.children


def survey(document: Document, notes: Notes, unmade: str = UNMADE) -> None:
    """Note all sections, elements and attributes of a document that are left out; unmade: what is
    said of the makers."""
    for element, remark, alters in document.remarks:
        notes.on(element, remark, alters)
    for section in document.root.children:
        if section.tag in READ_SECTIONS:
            _inside(section, notes, unmade)
        elif section.tag not in SILENT_SECTIONS:
            told = section.tag not in SECTIONS or section.first("flex") is not None
            notes.on(
                section, SECTIONS.get(section.tag, "is left out: it is not known"), alters=told
            )
    _switched_off(document, notes)


def _switched_off(document: Document, notes: Notes) -> None:
    """Note what options switch off that acts here."""
    actuators = [document.resolved(raw, "actuator") for raw in document.each("actuator")]
    groups = {actuator.number("group", 0.0) for actuator in actuators}
    for option in document.root.each("option"):
        if groups & {*option.numbers(OFF, tuple(range(32)), ())}:
            notes.on(option, GROUPS_OFF, alters=True)
        for flag in option.each("flag") if "actuation" in document.off else ():
            if "actuation" in flag.attributes:
                notes.on(flag, UNDRIVEN)


def _inside(element: Element, notes: Notes, unmade: str) -> None:
    """Note what an element of a known tag and those in it say that is not read."""
    _attributes(element, element.tag, notes)
    known = {
        **dict.fromkeys(("worldbody", "body", "frame"), BODY_ELEMENTS), "equality": set(EQUALITIES),
        "tendon": {"spatial", "fixed"}, "actuator": set(ACTUATORS), "keyframe": {"key"},
        "default": BODY_ELEMENTS | set(ACTUATORS) | {"default", "equality", "tendon"},
        "spatial": {"site", "geom", "pulley"}, "fixed": {"joint"},
    }.get(element.tag, set())  # fmt: skip
    for child in element.children:
        if element.tag in ("equality", "spatial", "fixed") or (element.tag, child.tag) == (
            "default",
            "equality",
        ):
            if element.tag == "equality" and child.tag in ("connect", "weld", "joint", "tendon"):
                _equality(child, notes)
            elif element.tag == "equality" and child.tag not in EQUALITIES:
                notes.on(child, "is left out: it is not known", alters=True)
        elif child.tag in ACTUATORS and element.tag in ("actuator", "default"):
            _attributes(child, "actuator", notes, silent=DRIVE | SERVO)
        elif child.tag in known:
            _inside(child, notes, unmade)
        elif child.tag in MAKERS and element.tag not in UNFELT:
            _maker(child, notes, unmade)
        elif child.tag not in SILENT_ELEMENTS:
            notes.on(child, "is left out: it is not known here", alters=element.tag not in UNFELT)


def _maker(element: Element, notes: Notes, unmade: str) -> None:
    """Note an element by which MuJoCo makes others."""
    if element.tag != "flexcomp":
        notes.on(element, f"is left out: it {unmade}", alters=True)
    elif element.choice("rigid", ("true", "false"), "false") == "true":
        notes.on(element, "is left out: it is rigid and without mass, and nothing but touches")
    else:
        notes.on(element, f"is left out: it {SOFT}", alters=True)


def _equality(element: Element, notes: Notes) -> None:
    _attributes(
        element, element.tag, notes, silent=EQUALITY | ATTRIBUTES["connect"] | ATTRIBUTES["weld"]
    )


def _attributes(element: Element, tag: str, notes: Notes, silent: set[str] | None = None) -> None:
    """Note the attributes of an element that are not read and may matter."""
    for name, value in element.attributes.items():
        if name in RANGES and _out_of_order(value):
            notes.on(element, f"says {name} {value!r}: {OUT_OF_ORDER}", alters=name not in BOUNDS)
        if name in COMMON or name in (ATTRIBUTES.get(tag, set()) if silent is None else silent):
            continue
        if all(_is_nothing(word) for word in value.split()):
            continue
        consequence = CONSEQUENCES.get((tag, name))
        alters = name not in BOUNDS and (tag not in UNFELT or consequence is not None)
        notes.on(
            element,
            f"says {name}, which is left out" + (f": {consequence}" if consequence else ""),
            alters,
        )


def _out_of_order(value: str) -> bool:
    """Tell whether a range ends below its beginning; whatever is no range is refused elsewhere."""
    try:
        low, high = map(float, value.split())
    except ValueError:
        return False
    return low > high


def _is_nothing(word: str) -> bool:
    try:
        return float(word) == 0.0
    except ValueError:
        return word in NOTHING
