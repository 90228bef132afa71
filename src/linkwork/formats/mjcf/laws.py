"""The law of an actuator in MJCF: the attributes that say what its drive does, and how numbers are
written."""

from __future__ import annotations

from collections.abc import Iterable

from linkwork.formats import poses
from linkwork.formats.mjcf.tree import UNLIMITED
from linkwork.formats.notes import Notes
from linkwork.mechanism import Combination, Mechanism

DYNAMICS = {"servo": "none", "lagging_servo": "filterexact", "integrating_servo": "integrator"}
"""The activation's kind, by the types of drives that MuJoCo has."""
MUSCLE = {
    "least_length": ("lmin", 0.5),
    "largest_length": ("lmax", 1.6),
    "fastest": ("vmax", 1.5),
    "passive": ("fpmax", 1.3),
    "lengthening": ("fvmax", 1.2),
    "blend": ("tausmooth", 0.0),
}
"""The attributes of a muscle and what they are where they are left out, by the drive's numbers."""
RANGES = (("ctrl", "command"), ("force", "force"), ("act", "activation"))


def law_of(mechanism: Mechanism, name: str, notes: Notes) -> tuple[str, float, dict[str, str]]:
    """Return the tag of an actuator, its gear, and the attributes of the law that its drive is.

    f = (g_0 + g_1 l + g_2 l') a + b_0 + b_1 l + b_2 l',  where MuJoCo's l of a combination lacks
    gear times the offset.
    """
    drive = dict(mechanism.drives.get(name, {}))
    kind = str(drive.pop("type", ""))
    line = mechanism.transmissions.get(name)
    offset = line.offset if isinstance(line, Combination) else 0.0
    if kind == "muscle":
        return _muscle({key: float(value) for key, value in drive.items()}, offset)
    if kind not in DYNAMICS:
        if kind:
            notes.say(
                f"drives.{name}: {kind} is no law of MuJoCo's actuators and is left out; the "
                "control is the force"
            )
        return "motor", 1.0, {}
    given = {key: float(value) for key, value in drive.items()}
    gear = given.get("gear", 1.0)
    ahead = gear * offset
    # Gain and bias, what the control passes through, ranges.
    law = {"dyntype": DYNAMICS[kind]}
    for what, constant in (("gain", 1.0), ("bias", 0.0)):
        slopes = [given.get(f"{what}_{of}", 0.0) for of in ("position", "rate")]
        law[f"{what}type"] = "affine" if any(slopes) or what == "bias" else "fixed"
        law[f"{what}prm"] = numbers((given.get(what, constant) + slopes[0] * ahead, *slopes))
    if "time_constant" in given:
        law["dynprm"] = number(given["time_constant"])
    for key, what in RANGES:
        ends = given.get(f"least_{what}", -UNLIMITED), given.get(f"largest_{what}", UNLIMITED)
        if ends != (-UNLIMITED, UNLIMITED):
            law[f"{key}range"] = numbers(ends)
    return "general", gear, law


def _muscle(given: dict[str, float], offset: float) -> tuple[str, float, dict[str, str]]:
    """Return what `law_of` does of a muscle along a length that is ahead of MuJoCo's."""
    gear, least = given.get("gear", 1.0), given.get("tendon_length", 0.0)
    first = least - gear * offset
    law = {
        "force": number(given["peak_force"]),
        "range": "0 1",
        "lengthrange": numbers((first, first + given["optimum_length"])),
    }
    shown = {"activation_time": 0.01, "deactivation_time": 0.04}
    law["timeconst"] = numbers(given.get(name, own) for name, own in shown.items())
    law |= {key: number(given.get(name, own)) for name, (key, own) in MUSCLE.items()}
    ends = given.get("least_excitation", 0.0), given.get("largest_excitation", 1.0)
    if ends != (0.0, 1.0):
        law["ctrlrange"] = numbers(ends)
    return "muscle", gear, law


def number(value: float) -> str:
    """Return a number with all its digits; what rounding left of a zero is zero."""
    value = float(value)
    if abs(value) < poses.TINY:
        return "0"
    return str(int(value)) if value.is_integer() and abs(value) < 1e15 else repr(value)


def numbers(values: Iterable[float]) -> str:
    """Return numbers as an attribute holds them."""
    return " ".join(number(value) for value in values)
