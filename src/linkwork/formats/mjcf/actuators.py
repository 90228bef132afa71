"""The actuators of an MJCF model: what each acts on, and its law as a drive.

    hinge, slide, axis of a ball        a joint rate; another actuator of the same rate, and one of
                                        a tendon of joints, a combination of coordinates
    site                                a thrust: a wrench that moves with its body
    force  f = (g . (1, l, l')) a + b . (1, l, l') within a range, l = gear x coordinate;
    a = ctrl, a' = (ctrl - a)/T, or a' = ctrl:  `linkwork.control.Servo` and its kin

The law is kept as data, `Mechanism.drives`, under the actuator; a run has it where it is given
these drives, and its commands are then MuJoCo's ctrl.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from functools import cached_property
from math import pi

import numpy as np

from linkwork.formats import poses
from linkwork.formats.mjcf.document import ACTUATORS, Document, flag
from linkwork.formats.mjcf.inertia import FREEDOMS, along, inertia
from linkwork.formats.mjcf.joints import DrivenBall, Joints
from linkwork.formats.mjcf.laws import MUSCLE
from linkwork.formats.mjcf.tree import ModelTree
from linkwork.formats.names import FreeNames
from linkwork.formats.notes import Notes
from linkwork.formats.xml import Element
from linkwork.mechanism import (
    GROUND,
    Cable,
    Combination,
    Friction,
    SlackSpring,
    Thrust,
    Transmission,
)

NEAR = 1e-9  # axes that agree [1]
ANGULAR_VELOCITY = {"wx": 0, "wy": 1, "wz": 2}
SITES = ("site", "refsite", "slidersite", "cranksite")
LAWS = ("motor", "position", "velocity", "intvelocity", "damper", "cylinder", "general")
ELSEWHERE = ("body", "slidersite", "cranksite", "refsite")  # what no transmission here is
LAGS = ("filter", "filterexact")
TINY = 1e-15  # least divisor that MuJoCo takes
UNKNOWN_IN_MUSCLES = ("forcerange", "forcelimited", "actlimited", "actrange", "actearly", "delay")

Numbers = dict[str, float | str]


@dataclass
class Actuation:
    """Gather actuators: their names, the transmissions that they need or that something acts
    along, and their drives.

    lines: the names of tendons of joints here, by those in the file
    """

    names: dict[str, None] = field(default_factory=dict)
    lines: dict[str, str] = field(default_factory=dict)
    transmissions: dict[str, Transmission] = field(default_factory=dict)
    drives: dict[str, Numbers] = field(default_factory=dict)


def driven_sites(document: Document) -> set[str]:
    """Return the sites that actuators name."""
    return {
        element.attributes[key]
        for element in document.each("actuator")
        for key in SITES
        if key in element.attributes
    }


def ball_drives(document: Document) -> dict[str, DrivenBall]:
    """Return how balls are driven, by name of the ball, where actuators are named "ball.wx" and so
    on."""
    wanted: dict[tuple[str, bool], dict[int, np.ndarray]] = {}
    for element in document.each("actuator"):
        index = ANGULAR_VELOCITY.get(element.attributes.get("name", "").rpartition(".")[2])
        gear = np.array(element.numbers("gear", (1, 2, 3, 4, 5, 6), (1.0,)))
        for key, from_body in (("jointinparent", False), ("joint", True)):
            if key in element.attributes and index is not None and len(gear) == 3:
                columns = wanted.setdefault((element.attributes[key], from_body), {})
                columns[index] = -gear if from_body else gear
    drives = {}
    for (name, from_body), columns in wanted.items():
        R = poses.completed(columns)
        if R is not None:
            drives[name] = DrivenBall(R, from_body)
    return drives


@dataclass
class ActuatorReader:
    """Read the actuators of a document whose joints and tendons are known.

    tendons: those of joints, and cables, by name; tendon_elements: all tendons
    names: give names to transmissions
    """

    document: Document
    tree: ModelTree
    joints: Joints
    tendons: dict[str, Combination | Cable]
    tendon_elements: dict[str, Element]
    names: FreeNames
    notes: Notes

    def __post_init__(self) -> None:
        self.pieces = {piece.name: piece for _, piece in self.tree.pieces() if piece.name}
        self.found = Actuation()
        self.elements = [
            self.document.resolved(raw, "actuator")
            for raw in self.document.each("actuator", *ACTUATORS)
        ]
        for name, line in self.tendons.items():
            self.found.lines[name] = own = self.names.give(name)
            if any(line.loads):
                self.found.transmissions[own] = line
        self.users = Counter(joint for element in self.elements for joint in self._moved(element))
        attributes = [element.attributes for element in self.elements]
        self.direct = Counter(own.get("joint") or own.get("jointinparent") for own in attributes)
        self.pullers = Counter(own.get("tendon") for own in attributes)

    def read(self) -> Actuation:
        """Return all actuators in their order; what is not one here is noted."""
        for element in self.elements:
            gear = np.zeros(6)
            numbers = element.numbers("gear", (1, 2, 3, 4, 5, 6), (1.0,))
            gear[: len(numbers)] = numbers
            name = self._target(element, gear)
            if name is None:
                continue
            self.found.names[name] = None
            wrench = isinstance(self.found.transmissions.get(name), Thrust)
            law = self._law(element, 1.0 if wrench or "." in name else float(gear[0]))
            if law:
                self.found.drives[name] = law
        if self.found.drives:
            self.notes.say(
                f"{self.document.root.file}: the laws of actuators are the mechanism's drives; "
                "given to a run (drives=robot.drives, --drives) they make forces of the file's "
                "controls"
            )
        self._note_bounds()
        return self.found

    def _note_bounds(self) -> None:
        """Note the bounds of what actuators do together that are not those of a single drive."""
        joints = [(self.users[piece.name or ""], piece.element) for piece in self.pieces.values()]
        tendons = [(self.pullers[name], element) for name, element in self.tendon_elements.items()]
        for users, element in (*joints, *tendons):
            name = element.attributes.get("name") if element.tag == "joint" else None
            own = name is not None and users == self.direct[name]
            if not users or (users == 1 and (own or element.tag != "joint")):
                continue
            if "actuatorfrcrange" in element.attributes:
                self.notes.on(
                    element,
                    "says actuatorfrcrange, which is left out: it bounds the sum of several "
                    "actuators, or what a tendon does",
                )

    # ------------------------------------------------------------------------------ what is driven

    def _moved(self, element: Element) -> list[str]:
        """Return the joints that an actuator acts on, by name."""
        attributes = element.attributes
        joint = attributes.get("jointinparent") or attributes.get("joint")
        if joint:
            return [joint]
        tendon = self.tendons.get(attributes.get("tendon", ""))
        labels = {label: name for name, label in self.joints.coordinates.items()}
        return [labels[label] for label in tendon.ratios] if isinstance(tendon, Combination) else []

    def _target(self, element: Element, gear: np.ndarray) -> str | None:
        """Return the rate or the transmission that an actuator acts on, or None with a note."""
        attributes = element.attributes
        joint = attributes.get("jointinparent") or attributes.get("joint")
        if joint is not None:
            return self._of_joint(element, joint, gear)
        if "tendon" in attributes:
            return self._of_tendon(element, element.text("tendon"))
        if "site" in attributes and not any(key in attributes for key in ELSEWHERE):
            return self._of_site(element, gear)
        what = next((key for key in ELSEWHERE if key in attributes), "nothing known")
        self.notes.on(element, f"is left out: what acts on a {what} is no actuator here")
        return None

    def _of_joint(self, element: Element, joint: str, gear: np.ndarray) -> str | None:
        if joint not in self.joints.coordinates:
            rate = self._of_ball(element, joint, gear)
            if rate in self.found.names:
                self.notes.on(
                    element, f"drives {rate!r} as another actuator does; it is one actuator here"
                )
                return None
            return rate
        rate = self.joints.coordinates[joint]
        if rate not in self.found.names:
            return rate
        return self._line(element, Combination(ratios={rate: 1.0}))

    def _of_tendon(self, element: Element, tendon: str) -> str | None:
        if tendon not in self.tendons:
            self.notes.on(
                element,
                f"is left out: the tendon {tendon!r} is no combination of joints and no cable",
            )
            return None
        line = self.tendons[tendon]
        name = self.found.lines[tendon]
        if name in self.found.names:
            alone = {
                "spring": SlackSpring(),
                "friction": Friction(),
                "inertia": 0.0,
                "stop": None,
            }
            return self._line(element, line.model_copy(update=alone))
        self.found.transmissions[name] = line
        return name

    def _of_site(self, element: Element, gear: np.ndarray) -> str | None:
        site = element.text("site")
        if site not in self.tree.sites:
            raise element.refusal(f"there is no site {site!r}")
        body, X = self.tree.sites[site]
        if body == GROUND or not gear.any():
            self.notes.on(element, "is left out: it acts on nothing that moves")
            return None
        R = X[:3, :3]
        return self._line(
            element,
            Thrust(
                body=body,
                point=poses.triple(X[:3, 3]),
                force=poses.triple(R @ gear[:3]),
                moment=poses.triple(R @ gear[3:]),
            ),
        )

    def _line(self, element: Element, line: Transmission) -> str:
        raw = element.attributes.get("name")
        number = len(self.found.names) + 1
        name = self.names.give(raw or f"actuator_{number}", element if raw else None)
        self.found.transmissions[name] = line
        return name

    def _of_ball(self, element: Element, name: str, gear: np.ndarray) -> str | None:
        """Return the rate of a ball or a free joint that an actuator drives, or None with a note:
        its gear is an axis, which has to be one of the joint's own."""
        whole = name in self.joints.floats
        if not whole and name not in self.joints.balls:
            raise element.refusal(f"there is no joint {name!r} to drive")
        owner = self.joints.floats[name] if whole else self.joints.balls[name]
        group = self.joints.groups[owner]
        along = gear if whole else group.axes.T @ gear[:3] * (-1 if group.backwards else 1)
        rates = self.joints.joints[owner].rates(owner)[-len(along) :]
        # Turns here have their rates in the first body's axes, where the actuator's axis has to be,
        # too.
        axis = int(np.argmax(along))
        one = np.linalg.norm(along - np.eye(len(along))[axis]) < NEAR
        in_parent = "jointinparent" in element.attributes
        if not one or not (in_parent != group.backwards or (whole and axis < 3)):
            self.notes.on(
                element,
                (
                    f"is left out: its axis is none of the axes of {owner!r} (jointinparent and a "
                    "gear of length 1 are read)"
                ),
            )
            return None
        return rates[axis]

    # ------------------------------------------------------------------------------------ its law

    def _law(self, element: Element, gear: float) -> Numbers:
        """Return the numbers of the drive that an actuator is; none of one that gives its control
        as a force."""
        if element.tag == "muscle":
            return self._muscle(element, gear)
        if element.tag not in LAWS or not self._known(element):
            self.notes.on(
                element,
                "is taken as a plain actuator: its control law is left out, the force is yours",
            )
            return {}
        gain, bias, dynamics = self._prms(element, gear)
        numbers: Numbers = {
            **dict(zip(("gain", "gain_position", "gain_rate"), gain, strict=True)),
            **dict(zip(("bias", "bias_position", "bias_rate"), bias, strict=True)),
            "gear": gear,
        }
        neutral = {"gain": 1.0, "gear": 1.0}
        numbers = {k: v for k, v in numbers.items() if v != neutral.get(k, 0.0)}
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

    def _known(self, element: Element) -> bool:
        """Tell whether an actuator's parts are those that a servo has."""
        if element.tag != "general":
            return True
        attributes = element.attributes
        dynamics = attributes.get("dyntype", "none")
        lagged = dynamics not in LAGS or not flag(element, "actlimited", "actrange" in attributes)
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
        kp, kv = element.number("kp", kp), element.number("kv", kv)
        if "dampratio" in element.attributes:
            kv = 2 * element.number("dampratio") * np.sqrt(kp * self._reflected(element, gear))
        lag = element.number("timeconst", 0.0)
        servo = ("filterexact" if lag else "none"), lag
        dynamics = servo if element.tag == "position" else ("integrator", 0.0)
        return np.array([kp, 0, 0]), np.array([0, -kp, -kv]), dynamics

    def _range(self, element: Element, key: str, what: str) -> Numbers:
        """Return the bounds of a control, force or activation, where there are any."""
        name = f"{key}range"
        autolimits = self.document.compiler_of(element).autolimits
        automatic = name in element.attributes and autolimits
        limited = element.attributes.get(f"{key}limited", "auto")
        if not (limited == "true" or (limited == "auto" and automatic)):
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

    def _forces(self, element: Element, gear: float) -> Numbers:
        """Return the bounds of the force, actuatorfrcrange of the joint or tendon included."""
        found = self._range(element, "force", "force")
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
                "is taken as a plain actuator: its control law is left out, the force is yours, "
                f"for {why}",
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
        """Return the size of the accelerations at qpos0 by a unit force, |M^-1 J'|."""
        return float(np.linalg.norm(np.linalg.solve(self.inertia[0], self._row(element, gear))))

    def _reflected(self, element: Element, gear: float) -> float:
        """Return the inertia that an actuator sees at qpos0 [kg, kg m^2], 1 / (J M^-1 J')."""
        J = self._row(element, gear)
        return float(1 / (J @ np.linalg.solve(self.inertia[0], J)))

    def _row(self, element: Element, gear: float) -> np.ndarray:
        """Return J (nv) of an actuator at qpos0."""
        line = self.tendons.get(element.attributes.get("tendon", ""))
        if line is not None:
            return gear * self._along(line, self.inertia[1])
        ratios = dict.fromkeys((self.joints.coordinates[n] for n in self._moved(element)), 1.0)
        return gear * self._along(Combination(ratios=ratios), self.inertia[1])

    def _along(self, line: Combination | Cable, places: dict[str, int]) -> np.ndarray:
        """Return J (nv) of a transmission at qpos0."""
        if isinstance(line, Cable):
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
