"""The laws of MJCF actuators as drives.

    force  f = (g . (1, l, l')) a + b . (1, l, l') within a range, l = gear x coordinate;
    a = ctrl, a' = (ctrl - a)/T, or a' = ctrl:  `linkwork.control.Servo` and its kin

The law is kept as data, `Mechanism.drives`, under the actuator; a run has it where it is given
these drives, and its commands are then MuJoCo's ctrl.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from math import pi
from typing import TypeAlias

import numpy as np

from linkwork.formats.mjcf.document import Document, flag
from linkwork.formats.mjcf.inertia import FREEDOMS, along, inertia, mobility, moved_by
from linkwork.formats.mjcf.joints import Joints
from linkwork.formats.mjcf.laws import MUSCLE
from linkwork.formats.mjcf.motors import MotorLaw, motor_law
from linkwork.formats.mjcf.tree import ModelTree, Piece
from linkwork.formats.notes import Notes
from linkwork.formats.xml import Element
from linkwork.mechanism import Cable, Combination, Displacement, SliderCrank

LAWS = ("motor", "position", "velocity", "intvelocity", "damper", "cylinder", "general")
MOTORS = ("pid", "dcmotor")
LAGS = ("filter", "filterexact")
TINY = 1e-15  # least divisor that MuJoCo takes
UNKNOWN_IN_MUSCLES = ("forcerange", "forcelimited", "actlimited", "actrange", "actearly", "delay")
PLAIN = "is taken as a plain actuator: its control law is left out, the force is yours"

Numbers = dict[str, float | str]
ActedAlong: TypeAlias = Combination | Cable | SliderCrank | Displacement


@dataclass
class DriveReader:
    """Read the laws of actuators.

    tendons: those of joints, and cables, by name; tendon_elements: all tendons
    pieces: joints of the tree by name
    moved: tells the joints that an actuator acts on
    between: what the actuator in hand acts along, if that is neither joints nor a tendon
    users, pullers: how many actuators act on each joint, and on each tendon, by name
    """

    document: Document
    tree: ModelTree
    joints: Joints
    tendons: dict[str, Combination | Cable]
    tendon_elements: dict[str, Element]
    pieces: Mapping[str, Piece]
    moved: Callable[[Element], list[str]]
    users: Counter[str]
    pullers: Counter[str | None]
    notes: Notes
    between: SliderCrank | Displacement | None = None

    def law(
        self, element: Element, gear: float, between: SliderCrank | Displacement | None = None
    ) -> Numbers:
        """Return the numbers of the drive that an actuator is; none of one that gives its control
        as a force; between: what it acts along, if that is neither joints nor a tendon."""
        self.between = between
        if element.tag == "muscle":
            return self._muscle(element, gear)
        if element.tag in MOTORS:
            return self._motor(element, gear)
        if element.tag not in LAWS or not self._known(element):
            self.notes.on(element, PLAIN)
            return {}
        gain, bias, dynamics = self._prms(element, gear)
        numbers = servo(gain, bias, gear)
        numbers |= self._range(element, "ctrl", "command")
        numbers |= self._forces(element, gear)
        # What the command passes through.
        kind = "servo"
        if dynamics[0] in LAGS and dynamics[1] > 0:
            kind, numbers["time_constant"] = "lagging_servo", dynamics[1]
        elif dynamics[0] == "integrator":
            kind = "integrating_servo"
            numbers |= self._range(element, "act", "activation")
        return {"type": kind, **numbers} if numbers or kind != "servo" else {}

    def _motor(self, element: Element, gear: float) -> Numbers:
        """Return the numbers of the drive that a <pid> or <dcmotor> is; none of one that has more
        than a drive here."""
        kp, kv = element.number("kp", 1.0), element.number("kv", 0.0)
        law = motor_law(element, self._damping(element, gear, kp, kv))
        bounds: Numbers = {}
        if isinstance(law, MotorLaw):
            bounds = self._range(element, law.ranged, "command", "ctrl")
            bounds |= self._forces(element, gear, law.largest)
            law = "bounds of voltage or torque" if law.inductance and bounds else law
        if isinstance(law, str):
            self.notes.on(element, f"{PLAIN}, for no drive here has its {law}")
            return {}
        if law.unused:
            self.notes.on(element, f"has the inputs {', '.join(law.unused)}, which stay zero here")
        if law.inductance:
            own = {"resistance": law.resistance, "inductance": law.inductance}
            return {"type": "dc_motor", **own, "torque_constant": law.constant, "gear": gear}
        numbers = servo(law.gain, law.bias, gear) | bounds
        return {"type": "servo", **numbers} if numbers else {}

    def _known(self, element: Element) -> bool:
        """Tell whether an actuator's parts are those that a servo has."""
        if element.tag != "general":
            return True
        attributes = element.attributes
        dynamics = attributes.get("dyntype", "none")
        lagged = dynamics not in LAGS or not self.document.is_limited(
            element, "actrange", "actlimited"
        )
        return (
            attributes.get("gaintype", "fixed") in ("fixed", "affine")
            and attributes.get("biastype", "none") in ("none", "affine")
            and dynamics in ("none", "integrator", *LAGS)
            and lagged
            and not flag(element, "actearly", False)
        )

    def _prms(
        self, element: Element, gear: float
    ) -> tuple[np.ndarray, np.ndarray, tuple[str, float]]:
        """Return gain and bias (constant, by l, by l'), and the activation's kind and time
        constant, as MuJoCo's shortcuts mean them."""
        gain = first(element, "gainprm", 3, (1.0,))
        bias = first(element, "biasprm", 3)
        dynamics = element.attributes.get("dyntype", "none"), first(element, "dynprm", 1, (1.0,))[0]
        match element.tag:
            case "motor":
                return np.array([1.0, 0, 0]), np.zeros(3), ("none", 0.0)
            case "position" | "intvelocity":
                return self._servo(element, gear, gain[0], -bias[2])
            case "velocity":
                kv = element.number("kv", gain[0])
                return np.array([kv, 0, 0]), np.array([0, 0, -kv]), ("none", 0.0)
            case "damper":
                kv = element.number("kv", 1.0)
                return np.array([0, 0, -kv]), np.zeros(3), ("none", 0.0)
            case "cylinder":
                area = element.number("area", gain[0])
                if "diameter" in element.attributes:
                    area = pi / 4 * element.number("diameter") ** 2
                lag = "filter", element.number("timeconst", 1.0)
                return np.array([area, 0, 0]), first(element, "bias", 3), lag
        affine = element.attributes.get("gaintype", "fixed") == "affine"
        biased = element.attributes.get("biastype", "none") == "affine"
        return gain if affine else gain * (1, 0, 0), bias if biased else np.zeros(3), dynamics

    def _servo(
        self, element: Element, gear: float, kp: float, kv: float
    ) -> tuple[np.ndarray, np.ndarray, tuple[str, float]]:
        """Return what `_prms` does of a position servo, or of one whose control is the rate of its
        goal; kp, kv: where they are left out."""
        kp = element.number("kp", kp)
        kv = self._damping(element, gear, kp, element.number("kv", kv))
        lag = element.number("timeconst", 0.0)
        servo = ("filterexact" if lag else "none"), lag
        dynamics = servo if element.tag == "position" else ("integrator", 0.0)
        return np.array([kp, 0, 0]), np.array([0, -kp, -kv]), dynamics

    def _damping(self, element: Element, gear: float, kp: float, kv: float) -> float:
        """Return the damping of a servo, by its ratio where that is given."""
        if "dampratio" not in element.attributes:
            return kv
        return 2 * element.number("dampratio") * np.sqrt(kp * self._reflected(element, gear))

    def _range(self, element: Element, key: str, what: str, limited: str = "") -> Numbers:
        """Return the bounds of a control, force or activation, where there are any; limited: what
        the attribute that says whether begins with, if not as the range."""
        name = f"{key}range"
        if not self.document.is_limited(element, name, f"{limited or key}limited"):
            return self._inherited(element, what)
        least, largest = element.numbers(name, (2,), (0.0, 0.0))
        return {f"least_{what}": least, f"largest_{what}": largest}

    def _inherited(self, element: Element, what: str) -> Numbers:
        """Return the bounds of a position or its integral that a joint's range gives."""
        inherits = element.number("inheritrange", 0.0)
        wanted = {"position": "command", "intvelocity": "activation"}.get(element.tag)
        piece = self.pieces.get(element.attributes.get("joint", ""))
        if not inherits or what != wanted or piece is None or piece.limits.lower is None:
            return {}
        lower, upper = piece.limits.lower, piece.limits.upper
        if upper is None:
            return {}
        middle, half = (lower + upper) / 2, inherits * (upper - lower) / 2
        return {f"least_{what}": middle - half, f"largest_{what}": middle + half}

    def _forces(self, element: Element, gear: float, largest: float = 0.0) -> Numbers:
        """Return the bounds of the force, actuatorfrcrange of the joint or tendon included;
        largest: a motor's own, if it has one."""
        found = self._range(element, "force", "force")
        found |= {"least_force": -largest, "largest_force": largest} if largest else {}
        attributes = element.attributes
        joint = attributes.get("joint") or attributes.get("jointinparent", "")
        piece, tendon = self.pieces.get(joint), attributes.get("tendon", "")
        moved = piece.element if piece else self.tendon_elements.get(tendon)
        users = self.users[joint] if piece else self.pullers[tendon]
        outer = self._range(moved, "actuatorfrc", "force") if moved and users == 1 and gear else {}
        if not outer:
            return found
        # A tendon bounds f itself, a joint what arrives there.
        low, high = sorted(float(value) / (gear if piece else 1.0) for value in outer.values())
        if not found:
            return {"least_force": low, "largest_force": high}
        return {name: min(max(float(value), low), high) for name, value in found.items()}

    def _muscle(self, element: Element, gear: float) -> Numbers:
        """Return the numbers of the drive that a muscle is; none of one whose range of lengths is
        not written, or that has what a muscle here has not."""
        low, high = element.numbers("lengthrange", (2,), (0.0, 0.0))
        unknown = [key for key in UNKNOWN_IN_MUSCLES if key in element.attributes]
        if not low < high or unknown or "site" in element.attributes:
            why = "it has no lengthrange, which MuJoCo finds by a simulation of its own"
            if unknown or "site" in element.attributes:
                why = f"a muscle here has no {', '.join(unknown) or 'site'}"
            self.notes.on(
                element,
                f"{PLAIN}, for {why}",
            )
            return {}
        # Lengths, whose range in units of the muscle's own is given, and the force.
        least, largest = element.numbers("range", (2,), (0.75, 1.05))
        unit = (high - low) / max(largest - least, TINY)
        force = element.number("force", -1.0)
        if force < 0:
            force = element.number("scale", 200.0) / max(self._acceleration(element, gear), TINY)
        times = element.numbers("timeconst", (1, 2), (0.01, 0.04))
        numbers = {
            "peak_force": force,
            "optimum_length": unit,
            "tendon_length": low - least * unit,
            "gear": gear,
            **dict(zip(("activation_time", "deactivation_time"), times, strict=False)),
            **{name: element.number(key, own) for name, (key, own) in MUSCLE.items()},
        }
        bounds = self._range(element, "ctrl", "excitation").values() or (0.0, 1.0)
        ends = (float(np.clip(float(value), 0, 1)) for value in bounds)
        numbers |= dict(zip(("least_excitation", "largest_excitation"), ends, strict=True))
        return {"type": "muscle", **{name: float(value) for name, value in numbers.items()}}

    def _acceleration(self, element: Element, gear: float) -> float:
        """Return the size of the accelerations at qpos0 by a unit force, |M^-1 J'|, infinite where
        it moves no mass."""
        moved = moved_by(self.inertia[0], self._row(element, gear))
        return float("inf") if moved is None else float(np.linalg.norm(moved))

    def _reflected(self, element: Element, gear: float) -> float:
        """Return the inertia that an actuator sees at qpos0 [kg, kg m^2], 1 / (J M^-1 J')."""
        return 1 / mobility(self.inertia[0], self._row(element, gear))

    def _row(self, element: Element, gear: float) -> np.ndarray:
        """Return J (nv) of an actuator at qpos0."""
        line = self.between or self.tendons.get(element.attributes.get("tendon", ""))
        if line is not None:
            return gear * self._along(line, self.inertia[1])
        ratios = dict.fromkeys((self.joints.coordinates[n] for n in self.moved(element)), 1.0)
        return gear * self._along(Combination(ratios=ratios), self.inertia[1])

    def _along(self, line: ActedAlong, places: dict[str, int]) -> np.ndarray:
        """Return J (nv) of a transmission at qpos0."""
        if not isinstance(line, Combination):
            return along(line, self.tree)
        J = np.zeros(sum(FREEDOMS[piece.kind] for _, piece in self.tree.pieces()))
        for label, ratio in line.ratios.items():
            J[places[label]] = ratio
        return J

    @cached_property
    def inertia(self) -> tuple[np.ndarray, dict[str, int]]:
        """Return the tree's M at qpos0, with what moves along tendons, and the places in it of the
        coordinates of hinges and slides."""
        M, rates = inertia(self.tree)
        at = {
            piece.name: rate.start
            for (_, piece), rate in zip(self.tree.pieces(), rates, strict=True)
        }
        places = {label: at[name] for name, label in self.joints.coordinates.items() if name in at}
        for line in self.tendons.values():
            if line.inertia:
                J = self._along(line, places)
                M = M + line.inertia * np.outer(J, J)
        return M, places


def first(
    element: Element, name: str, count: int, default: tuple[float, ...] = (0.0,)
) -> np.ndarray:
    """Return the first few numbers of an attribute, zeros where there are fewer."""
    given = element.attributes.get(name)
    words = tuple(range(1, 33))
    values = element.numbers(name, words, default) if given else default
    return np.array([*values, *([0.0] * count)][:count])


def servo(gain: np.ndarray, bias: np.ndarray, gear: float) -> Numbers:
    """Return the numbers of a servo's gain and bias (constant, by l, by l'), where they are not
    those that it has by itself."""
    numbers: Numbers = {
        **dict(zip(("gain", "gain_position", "gain_rate"), map(float, gain), strict=True)),
        **dict(zip(("bias", "bias_position", "bias_rate"), map(float, bias), strict=True)),
        "gear": gear,
    }
    neutral = {"gain": 1.0, "gear": 1.0}
    return {k: v for k, v in numbers.items() if v != neutral.get(k, 0.0)}
