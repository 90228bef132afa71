"""The laws of MJCF actuators as drives.

    force  f = (g . (1, l, l')) a + b . (1, l, l') within a range, l = gear x coordinate;
    a = ctrl, a' = (ctrl - a)/T, or a' = ctrl:  `linkwork.control.Servo` and its kin

The law is kept as data, `Mechanism.drives`, under the actuator; a run has it where it is given
these drives, and its commands are then MuJoCo's ctrl.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from math import inf
from typing import TypeAlias

import numpy as np

from linkwork.formats.mjcf.document import Document, flag
from linkwork.formats.mjcf.inertia import (
    along,
    first_rates,
    inertia,
    mobility,
    moved_by,
    with_lines,
)
from linkwork.formats.mjcf.joints import Joints
from linkwork.formats.mjcf.laws import MUSCLE
from linkwork.formats.mjcf.motors import MotorLaw, motor_law
from linkwork.formats.mjcf.presets import GENERAL, area, first, is_muscle, of_muscles
from linkwork.formats.mjcf.tree import FREEDOMS, ModelTree, Piece
from linkwork.formats.notes import Notes
from linkwork.formats.xml import Element
from linkwork.mechanism import Cable, Combination, Displacement, SliderCrank, Thrust

LAWS = ("motor", "position", "velocity", "intvelocity", "damper", "cylinder", "general")
MOTORS = ("pid", "dcmotor")
LAGS = ("filter", "filterexact")
TINY = 1e-15  # least divisor that MuJoCo takes
UNKNOWN_IN_MUSCLES = (
    *("forcerange", "forcelimited", "actlimited", "actrange", "actearly", "delay", "site"),
)
NO_LENGTHS = "it has no lengthrange, which MuJoCo finds by a simulation of its own"
PLAIN = "is taken as a plain actuator: its control law is left out, the force is yours"

Numbers = dict[str, float | str]
Between: TypeAlias = SliderCrank | Displacement | Thrust
ActedAlong: TypeAlias = Combination | Cable | Between

HEIRS = {"position": "command", "pid": "command", "intvelocity": "activation"}
HEIRS_BY_DYNAMICS = {"none": "command", "filterexact": "command", "integrator": "activation"}
"""What the range of a joint bounds (inheritrange)."""


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
    between: Between | None = None

    def law(self, element: Element, gear: float, between: Between | None = None) -> Numbers:
        """Return the numbers of the drive that an actuator is; none of one that gives its control
        as a force; between: what it acts along, if that is neither joints nor a tendon."""
        self.between = between
        if is_muscle(element):
            words = {**element.attributes, **of_muscles(element)}
            element = replace(element, tag="muscle", attributes=words)
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
        if kind != "servo":
            numbers |= self._range(element, "act", "activation")
        return {"type": kind, **numbers} if numbers or kind != "servo" else {}

    def of_turn(self, element: Element) -> Numbers:
        """Return what `law` does of an actuator of a turn in space, which no drive here acts on: it
        gives its control as a force, and what else it does is noted."""
        ranges = ("forcerange", "ctrlrange")
        bounded = any(
            self.document.is_limited(element, key, f"{key[:-5]}limited") for key in ranges
        )
        if element.tag != "motor" or bounded:
            self.notes.on(element, f"{PLAIN}, for no drive here acts on a turn in space")
        return {}

    def of_float(self, element: Element) -> Numbers:
        """Return what `law` does of an actuator that pushes a free body, where MuJoCo's length is
        zero."""
        numbers = {} if element.tag == "muscle" else self.law(element, 1.0)
        if not numbers and element.tag != "motor":
            self.notes.on(element, PLAIN)
        return {key: value for key, value in numbers.items() if not key.endswith("_position")}

    def _motor(self, element: Element, gear: float) -> Numbers:
        """Return the numbers of the drive that a <pid> or <dcmotor> is; none of one that has more
        than a drive here."""
        kp = element.number("kp", 1.0)
        law = motor_law(element, self._damping(element, gear, kp))
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
        return (
            attributes.get("gaintype", "fixed") in ("fixed", "affine")
            and attributes.get("biastype", "none") in ("none", "affine")
            and dynamics in ("none", "integrator", *LAGS)
            and not flag(element, "actearly", False)
        )

    def _prms(
        self, element: Element, gear: float
    ) -> tuple[np.ndarray, np.ndarray, tuple[str, float]]:
        """Return gain and bias (constant, by l, by l'), and the activation's kind and time
        constant, as MuJoCo's shortcuts mean them."""
        match element.tag:
            case "motor":
                return np.array([1.0, 0, 0]), np.zeros(3), ("none", 0.0)
            case "position" | "intvelocity":
                return self._servo(element, gear)
            case "velocity":
                kv = element.number("kv", 1.0)
                return np.array([kv, 0, 0]), np.array([0, 0, -kv]), ("none", 0.0)
            case "damper":
                return np.array([0, 0, -element.number("kv", 0.0)]), np.zeros(3), ("none", 0.0)
            case "cylinder":
                gain = np.array([area(element), 0, 0])
                bias = np.array(element.numbers("bias", (3,), (0.0,) * 3))
                dynamics = "filter", element.number("timeconst", 1.0)
            case _:
                kinds = [
                    element.attributes.get(key) == "affine" for key in ("gaintype", "biastype")
                ]
                gain = np.array(first(element, "gainprm", 3, (1.0,))) * (1, kinds[0], kinds[0])
                bias = np.array(first(element, "biasprm", 3)) * kinds[1]
                (time,) = first(element, "dynprm", 1, (1.0,))
                dynamics = element.attributes.get("dyntype", "none"), time
        # What is damped by a ratio, as a position servo is.
        if bias[2] > 0 and gain[0] == -bias[1]:
            bias[2] = -self._by_ratio(element, gear, gain[0], bias[2])
        return gain, bias, dynamics

    def _servo(
        self, element: Element, gear: float
    ) -> tuple[np.ndarray, np.ndarray, tuple[str, float]]:
        """Return what `_prms` does of a position servo, or of one whose control is the rate of its
        goal."""
        kp = element.number("kp", 1.0)
        kv = self._damping(element, gear, kp)
        lag = element.number("timeconst", 0.0)
        servo = ("filterexact" if lag else "none"), lag
        dynamics = servo if element.tag == "position" else ("integrator", 0.0)
        return np.array([kp, 0, 0]), np.array([0, -kp, -kv]), dynamics

    def _damping(self, element: Element, gear: float, kp: float) -> float:
        """Return the damping of a servo, by its ratio where that is given."""
        if "dampratio" not in element.attributes:
            return element.number("kv", 0.0)
        return self._by_ratio(element, gear, kp, element.number("dampratio"))

    def _by_ratio(self, element: Element, gear: float, kp: float, ratio: float) -> float:
        """Return the damping of a servo by its ratio, nothing where that moves nothing."""
        along = mobility(self.inertia[0], self._row(element, gear))
        return 2 * ratio * float(np.sqrt(kp / along)) if along and kp > 0 else 0.0

    def _range(self, element: Element, key: str, what: str, limited: str = "") -> Numbers:
        """Return the bounds of a control, force or activation, where there are any; limited: what
        the attribute that says whether begins with, if not as the range."""
        name = f"{key}range"
        if (limited or key) == "ctrl" and "clampctrl" in self.document.off:
            return {}
        inherited = self._inherited(element, what)
        if inherited:
            return (
                inherited if element.attributes.get(f"{limited or key}limited") != "false" else {}
            )
        if not self.document.is_limited(element, name, f"{limited or key}limited"):
            return {}
        least, largest = element.numbers(name, (2,), (0.0, 0.0))
        return {f"least_{what}": least, f"largest_{what}": largest}

    def _inherited(self, element: Element, what: str) -> Numbers:
        """Return the bounds of a position or its integral that the range of a joint or tendon
        gives."""
        inherits = element.number("inheritrange", 0.0)
        wanted = HEIRS.get(element.tag)
        if element.tag == GENERAL and _follows(element):
            wanted = HEIRS_BY_DYNAMICS.get(element.attributes.get("dyntype", "none"))
        piece = self.pieces.get(element.attributes.get("joint", ""))
        tendon = self.tendon_elements.get(element.attributes.get("tendon", ""))
        target = piece.element if piece else tendon
        if not inherits or what != wanted or target is None or "range" not in target.attributes:
            return {}
        lower, upper = target.numbers("range", (2,), most=inf)
        # The numbers of a range that is no limit are taken as they stand, as MuJoCo does.
        limited = "limit" in self.document.off or self.document.is_limited(target)
        if piece and piece.kind == "hinge" and limited:
            compiler = self.document.compiler_of(target)
            lower, upper = compiler.angle(lower), compiler.angle(upper)
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
        if unknown or not low < high:
            why = f"a muscle here has no {', '.join(unknown)}" if unknown else NO_LENGTHS
            self.notes.on(element, f"{PLAIN}, for {why}")
            return {}
        # Lengths, whose range in units of the muscle's own is given, and the force.
        least, largest = element.numbers("range", (2,), (0.75, 1.05))
        unit = (high - low) / max(largest - least, TINY)
        force = element.number("force", -1.0)
        if force < 0:
            force = element.number("scale", 200.0) / max(self._acceleration(element, gear), TINY)
        if force <= 0:
            self.notes.on(element, f"{PLAIN}, for a muscle without force is none here")
            return {}
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

    def _row(self, element: Element, gear: float) -> np.ndarray:
        """Return J (nv) of an actuator at qpos0."""
        line = self.between or self.tendons.get(element.attributes.get("tendon", ""))
        if line is not None:
            return gear * self._along(line, self.inertia[1])
        (joint,) = self.moved(element)
        if joint in self.joints.coordinates:
            line = Combination(ratios={self.joints.coordinates[joint]: 1.0})
            return gear * self._along(line, self.inertia[1])
        # Of a free joint the rates along its axes, which its gear names.
        J = np.zeros(len(self.inertia[0]))
        given = element.numbers("gear", tuple(range(1, 7)), (1.0,))
        J[self.inertia[1][joint] :][: len(given)] = given
        return J

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
        coordinates of hinges and slides, and of free joints."""
        M, rates = inertia(self.tree)
        at = first_rates(self.tree, rates)
        places = {label: at[name] for name, label in self.joints.coordinates.items() if name in at}
        places |= {name: at[name] for name in self.joints.floats if name in at}
        inert = [line for line in self.tendons.values() if line.inertia]
        lines = [(line.inertia, self._along(line, places)) for line in inert]
        return with_lines(M, self.tree, lines), places


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


def _follows(element: Element) -> bool:
    """Tell whether a general actuator is a servo of the position that it is told."""
    kinds = (element.attributes.get(key) for key in ("gaintype", "biastype"))
    pull, back = first(element, "gainprm", 1, (1.0,))[0], first(element, "biasprm", 2)[1]
    return [*kinds] in ([None, "affine"], ["fixed", "affine"]) and pull == -back
