"""The actuators of an MJCF model: what each acts on.

    hinge, slide, axis of a ball        a joint rate; another actuator of the same rate, and one of
                                        a tendon of joints, a combination of coordinates
    site                                a thrust: a wrench that moves with its body
    site and refsite, cranksite         a displacement between two bodies, a slider-crank

What it does there is its law (`drive_laws`).
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from linkwork.formats import poses
from linkwork.formats.mjcf.bounds import Pulls
from linkwork.formats.mjcf.document import ACTUATORS, Document
from linkwork.formats.mjcf.drive_laws import DriveReader, Numbers
from linkwork.formats.mjcf.joints import DrivenBall, Joints
from linkwork.formats.mjcf.tree import ModelTree
from linkwork.formats.names import FreeNames
from linkwork.formats.notes import Notes
from linkwork.formats.xml import Element
from linkwork.mechanism import (
    GROUND,
    Cable,
    Combination,
    Displacement,
    Friction,
    SlackSpring,
    SliderCrank,
    Thrust,
    Transmission,
    ViaPoint,
)

NEAR = 1e-9  # axes that agree [1]
ANGULAR_VELOCITY = {"wx": 0, "wy": 1, "wz": 2}
SITES = ("site", "refsite", "slidersite", "cranksite")
ELSEWHERE = ("body", "slidersite", "refsite")  # what is no transmission by itself

WHY = {
    "body": "it pulls at the contacts of a body, of which nothing is read",
    "": "it names nothing that it acts on; name a joint, a tendon or a site",
}
APART = (
    "its refsite moves by joints by which its site does not, and MuJoCo's force is then not along "
    "its length; take a refsite of a body that carries the other, or the world's"
)
THREE = "it acts on three rates at once, and an actuator here on one"


@dataclass
class Actuation:
    """Gather actuators: their names, the transmissions that they need or that something acts
    along, and their drives.

    lines: the names of tendons of joints and cables here, by those in the file
    """

    names: dict[str, None] = field(default_factory=dict)
    lines: dict[str, str] = field(default_factory=dict)
    transmissions: dict[str, Transmission] = field(default_factory=dict)
    drives: dict[str, Numbers] = field(default_factory=dict)

    def pulled(self) -> list[Transmission]:
        """Return what actuators act along, beside rates."""
        return [self.transmissions[name] for name in self.names if name in self.transmissions]


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
    for raw in document.each("actuator", *ACTUATORS):
        element = document.resolved(raw, "actuator")
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
        own = self.tendons, self.tendon_elements, self.pieces, self._moved, self.users
        self.laws = DriveReader(
            self.document, self.tree, self.joints, *own, self.pullers, self.notes
        )

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
            law = self._law(element, name, float(gear[0]))
            if law:
                self.found.drives[name] = law
        if self.found.drives:
            self.notes.say(
                f"{self.document.root.file}: the laws of actuators are the mechanism's drives; "
                "given to a run (drives=robot.drives, --drives) they make forces of the file's "
                "controls"
            )
        pulls = Pulls(self.document, self.tree, self.users, self.direct, self.pullers)
        pulls.tell(self.found.pulled(), self.tendon_elements.values(), self.notes)
        return self.found

    def _law(self, element: Element, name: str, gear: float) -> Numbers:
        """Return the numbers of the drive of an actuator that acts on a rate or a transmission."""
        own, _, freedom = name.rpartition(".")
        if own in self.joints.groups and freedom in ANGULAR_VELOCITY:
            return self.laws.of_turn(element)
        if own in self.joints.floats.values() and name not in self.joints.coordinates.values():
            return self.laws.of_float(element)
        # These have the gear in them.
        line = self.found.transmissions.get(name)
        whole = isinstance(line, Thrust | Displacement)
        between = line if isinstance(line, Displacement | SliderCrank | Thrust) else None
        return self.laws.law(element, 1.0 if whole else gear, between)

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
        if element.tag == "orientation" or "so3" in attributes.get("gaintype", ""):
            self.notes.on(element, f"is left out: {THREE}")
            return None
        joint = attributes.get("jointinparent") or attributes.get("joint")
        if joint is not None:
            return self._of_joint(element, joint, gear)
        if "tendon" in attributes:
            return self._of_tendon(element, element.text("tendon"))
        if "cranksite" in attributes:
            return self._of_crank(element)
        if "refsite" in attributes and "site" in attributes:
            return self._of_sites(element, gear)
        if "site" in attributes:
            return self._of_site(element, gear)
        what = next((key for key in ELSEWHERE if key in attributes), "")
        why = WHY.get(what, f"what acts on a {what} is no actuator here")
        self.notes.on(element, f"is left out: {why}")
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
        body, X = self._site(element, "site")
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

    def _site(self, element: Element, key: str) -> tuple[str, np.ndarray]:
        """Return the body of a site that an actuator names, and its pose there."""
        site = element.text(key)
        if site not in self.tree.sites:
            raise element.refusal(f"there is no site {site!r}")
        return self.tree.sites[site]

    def _of_crank(self, element: Element) -> str | None:
        """Return the transmission of a slider-crank between two sites, or None with a note."""
        (crank, X), (body, slider) = (self._site(element, k) for k in ("cranksite", "slidersite"))
        if crank == body:
            self.notes.on(element, "is left out: it acts on nothing that moves")
            return None
        pin = ViaPoint(body=crank, point=poses.triple(X[:3, 3]))
        rod, frame = element.number("cranklength"), poses.frame_of(slider)
        return self._line(
            element, element.make(SliderCrank, pin=pin, body=body, frame=frame, rod=rod)
        )

    def _of_sites(self, element: Element, gear: np.ndarray) -> str | None:
        """Return the transmission of a site seen from another, or None with a note: MuJoCo's force
        on a displacement is along it only where whatever moves that other site moves both."""
        (body, X), (base, X_base) = (self._site(element, key) for key in ("site", "refsite"))
        moved, known = (self._movers(each) for each in (body, base))
        if not gear.any() or body == base or not (moved or known):
            self.notes.on(element, "is left out: it acts on nothing that moves")
            return None
        if gear[:3].any() and known - moved:
            self.notes.on(element, f"is left out: {APART}")
            return None
        if not gear[:3].any() and element.tag in ("position", "intvelocity"):
            self.notes.on(
                element,
                "takes its command as it is, and MuJoCo the nearest of those a whole turn apart",
            )
        force, moment = poses.triple(gear[:3]), poses.triple(gear[3:])
        seen = Displacement(
            body=body,
            frame=poses.frame_of(X),
            base=base,
            base_frame=poses.frame_of(X_base),
            force=force,
            moment=moment,
        )
        return self._line(element, seen)

    def _movers(self, body: str) -> set[str]:
        """Return the bodies with joints from a body to ground."""
        return {node.name for node in self.tree.chain(body) if node.pieces}

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
