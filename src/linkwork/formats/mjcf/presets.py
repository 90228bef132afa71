"""What an attribute or an actuator takes over from its class of defaults, as MuJoCo's reader does.

Numbers that an element gives replace the first of those that its class gives, where MuJoCo allows
fewer. A law of an actuator is taken from the nearest class around that says one of the same kind,
or a <general> that may be one; what classes say beside the law holds for actuators of all kinds.

Source: the MJCF reference of MuJoCo 4, and what its compiler makes of nested defaults.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import pi, sqrt

from linkwork.formats.xml import Element

PARTIAL = (
    "size", "fluidcoef", "stiffness", "damping", "gear", "gainprm", "biasprm", "dynprm",
    "controller",
)  # fmt: skip
"""Attributes whose numbers replace as many of those of the class."""
GENERAL, PRESET = "general", "preset"
LAW = ("gaintype", "gainprm", "biastype", "biasprm", "dyntype", "dynprm")
SERVO = ("kp", "kv", "dampratio", "timeconst", "inheritrange")
SHORT = {
    "motor": (),
    "position": SERVO,
    "intvelocity": SERVO,
    "velocity": ("kv",),
    "damper": ("kv",),
    "cylinder": ("timeconst", "bias", "area", "diameter"),
    "muscle": (
        "timeconst", "tausmooth", "range", "force", "scale", "lmin", "lmax", "vmax", "fpmax",
        "fvmax",
    ),
    "pid": ("kp", "kv", "dampratio", "ki", "imax", "slewmax", "input", "inheritrange"),
    "orientation": ("kp", "kv", "dampratio", "input"),
    "dcmotor": (
        "motorconst", "resistance", "nominal", "saturation", "inductance", "cogging", "controller",
        "thermal", "lugre", "input",
    ),
    "adhesion": ("gain",),
}  # fmt: skip
"""The words of each kind of actuator for its law."""
OF_MUSCLES = SHORT["muscle"][3:]  # in their order in gainprm, after the range
OF_GENERAL = 2 + len(OF_MUSCLES)  # numbers of gainprm, and of biasprm
LAWS = {PRESET, *LAW, *(word for words in SHORT.values() for word in words)}
INSTEAD = {"kv": "dampratio", "dampratio": "kv", "area": "diameter"}
RANGES = {"position": "ctrlrange", "pid": "ctrlrange", "intvelocity": "actrange"}
"""The range that is given, or is that of the joint by inheritrange: the last word holds."""
CONSTANTS = ("motorconst", "resistance", "nominal")  # of a dcmotor
KINDS = {"damper": "affine", "muscle": "muscle", "dcmotor": "dcmotor"}
FIXED = ("position", "intvelocity", "velocity", "cylinder")

Attributes = Mapping[str, str]


def joined(known: Attributes, own: Attributes) -> dict[str, str]:
    """Return attributes in place of known ones, of which the last numbers may stay."""
    kept = {
        name: " ".join([*own[name].split(), *known[name].split()[len(own[name].split()) :]])
        for name in PARTIAL
        if name in own and name in known
    }
    return {**known, **own, **kept}


def of_actuator(element: Element, states: Sequence[Attributes]) -> dict[str, str]:
    """Return the attributes of an actuator with its defaults; states: those of its class and of the
    classes around that, the nearest first."""
    tag, own = element.tag, element.attributes
    known = states[0] if states else {}
    if tag == GENERAL:
        law = _in_general(element, known)
    else:
        found = (_in_short(element, state) for state in states)
        law = next((each for each in found if each is not None), {})
    law = {key: value for key, value in law.items() if INSTEAD.get(key) not in own}
    common = {key: value for key, value in known.items() if key not in LAWS}
    if "inheritrange" in own:
        common.pop(RANGES.get(tag, ""), None)
    elif RANGES.get(tag) in own:
        law.pop("inheritrange", None)
    made = joined(common | law, own) | {PRESET: tag}
    # A muscle stays one whatever is said beside its law.
    if tag == GENERAL and known.get(PRESET) == "muscle" and not {*LAW} & {*own}:
        made[PRESET] = "muscle"
    # What is said of a motor gives K and R at once, by the damping that is known then.
    if tag == "dcmotor" and min(constants := motor_constants(element.with_attributes(made))) > 0:
        made = {key: value for key, value in made.items() if key not in CONSTANTS}
        made |= dict(zip(CONSTANTS, map(repr, constants), strict=False))
    return made | ({"ctrllimited": "true"} if tag == "damper" else {})


def _in_short(element: Element, known: Attributes) -> Attributes | None:
    """Return the law that a class says in the words of a kind of actuator, or None where it is that
    of another kind."""
    tag, said = element.tag, known.get(PRESET)
    if said == tag:
        return {key: known[key] for key in SHORT.get(tag, ()) if key in known}
    kind = known.get("gaintype", "fixed")
    if said != GENERAL or kind != KINDS.get(tag, "fixed"):
        return None
    # The numbers of <general>, zero where they are left out.
    law = element.with_attributes(dict(known))
    gain, bias, (time,) = (
        first(law, "gainprm", 3, (1.0,)),
        first(law, "biasprm", 3),
        first(law, "dynprm", 1, (1.0,)),
    )
    match tag:
        case "position" | "intvelocity":
            lagged = known.get("dyntype") == "filterexact"
            damped = {"kv": -bias[2]} if bias[2] < 0 else {"dampratio": bias[2]}
            numbers = {"kp": gain[0], **damped} | ({"timeconst": time} if lagged else {})
        case "velocity":
            numbers = {"kv": gain[0]}
        case "damper":
            numbers = {"kv": -gain[2]}
        case "cylinder":
            words = " ".join(map(repr, bias))
            return {"area": repr(gain[0]), "timeconst": repr(time), "bias": words}
        case "muscle":
            return of_muscles(law)
        case "dcmotor":
            return _of_motors(law)
        case _:
            return None
    more = {key: known[key] for key in ("inheritrange",) if key in known and tag in FIXED[:2]}
    return {key: repr(value) for key, value in numbers.items()} | more


def of_muscles(law: Element) -> Attributes:
    """Return the words of a muscle for what a <general> of that kind says in numbers."""
    low, high, *numbers = first(law, "gainprm", OF_GENERAL, (1.0,))
    rise, fall, smooth = first(law, "dynprm", 3, (1.0,))
    ranges = {"range": f"{low!r} {high!r}", "timeconst": f"{rise!r} {fall!r}"}
    words = dict(zip(OF_MUSCLES, map(repr, numbers), strict=True))
    return ranges | words | {"tausmooth": repr(smooth)}


def is_muscle(element: Element) -> bool:
    """Tell whether a <general> is a muscle in all its parts."""
    kinds = {element.attributes.get(f"{part}type") for part in ("gain", "bias", "dyn")}
    pull, stretch = (first(element, f"{part}prm", OF_GENERAL, (1.0,)) for part in ("gain", "bias"))
    return element.tag == GENERAL and kinds == {"muscle"} and pull == stretch


def _of_motors(law: Element) -> Attributes:
    """Return the words of a dcmotor for what a <general> of that kind says in numbers."""
    R, K, alpha, T0, kp, ki, kd, highest = first(law, "gainprm", 8, (1.0,))
    lag, change, *heat, ambient, sigma_0, sigma_1, slew, largest = first(law, "dynprm", 9, (1.0,))
    bias = first(law, "biasprm", 6)
    numbers = {
        "motorconst": (K,),
        "resistance": (R,),
        "saturation": (0.0, 0.0, change),
        "controller": (kp, ki, kd, slew, largest, highest),
        "inductance": (0.0, lag),
        "cogging": bias[:3],
        "thermal": (*heat, 0.0, alpha, T0, ambient),
        "lugre": (sigma_0, sigma_1, *bias[3:]),
    }
    said = {key: " ".join(map(repr, values)) for key, values in numbers.items() if any(values)}
    return said | {key: law.attributes[key] for key in ("input",) if key in law.attributes}


def _in_general(element: Element, known: Attributes) -> Attributes:
    """Return the law that a class says in the words of <general>."""
    said = known.get(PRESET, GENERAL)
    if said == GENERAL:
        return {key: known[key] for key in (*LAW, "inheritrange") if key in known}
    law = element.with_attributes(dict(known))
    kp, kv = law.number("kp", 1.0), law.number("kv", 1.0 if said == "velocity" else 0.0)
    affine = {"biastype": "affine"}
    match said:
        case "motor":
            return {}
        case "position" | "intvelocity":
            last = law.number("dampratio") if "dampratio" in known else -kv
            time = law.number("timeconst", 0.0)
            lag = {"dyntype": "filterexact", "dynprm": repr(time)} if time else {}
            kind = lag if said == "position" else {"dyntype": "integrator"}
            inherits = {key: known[key] for key in ("inheritrange",) if key in known}
            prms = {"gainprm": repr(kp), "biasprm": f"0 {-kp!r} {last!r}"}
            return {**affine, **prms, **kind, **inherits}
        case "velocity":
            return {**affine, "gainprm": repr(kv), "biasprm": f"0 0 {-kv!r}"}
        case "damper":
            return {"gaintype": "affine", "gainprm": f"0 0 {-kv!r}"}
        case "cylinder":
            prms = {"gainprm": repr(area(law)), "biasprm": known.get("bias", "0 0 0")}
            return {**affine, **prms, "dyntype": "filter", "dynprm": known.get("timeconst", "1")}
    # Laws that no <general> is read as: their kind says so.
    return {key: known[key] for key in SHORT.get(said, ()) if key in known} | {"gaintype": said}


def area(element: Element) -> float:
    """Return the area of a cylinder, by its diameter where that is given."""
    if "diameter" in element.attributes:
        return pi / 4 * element.number("diameter") ** 2
    return element.number("area", 1.0)


def motor_constants(element: Element) -> tuple[float, float]:
    """Return K and R of a dcmotor, from its constants, or from the voltage V, stall torque T and
    no-load speed w of its nominal point, which say what is not given otherwise; zero where nothing
    says it.

    With the damping B the back-EMF constant K_e is that of  K_e^2 w - K_e V + R B w = 0  where R is
    known, else V/w - V B/T; V/w where that gives none.
    """
    of_torque, of_speed = first(element, "motorconst", 2)
    voltage, stall, speed = first(element, "nominal", 3)
    resistance, (damping,) = element.number("resistance", 0.0), first(element, "damping", 1)
    if voltage > 0 and speed > 0 and of_speed <= 0:
        of_speed, left = voltage / speed, voltage**2 - 4 * resistance * damping * speed**2
        if damping > 0 and resistance > 0:
            of_speed = (voltage + sqrt(left)) / (2 * speed) if left > 0 else of_speed
        elif damping > 0 and stall > 0:
            slowed = voltage * damping / stall
            of_speed -= slowed if of_speed > slowed else 0.0
    constants = [each for each in (of_torque, of_speed) if each > 0] or [0.0]
    K = sqrt(constants[0] * constants[-1])
    return K, resistance or (K * voltage / stall if stall else 0.0)


def first(
    element: Element, name: str, count: int, default: tuple[float, ...] = (0.0,)
) -> list[float]:
    """Return the first few numbers of an attribute, zeros where there are fewer."""
    given = element.attributes.get(name, "").strip()
    values = element.numbers(name, tuple(range(1, 33)), default) if given else default
    return [*values, *([0.0] * count)][:count]
