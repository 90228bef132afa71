"""A mechanism written as MJCF, the model format of MuJoCo.

Names survive: a joint of several freedoms becomes hinges and slides named "joint.freedom". qpos0 is
the home configuration, where the loops are closed, and hinges and slides have the mechanism's own
coordinates (`ref`).

MuJoCo's equality constraints are soft: at a closed state the accelerations differ from those of
rigid loops by about (1 - d)/d of what the constraint forces do, with the impedance d = 0.9999, the
greatest that MuJoCo takes.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from linkwork.equations.joints import motions_of
from linkwork.formats import poses, xml
from linkwork.formats.mjcf.geoms import BETWEEN, size_of
from linkwork.formats.mjcf.laws import law_of, number, numbers
from linkwork.formats.mjcf.model_plan import ADVANCE, Home, ModelPlan, ModelTie, Move, Seat, plan
from linkwork.formats.mjcf.tree import UNLIMITED, WORLD
from linkwork.formats.notes import Notes
from linkwork.mechanism import (
    GROUND,
    Body,
    Cable,
    Combination,
    Limits,
    LoadedLength,
    Mechanism,
    MechanismError,
    PulleyBlock,
    Shape,
    Thrust,
    ViaPoint,
)
from linkwork.mechanism.body import rigid

STIFF = {"solref": "0.02 1", "solimp": "0.9999 0.9999 0.001 0.5 2"}
OPTION = {
    "timestep": "0.001",
    "integrator": "RK4",
    "solver": "Newton",
    "tolerance": "1e-12",
    "iterations": "100",
}
POINT_RADIUS = 1e-4  # radius of gyration given to bodies without inertia, which MuJoCo refuses [m]
LEAST = 1e-14  # least moment of inertia that is written; MuJoCo refuses those below 1e-15 [kg m^2]
POINT_MASS = 1e-8  # mass given to bodies without it, as part of the mechanism's mass
FLAT = 1e-10
"""What is added to flat bodies, as part of their greatest moment: MuJoCo has no tolerance for a + b
>= c."""
STROKE = 0.01  # radius of what is drawn, as part of the mechanism's size


def write_mjcf(mechanism: Mechanism, path: Path) -> tuple[str, ...]:
    """Write a mechanism as an MJCF file with its loops closed; return notes on what MuJoCo takes
    otherwise.

    Raises:
        MechanismError: MJCF cannot hold the mechanism, its loops cannot be closed, or the file
            cannot be written.
    """
    text, notes = to_mjcf(mechanism, home_of(mechanism))
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        temporary.write_text(text, encoding="utf-8")
        temporary.replace(path)
    except OSError as error:
        temporary.unlink(missing_ok=True)
        raise MechanismError(
            f"{path}: cannot be written: {(error.strerror or str(error)).lower()}"
        ) from None
    return notes


def home_of(mechanism: Mechanism) -> Home:
    """Close the loops of a mechanism from its reference."""
    from linkwork.equations import derive, functions
    from linkwork.kernels import compile_function

    equations = derive(mechanism)
    q, still, p = equations.reference, np.zeros(equations.mobility), np.zeros(0)
    (positions,) = compile_function(functions.positions(equations))(q, p)
    origins, orientations, *_ = compile_function(functions.bodies_motion(equations))(q, still, p)
    places = zip(
        mechanism.bodies, origins.reshape(-1, 3), orientations.reshape(-1, 3, 3), strict=True
    )
    placed = {body: poses.pose(origin, R) for body, origin, R in places}
    return Home(
        {GROUND: np.eye(4), **placed},
        dict(zip(mechanism.coordinates, map(float, positions), strict=True)),
    )


def to_mjcf(
    mechanism: Mechanism, home: Home, held: ModelPlan | None = None
) -> tuple[str, tuple[str, ...]]:
    """Return the text of an MJCF file and notes.

    Args:
        home: a configuration in which the loops are closed.
        held: how the file is to hold the mechanism, as `model_plan` says it from this home.
    """
    notes = Notes()
    return _Writer(mechanism, home, held or plan(mechanism, home), notes).text(), notes.sentences()


class _Writer:
    def __init__(self, mechanism: Mechanism, home: Home, plan: ModelPlan, notes: Notes):
        self.mechanism, self.home, self.plan, self.notes = mechanism, home, plan, notes
        self.size = home.size(mechanism)
        self.elements: dict[str, ET.Element] = {}
        self.root = ET.Element("mujoco", model=mechanism.name)
        self.moves = {move.name: move for seat in plan.seats.values() for move in seat.moves}

    def text(self) -> str:
        # What is the same for all mechanisms.
        ET.SubElement(self.root, "compiler", angle="radian", inertiafromgeom="false")
        ET.SubElement(
            self.root, "option", attrib={"gravity": numbers(self.mechanism.gravity)} | OPTION
        )
        default = ET.SubElement(self.root, "default")
        ET.SubElement(default, "equality", attrib=STIFF)
        ET.SubElement(default, "geom", contype="0", conaffinity="0", group="1")
        between = ET.SubElement(default, "default", attrib={"class": BETWEEN})
        ET.SubElement(between, "geom", rgba="0.4 0.5 0.6 1")
        # Bodies with their shapes and joints, then what refers to them.
        self.elements[GROUND] = ET.SubElement(self.root, "worldbody")
        self.sections = {
            name: ET.Element(name) for name in ("tendon", "equality", "actuator", "keyframe")
        }
        self._check()
        for seat in self.plan.seats.values():
            self._body(seat)
        for name, tool in self.mechanism.tools.items():
            self._site(name, tool.body, self.home.poses[tool.body] @ poses.of_frame(tool.frame))
        for tie in self.plan.ties:
            self._tie(tie)
        self._springs()
        self._screws()
        self._gears()
        self._combinations()
        self._cables()
        for name in self.mechanism.actuators:
            self._actuator(name)
        self._key()
        self._say()
        self.root.extend(section for section in self.sections.values() if len(section))
        ET.indent(self.root)
        return ET.tostring(self.root, encoding="unicode") + "\n"

    # --------------------------------------------------------------------------------------- bodies

    def _check(self) -> None:
        if WORLD in self.mechanism.bodies:
            raise MechanismError(
                f"bodies.{WORLD}: is the name that MJCF gives to ground; rename the body"
            )
        self.total = sum(body.mass for body in self.mechanism.bodies.values())
        if any(len(self.plan.chain(name)) > xml.DEEPEST - 10 for name in self.plan.seats):
            raise MechanismError(
                f"joints: a chain of more than {xml.DEEPEST - 10} bodies is too deep for a file "
                "of nested bodies"
            )
        tied = {end for tie in self.plan.ties for end in tie.seats}
        inner = {seat.parent for seat in self.plan.seats.values()}
        for seat in self.plan.seats.values():
            useless = not self.mechanism.bodies[seat.body].inertia.tensor().any() and (
                seat.name in tied or seat.name not in inner
            )
            if seat.name in self.plan.light and (useless or not self.total):
                raise MechanismError(
                    f"bodies.{seat.body}: moves without mass and inertia, which MuJoCo refuses; "
                    "give it some (a massless body is written only inside a chain of joints)"
                )

    def _body(self, seat: Seat) -> None:
        X = self.home.poses[seat.body]
        parent = self.plan.seats.get(seat.parent)
        relative = poses.inverse(self.home.poses[parent.body]) @ X if parent else X
        element = ET.SubElement(
            self.elements[seat.parent], "body", attrib={"name": seat.name} | placed(relative)
        )
        self.elements[seat.name] = element
        self._lifted(element, seat)
        body = self.mechanism.bodies[seat.body]
        if (
            body.mass
            or body.inertia.tensor().any()
            or seat.name in self.plan.light
            or not seat.share
        ):
            self._inertial(element, seat, body)
        for move in seat.moves:
            element.append(self._joint(move, poses.inverse(X)))
        self._draw(element, seat, poses.inverse(X))

    def _lifted(self, element: ET.Element, seat: Seat) -> None:
        """Write what carries a body's own weight; MuJoCo carries weights at mass centres only."""
        body = self.mechanism.bodies[seat.body]
        for name, lift in self.mechanism.lifts.items():
            if lift.body != seat.body:
                continue
            if lift.point == body.centre_of_mass and body.mass and "gravcomp" not in element.attrib:
                element.set("gravcomp", number(lift.mass / body.mass))
            else:
                self.notes.say(
                    f"lifts.{name}: is left out: MuJoCo carries a body's own weight only, once and "
                    "at its mass centre"
                )

    def _inertial(self, element: ET.Element, seat: Seat, body: Body) -> None:
        I, mass = seat.share * body.inertia.tensor(), seat.share * body.mass  # noqa: E741
        if body.inertia.planar:
            I = seat.share * body.inertia.zz * np.eye(3)  # noqa: E741
            self.notes.say(
                "bodies that give zz alone are written with xx = yy = zz, which a planar motion "
                "does not feel"
            )
        if not seat.share:
            mass = POINT_MASS * self.total
            self.notes.say(
                f"{seat.name}: is a body of {mass:.3g} kg between a ball and slides, which "
                "MuJoCo's loops want apart"
            )
        elif seat.name in self.plan.light:
            mass = POINT_MASS * self.total
            self.notes.say(
                f"bodies.{seat.body}: moves without mass, which MuJoCo refuses; {mass:.3g} kg "
                "are added"
            )
        a, b, c = np.linalg.eigvalsh(I)
        if not rigid(a, b, c):
            raise MechanismError(
                f"bodies.{seat.body}.inertia: one moment exceeds the sum of the others, which "
                "MuJoCo refuses; give moments of a rigid body"
            )
        if a + b < c * (1 + FLAT):
            I = I + FLAT * c * np.eye(3)  # noqa: E741
        if seat.moves and a < LEAST:
            added = max(mass * POINT_RADIUS**2, LEAST)
            I = I + added * np.eye(3)  # noqa: E741
            if seat.share:
                self.notes.say(
                    f"bodies.{seat.body}: has no inertia about some axis, which MuJoCo refuses; "
                    f"a radius of gyration of {np.sqrt(added / mass):.3g} m is added"
                )
        elements = (I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2])
        centre = numbers(body.centre_of_mass)
        ET.SubElement(
            element, "inertial", pos=centre, mass=number(mass), fullinertia=numbers(elements)
        )

    def _joint(self, move: Move, into: np.ndarray) -> ET.Element:
        """Return a joint in a body's frame; `into` turns ground's components into the body's."""
        friction, spring, limits, rotor, _ = move.effects
        element = ET.Element("joint", name=move.name, type=move.kind)
        if move.kind != "free":
            element.set("pos", numbers(poses.point(into, move.anchor)))
        if move.kind in ("hinge", "slide"):
            element.set("axis", numbers(into[:3, :3] @ move.axis))
            put(element, "ref", move.ref)
        put(element, "damping", friction.viscous + spring.damping)
        put(element, "frictionloss", friction.coulomb)
        put(element, "stiffness", spring.stiffness)
        put(element, "springref", spring.rest if spring.stiffness else 0.0)
        put(element, "armature", rotor)
        if limits != Limits():
            lower = -UNLIMITED if limits.lower is None else limits.lower
            upper = UNLIMITED if limits.upper is None else limits.upper
            element.set("range", numbers((0.0 if move.kind == "ball" else lower, upper)))
        return element

    def _draw(self, element: ET.Element, seat: Seat, into: np.ndarray) -> None:
        """Add the body's shapes; without any, bars from its first joint to all others. They have no
        mass."""
        # Shapes of the body itself, but of none of its parts.
        shapes = self.mechanism.bodies[seat.body].shapes
        if shapes:
            if seat.name == seat.body:
                for shape in shapes:
                    self._geom(element, shape)
            return
        # Else its first anchor, joined to those of the joints and ties that leave it.
        points = [move.anchor for move in seat.moves[:1]]
        points += [
            child.moves[0].anchor
            for child in self.plan.seats.values()
            if child.parent == seat.name and child.moves
        ]
        points += [
            p
            for tie in self.plan.ties
            for end, p in zip(tie.seats, tie.points, strict=True)
            if end == seat.name
        ]
        # Bars too short to be seen are a ball.
        local = [poses.point(into, p) for p in points]
        radius = number(STROKE * self.size)
        bars = [p for p in local[1:] if np.linalg.norm(p - local[0]) > STROKE * self.size]
        for p in bars:
            bar = {
                "class": BETWEEN,
                "type": "capsule",
                "fromto": numbers((*local[0], *p)),
                "size": radius,
            }
            ET.SubElement(element, "geom", attrib=bar)
        if local and not bars:
            ball = {"class": BETWEEN, "type": "sphere", "pos": numbers(local[0]), "size": radius}
            ET.SubElement(element, "geom", attrib=ball)

    def _geom(self, element: ET.Element, shape: Shape) -> None:
        size = size_of(shape)
        if size is not None:
            fields = {"type": shape.type, "size": numbers(size)} | placed(
                poses.of_frame(shape.frame)
            )
            colour = {} if shape.colour is None else {"rgba": numbers((*shape.colour, 1))}
            ET.SubElement(element, "geom", attrib=fields | colour)

    def _site(self, name: str, seat: str, X: np.ndarray) -> None:
        body = self.plan.seats[seat].body if seat != GROUND else GROUND
        ET.SubElement(
            self.elements[seat],
            "site",
            attrib={"name": name} | placed(poses.inverse(self.home.poses[body]) @ X),
        )

    # ----------------------------------------------------------------------------------------- ties

    def _tie(self, tie: ModelTie) -> None:
        one, two = (WORLD if seat == GROUND else seat for seat in tie.seats)
        match tie.kind:
            case "connect":
                X = self.home.poses[
                    GROUND if tie.seats[0] == GROUND else self.plan.seats[tie.seats[0]].body
                ]
                anchor = numbers(poses.point(poses.inverse(X), tie.points[0]))
                self._add("equality", "connect", name=tie.name, body1=one, body2=two, anchor=anchor)
            case "weld":
                self._add("equality", "weld", name=tie.name, body1=one, body2=two)
            case "rod":
                self._tendon(tie.name, tie.seats, tie.points)
                gap = tie.length - float(np.linalg.norm(tie.points[1] - tie.points[0]))
                self._add(
                    "equality",
                    "tendon",
                    name=tie.name,
                    tendon1=tie.name,
                    polycoef=numbers((gap, 0, 0, 0, 0)),
                )

    def _tendon(
        self, name: str, seats: tuple[str, str], points: Iterable[np.ndarray], **attributes: str
    ) -> None:
        tendon = self._add("tendon", "spatial", name=name, **attributes)
        for end, seat, p in zip(("near", "far"), seats, points, strict=True):
            self._site(f"{name}.{end}", seat, poses.shift(p))
            ET.SubElement(tendon, "site", site=f"{name}.{end}")

    def _springs(self) -> None:
        for name, spring in self.mechanism.springs.items():
            points = [
                poses.point(self.home.poses[b], p)
                for b, p in zip(spring.connects, spring.points, strict=True)
            ]
            label = name if name not in self.mechanism.joints else f"{name}.spring"
            self._tendon(
                label,
                spring.connects,
                points,
                stiffness=number(spring.stiffness),
                springlength=number(spring.rest_length),
                damping=number(spring.damping),
            )

    def _screws(self) -> None:
        """Couple the advance of screws to their turn."""
        for name, joint in self.mechanism.pairs.items():
            for motion, part in zip(motions_of(joint), joint.parts(name), strict=True):
                if motion.pitch is not None:
                    ends = {"joint1": f"{name}.{ADVANCE}", "joint2": part.coordinates[0]}
                    line = numbers((0, float(motion.pitch), 0, 0, 0))
                    self._add("equality", "joint", name=name, **ends, polycoef=line)

    def _gears(self) -> None:
        """Couple hinges and slides: two of them by a joint equality, more by a tendon of joints."""
        for name, gear in self.mechanism.gears.items():
            ratios = {label: ratio for label, ratio in gear.ratios.items() if ratio}
            for label in ratios:
                if not self._is_hinge_or_slide(label):
                    raise MechanismError(
                        f"joints.{name}.ratios: {label!r} is no hinge or slide in MJCF and "
                        "cannot be geared"
                    )
            gap = gear.offset - sum(
                ratio * self.moves[label].ref for label, ratio in ratios.items()
            )
            if len(ratios) == 2:
                (one, first), (two, second) = ratios.items()
                line = numbers((gap / first, -second / first, 0, 0, 0))
                self._add("equality", "joint", name=name, joint1=one, joint2=two, polycoef=line)
            else:
                tendon = self._add("tendon", "fixed", name=name)
                for label, ratio in ratios.items():
                    ET.SubElement(tendon, "joint", joint=label, coef=number(ratio))
                self._add(
                    "equality",
                    "tendon",
                    name=name,
                    tendon1=name,
                    polycoef=numbers((gap, 0, 0, 0, 0)),
                )

    def _add(self, section: str, tag: str, **attributes: str) -> ET.Element:
        return ET.SubElement(self.sections[section], tag, attributes)

    # ------------------------------------------------------------------------------------ actuators

    def _combinations(self) -> None:
        """Write combinations of coordinates as tendons of joints, with what acts along them."""
        for name, line in self.mechanism.transmissions.items():
            if not isinstance(line, Combination):
                continue
            for label, ratio in line.ratios.items():
                if ratio and not self._is_hinge_or_slide(label):
                    raise MechanismError(
                        f"transmissions.{name}.ratios: {label!r} is no hinge or slide in MJCF and "
                        "cannot be combined"
                    )
            tendon = self._add("tendon", "fixed", name=self._line(name))
            for label, ratio in line.ratios.items():
                if ratio:
                    ET.SubElement(tendon, "joint", joint=label, coef=number(ratio))
            self._along(tendon, line, line.offset)

    def _cables(self) -> None:
        """Write cables as spatial tendons, with sites and unseen geoms of their own."""
        for name, line in self.mechanism.transmissions.items():
            if not isinstance(line, Cable):
                continue
            tendon = self._add("tendon", "spatial", name=self._line(name))
            for k, part in enumerate(line.path):
                label = f"{name}.{k}"
                if isinstance(part, PulleyBlock):
                    ET.SubElement(tendon, "pulley", divisor=number(part.divisor))
                elif isinstance(part, ViaPoint):
                    X = self.home.poses[part.body] @ poses.shift(part.point)
                    self._site(label, part.body, X)
                    ET.SubElement(tendon, "site", site=label)
                else:
                    size = [part.radius] if part.type == "sphere" else [part.radius, part.radius]
                    own = {"name": label, "type": part.type, "size": numbers(size), "group": "4"}
                    own |= placed(poses.of_frame(part.frame))
                    ET.SubElement(self.elements[part.body], "geom", attrib=own)
                    led = ET.SubElement(tendon, "geom", geom=label)
                    if part.inside:
                        X = self.home.poses[part.body] @ poses.of_frame(part.frame)
                        self._site(f"{label}.side", part.body, X)
                        led.set("sidesite", f"{label}.side")
            self._along(tendon, line, 0.0)

    def _along(self, tendon: ET.Element, line: LoadedLength, offset: float) -> None:
        """Write what acts along a tendon, whose length is ahead of MuJoCo's by an offset."""
        spring = line.spring
        put(tendon, "stiffness", spring.stiffness)
        put(tendon, "damping", spring.damping + line.friction.viscous)
        put(tendon, "frictionloss", line.friction.coulomb)
        put(tendon, "armature", line.inertia)
        if spring.stiffness:
            rest = spring.rest - offset
            tendon.set("springlength", numbers((rest, rest + spring.slack)))

    def _line(self, name: str) -> str:
        """Return the name of a transmission's tendon, which may not be that of another tendon."""
        taken = {*self.mechanism.joints, *self.mechanism.springs}
        return name if name not in taken else f"{name}.line"

    def _is_hinge_or_slide(self, label: str) -> bool:
        return label in self.moves and self.moves[label].kind in ("hinge", "slide")

    def _actuator(self, name: str) -> None:
        line = self.mechanism.transmissions.get(name)
        tag, gear, shown = law_of(self.mechanism, name, self.notes)
        if isinstance(line, Thrust):
            self._site(
                f"{name}.site",
                line.body,
                self.home.poses[line.body] @ poses.shift(line.point),
            )
            wrench = [gear * float(x) for x in (*line.force, *line.moment)]
            given = {"site": f"{name}.site", "gear": numbers(wrench)}
            self._add("actuator", tag, name=name, **given, **shown)
        elif line is not None:
            given = {"tendon": self._line(name), "gear": number(gear)}
            self._add("actuator", tag, name=name, **given, **shown)
        elif self._is_hinge_or_slide(name):
            given = {} if gear == 1 else {"gear": number(gear)}
            self._add("actuator", tag, name=name, joint=name, **given, **shown)
        else:
            self._of_ball(name, tag, gear, shown)

    def _of_ball(self, rate: str, tag: str, gear: float, law: dict[str, str]) -> None:
        name, _, freedom = rate.partition(".")
        joint = self.mechanism.pairs[name]
        near, _ = self.home.frames(joint)
        axis = near[:3, "xyz".index(freedom[-1])]
        ball = name if name in self.moves else f"{name}.turn"
        owner = next(
            seat
            for seat in self.plan.seats.values()
            if any(move.name == ball for move in seat.moves)
        )
        along = gear * (self.home.poses[owner.body][:3, :3].T @ axis)
        if self.moves[ball].backwards:
            self._add("actuator", tag, name=rate, joint=ball, gear=numbers(-along), **law)
        else:
            self._add("actuator", tag, name=rate, jointinparent=ball, gear=numbers(along), **law)

    def _key(self) -> None:
        """Write qpos at home; it is also where MuJoCo starts."""
        qpos: list[float] = []
        for seat in self.plan.seats.values():
            for move in seat.moves:
                X = self.home.poses[seat.body]
                match move.kind:
                    case "free":
                        qpos += [*X[:3, 3], *poses.to_quaternion(X[:3, :3])]
                    case "ball":
                        qpos += [1, 0, 0, 0]
                    case _:
                        qpos.append(move.ref)
        self._add("keyframe", "key", name="home", qpos=numbers(qpos))

    # ---------------------------------------------------------------------------------------- notes

    def _say(self) -> None:
        """Note what MuJoCo takes otherwise than the mechanism."""
        # What MuJoCo's constraints are: soft, and without gamma for held tendons.
        say, effects = self.notes.say, [move.effects for move in self.moves.values()]
        kinds = {tie.kind for tie in self.plan.ties}
        if kinds or self.mechanism.gears:
            say(
                "MuJoCo's loops are soft: accelerations differ by about 1e-4 of what the "
                "constraint forces do, and gaps open"
            )
        if "rod" in kinds:
            say(
                "rods are exact at rest only: MuJoCo leaves out what the rates add to the "
                "second derivative of a held tendon"
            )
        # What it makes of friction and limits.
        if any(own.friction.coulomb for own in effects):
            say(
                "Coulomb friction is written as frictionloss, which holds still at rest instead "
                "of being smooth about rate zero"
            )
        if any(own.limits != Limits() for own in effects):
            say("limits are stops in MuJoCo; here passing them is only reported")
        if any(own.friction.static or own.friction.bristle for own in effects):
            say("static friction and bristles are left out: MuJoCo has frictionloss alone")
        if self.mechanism.drags:
            say("the fluid is left out: MuJoCo has one that acts on all bodies")
        if self.mechanism.contacts:
            say("contacts are left out: MuJoCo's follow another law, by solref and solimp")
        lines = self.mechanism.transmissions.values()
        stopped = [*effects, *(line for line in lines if isinstance(line, LoadedLength))]
        if any(own.stop for own in stopped):
            say("stops are left out: MuJoCo's limits follow another law, by solreflimit")
        # What is closed, measured or joined otherwise.
        if "weld" in kinds:
            parts = ", ".join(tie.name for tie in self.plan.ties if tie.kind == "weld")
            say(
                f"{parts}: closes a loop by a joint that MuJoCo has in trees only; it leads to a "
                "part of its body, welded to it"
            )
        balls = {
            move.name.removesuffix(".turn") for move in self.moves.values() if move.kind == "ball"
        }
        turned = [
            name
            for name in self.mechanism.joints
            if name in balls and self.home.turned(self.mechanism.pairs[name])
        ]
        if turned:
            say(
                f"{', '.join(turned)}: MuJoCo measures the turn of a ball joint from home, not "
                "from where the two frames agree"
            )
        for name in self.plan.dropped:
            say(
                f"joints.{name}: holds nothing that the rest of the model does not, and is left out"
            )
        for name in self.plan.floating:
            say(f"{name}: is reached by rods only and gets a free joint in MuJoCo")
        # What is not there.
        gone = [body for body in self.mechanism.bodies if body not in self.plan.seats]
        if gone:
            say(
                f"{', '.join(gone)}: has no mass; its joints stand in the next body, as MJCF "
                "writes several joints at once"
            )
        unshown = [
            name
            for name, body in self.mechanism.bodies.items()
            if any(name in gone or size_of(shape) is None for shape in body.shapes)
        ]
        if unshown:
            say(
                f"{', '.join(unshown)}: has shapes that are left out: polygons, meshes, or those "
                "of a body that is no body in MJCF"
            )


def put(element: ET.Element, name: str, value: float) -> None:
    """Write an attribute that is not zero."""
    if value:
        element.set(name, number(value))


def placed(X: np.ndarray) -> dict[str, str]:
    """Return the attributes pos and quat of a pose, without those that say nothing."""
    found = {}
    if np.max(abs(X[:3, 3])) > poses.TINY:
        found["pos"] = numbers(X[:3, 3])
    if np.max(abs(X[:3, :3] - np.eye(3))) > poses.TINY:
        found["quat"] = numbers(poses.to_quaternion(X[:3, :3]))
    return found
