"""The mechanism: a graph of bodies and joints.

Bodies are nodes, joints are edges between any two of them, and `ground` is a body. A loop is
nothing special: it is what one gets when joints close a cycle. Units are SI, angles are in radians.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from pydantic import Field, model_validator

from linkwork import checks
from linkwork.errors import LinkworkError
from linkwork.mechanism.body import Body, Inertia
from linkwork.mechanism.consistency import (
    check_actuators,
    check_connected,
    check_connects,
    check_drives,
    check_gear,
    check_transmissions,
    require,
)
from linkwork.mechanism.contact import Contact
from linkwork.mechanism.effects import Lift, PointSpring
from linkwork.mechanism.elastic import drawn_by_spring, expanded
from linkwork.mechanism.fluid import Drag, Fluid
from linkwork.mechanism.frame import Frame
from linkwork.mechanism.joints import TYPES, GearJoint, Joint, JointBase, PairJoint
from linkwork.mechanism.quantities import QuantityName, standing
from linkwork.mechanism.record import MechanismError, Name, PathName, Real, Record, Vector3
from linkwork.mechanism.refusal import shown
from linkwork.mechanism.task import NAMES, TaskCoordinate, labels
from linkwork.mechanism.transmissions import Transmission
from linkwork.notebooks import Portrayed

if TYPE_CHECKING:
    import networkx as nx

GROUND = "ground"
NAMED = 6  # actuators in a repr


class Tool(Record):
    """Name a frame on a body whose pose is the task of the mechanism."""

    body: Name = Field(description="name of the body that carries the tool")
    frame: Frame = Field(default=Frame(), description="the tool's frame in the body's frame")
    task: tuple[TaskCoordinate, ...] | None = Field(
        default=None,
        description=(
            "coordinates of the tool's pose in which it is led, as many as it has freedoms; "
            "chosen where that is plain if left out"
        ),
    )
    relative_to: Name = Field(
        default=GROUND, description="name of the body in whose frame the tool's pose is told"
    )

    @model_validator(mode="after")
    def _distinct(self) -> Self:
        names = labels(self.task or ())
        if self.task is not None and not names:
            raise MechanismError("names no coordinate; leave it out, or give some", ("task",))
        for name in names:
            if names.count(name) > 1:
                raise MechanismError(
                    f"{name!r} is named twice; give each coordinate once, and records names of "
                    "their own",
                    ("task",),
                )
        for item in self.task or ():
            if not isinstance(item, str) and item.name in NAMES:
                raise MechanismError(
                    f"{item.name!r} is the name of a coordinate of a pose; give the {item.type} "
                    "another name",
                    ("task",),
                )
        if self.relative_to == self.body:
            raise MechanismError(
                f"the pose on {self.body!r} is told relative to the same body; name another",
                ("relative_to",),
            )
        return self


class Mechanism(Record, Portrayed):
    """Describe a mechanism: bodies, joints between them, point springs, contacts, actuated joints,
    tools.

    An actuator is named by the rate it drives: the joint's name, or joint.freedom where a joint has
    several; or by the transmission that it acts along. `drives` say what stands between a command
    and an actuator's force: a type of `linkwork.control` and its numbers, by actuator;
    `Robot.drives` are these, and act where they are handed to a run. `reference` holds approximate
    joint coordinates [m, rad] of a typical configuration; those it leaves out are at zero
    (quaternions at 1, 0, 0, 0). The loops are closed from there, and every choice that needs
    numbers is made there. `caveats` are sentences on how the motion differs from that of the model
    that this was read from (`linkwork.formats`).

    Raises:
        MechanismError: one sentence that names the element, the value and what would be accepted.
    """

    name: str = Field(default="mechanism", description="name of the mechanism")
    let: Mapping[QuantityName, Real] = Field(
        default_factory=dict, description="named quantities, which formulas of other numbers use"
    )
    formulas: Mapping[str, str] = Field(
        default_factory=dict,
        description="formulas of numbers by their paths; files have them in the numbers' places",
    )
    gravity: Vector3 = Field(
        default=(0.0, 0.0, -9.81),
        description="acceleration of gravity in the ground's axes [m/s^2]",
    )
    bodies: Mapping[Name, Body] = Field(description="the bodies by name, without ground")
    joints: Mapping[Name, Joint] = Field(description="the joints by name")
    springs: Mapping[Name, PointSpring] = Field(
        default_factory=dict, description="springs between points, by name"
    )
    contacts: Mapping[Name, Contact] = Field(
        default_factory=dict, description="surfaces of bodies that may meet, by name"
    )
    lifts: Mapping[Name, Lift] = Field(
        default_factory=dict, description="weights that are carried, by name"
    )
    fluid: Fluid = Field(default=Fluid(), description="what surrounds the bodies")
    drags: Mapping[Name, Drag] = Field(
        default_factory=dict, description="what of the bodies the fluid acts on, by name"
    )
    transmissions: Mapping[Name, Transmission] = Field(
        default_factory=dict,
        description="lengths that springs, friction and actuators act along, by name",
    )
    actuators: tuple[PathName, ...] = Field(
        default=(), description="the actuated joints' rates, and actuated transmissions"
    )
    drives: Mapping[PathName, Mapping[Name, Real | str]] = Field(
        default_factory=dict, description="by actuator: the type of a drive, and its numbers"
    )
    tools: Mapping[Name, Tool] = Field(
        default_factory=dict, description="the tools by name; the first is the default"
    )
    reference: Mapping[PathName, Real] = Field(
        default_factory=dict, description="approximate joint coordinates [m, rad]"
    )
    caveats: tuple[str, ...] = Field(
        default=(),
        description=(
            "what the model that this was read from has and this has not, and changes the motion"
        ),
    )

    def __repr__(self) -> str:
        actuators = ", ".join(self.actuators[:NAMED]) + ", ..." * (len(self.actuators) > NAMED)
        parts = [checks.amount(len(self.bodies), "body"), checks.amount(len(self.joints), "joint")]
        parts += [f"driven: {actuators}"] if actuators else []
        return f"Mechanism({self.name!r}, {', '.join(parts)})"

    def __str__(self) -> str:
        return repr(self)

    @model_validator(mode="before")
    @classmethod
    def _with_motors(cls, fields: Any) -> Any:
        joints = fields.get("joints") if isinstance(fields, Mapping) else None
        if not isinstance(joints, Mapping):
            return fields
        own = {name: joint for name, joint in joints.items() if drawn_by_spring(joint)}
        made = {k: one_joint(k, x) if isinstance(x, Mapping) else x for k, x in own.items()}
        return expanded(fields, made) if made else fields

    @property
    def pairs(self) -> dict[str, PairJoint]:
        """Return the joints that connect two bodies: all but the gears."""
        return {name: joint for name, joint in self.joints.items() if isinstance(joint, PairJoint)}

    @property
    def gears(self) -> dict[str, GearJoint]:
        """Return the gears, which connect coordinates."""
        return {name: joint for name, joint in self.joints.items() if isinstance(joint, GearJoint)}

    @property
    def first_tool(self) -> Tool:
        """Return the tool that is led; refuse a mechanism that names none."""
        if not self.tools:
            raise MechanismError("the mechanism names no tool; add one under 'tools'")
        return next(iter(self.tools.values()))

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Return the names of all joint coordinates, in the order of the joints."""
        return tuple(
            label for name, joint in self.joints.items() for label in joint.coordinates(name)
        )

    @property
    def rates(self) -> tuple[str, ...]:
        """Return the names of all joint rates, in the order of the joints."""
        return tuple(label for name, joint in self.joints.items() for label in joint.rates(name))

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        # Formulas give what stands at their places; bodies, and what connects two of them.
        if self.formulas:
            self._check_formulas()
        if GROUND in self.bodies:
            raise MechanismError(
                "'ground' is the fixed frame and cannot be described; rename the body",
                ("bodies", GROUND),
            )
        bodies, coordinates = dict.fromkeys((GROUND, *self.bodies)), dict.fromkeys(self.coordinates)
        pairs: dict[tuple[str, ...], PairJoint | PointSpring | Contact] = {}
        pairs |= {("joints", name): joint for name, joint in self.pairs.items()}
        pairs |= {("springs", name): spring for name, spring in self.springs.items()}
        pairs |= {("contacts", name): contact for name, contact in self.contacts.items()}
        for where, pair in pairs.items():
            check_connects(pair.connects, bodies, where)
        # What refers to coordinates: gears, transmissions, actuators, the reference.
        for name, gear in self.gears.items():
            check_gear(name, gear, coordinates, self.transmissions, self.joints)
        for name, lift in self.lifts.items():
            require(lift.body, self.bodies, "body", ("lifts", name, "body"))
        for name, drag in self.drags.items():
            require(drag.body, self.bodies, "body", ("drags", name, "body"))
        named = coordinates, self.rates, self.joints, self.bodies, GROUND
        check_transmissions(self.transmissions, *named)
        moving = dict.fromkeys((*self.rates, *self.transmissions))
        check_actuators(self.actuators, moving, self.joints)
        check_drives(self.drives, self.actuators)
        for name, tool in self.tools.items():
            require(tool.body, self.bodies, "body", ("tools", name, "body"))
            require(tool.relative_to, bodies, "body", ("tools", name, "relative_to"))
        for name in self.reference:
            require(name, coordinates, "joint", ("reference",))
        # All hangs together.
        check_connected(self.bodies, [joint.connects for joint in self.pairs.values()], GROUND)
        return self

    def graph(self) -> nx.MultiGraph:
        """Return the graph: nodes are `ground` and the bodies, edges the joints but the gears
        (key: the joint's name)."""
        import networkx as nx

        graph = nx.MultiGraph()
        graph.add_nodes_from((GROUND, *self.bodies))
        for name, joint in self.pairs.items():
            graph.add_edge(*joint.connects, key=name)
        return graph

    def _check_formulas(self) -> None:
        """Refuse formulas of other numbers than stand at their places."""
        held = standing(self)
        for path, text in self.formulas.items():
            if path not in held:
                raise MechanismError(
                    f"the formula {shown(text)} does not give the number that stands there; use "
                    "Mechanism.with_quantities, or remove it",
                    tuple(path.split(".")),
                )

    def with_payload(
        self,
        mass: float,
        centre_of_mass: Vector3 = (0.0, 0.0, 0.0),
        inertia: Inertia | None = None,
        tool: str | None = None,
    ) -> Mechanism:
        """Return the mechanism with a payload fixed to a tool: its mass properties are added to the
        tool's body.

        Args:
            mass: [kg]; centre_of_mass: in the tool's frame [m].
            inertia: about the payload's mass centre, in the tool's axes [kg m^2]; a point mass if
                left out.
            tool: name of the tool; the first if left out.
        """
        from linkwork.mechanism.payload import together

        if not self.tools:
            raise MechanismError("there is no tool to carry a payload; add one", ("tools",))
        name = next(iter(self.tools)) if tool is None else tool
        if not checks.among(name, self.tools):
            raise MechanismError(
                f"there is no tool {name!r}; the tools are {', '.join(self.tools)}", ("tools",)
            )
        held = self.tools[name]
        if held.body not in self.bodies:
            raise MechanismError(
                f"the tool is on {held.body!r}, which does not move; choose another",
                ("tools", name),
            )
        payload = Body(
            mass=mass,
            centre_of_mass=centre_of_mass,
            inertia=Inertia(xx=0.0, yy=0.0, zz=0.0) if inertia is None else inertia,
        )
        body = together(self.bodies[held.body], payload, held.frame)
        mine = tuple(
            f"bodies.{held.body}.{part}." for part in ("mass", "centre_of_mass", "inertia")
        )
        formulas = {
            path: text for path, text in self.formulas.items() if not f"{path}.".startswith(mine)
        }
        bodies = {**self.bodies, held.body: body}
        return self.model_copy(update={"bodies": bodies, "formulas": formulas})

    def with_quantities(
        self, let: Mapping[str, float | str], formulas: Mapping[str, str] | None = None
    ) -> Mechanism:
        """Return the mechanism with named quantities, and with numbers that follow from them.

        Args:
            let: values by name, or formulas of other quantities; those that are left out stay.
            formulas: by path of the number, such as {"pin.frames.0.position.x": "rod/2"}.

        Raises:
            MechanismError: formulas that have no value, circles, units that do not fit, numbers
                that a description may not hold.
        """
        from linkwork.mechanism.files import parsed, written
        from linkwork.mechanism.quantities import with_quantities

        made = with_quantities(self, let, formulas)
        try:
            return parsed(written(made))
        except MechanismError as error:
            raise MechanismError(error.what, error.where) from None

    def with_reference(self, values: Mapping[str, float]) -> Mechanism:
        """Return the mechanism with other joint coordinates [m, rad] in its reference, by name; the
        others stay."""
        fields: dict[str, Any] = {name: getattr(self, name) for name in type(self).model_fields}
        values = checks.by_name(values, "the coordinates", "{'crank': 0.5}")
        fields["reference"] = {**self.reference, **values}
        given = {f"reference.{name}" for name in values}
        kept = {path: text for path, text in self.formulas.items() if path not in given}
        fields["formulas"] = kept
        return Mechanism(**fields)

    def save(self, path: str | Path) -> None:
        """Write the mechanism as a YAML file; `Mechanism.load` gives an equal mechanism back.
        `linkwork.formats.save` writes MJCF, URDF and SDF.

        path: of the file, whose name is none of another format.
        """
        from linkwork.mechanism.files import write_yaml

        write_yaml(self, checks.file_path(path, "the path to save to"))

    @property
    def text(self) -> str:
        """Return the mechanism as the text of a mechanism file; `Mechanism.parse` gives an equal
        mechanism back."""
        from linkwork.mechanism.files import written

        return written(self)

    @classmethod
    def parse(cls, text: str) -> Mechanism:
        """Read a mechanism from the text of a mechanism file; refusals name the line and the
        element."""
        from linkwork.mechanism.files import parsed

        if not isinstance(text, str):
            raise LinkworkError(f"the text of a mechanism file is {text!r}; give a string")
        return parsed(text)

    @classmethod
    def load(cls, path: str | Path) -> Mechanism:
        """Read a mechanism from a YAML file; refusals name the file and the element.

        path: of a YAML file; model files of others are read by `linkwork.formats.load`.
        """
        from linkwork.mechanism.files import read_yaml

        return read_yaml(checks.file_path(path, "the path of a mechanism file"))


def one_joint(name: str, fields: Mapping[str, Any]) -> JointBase:
    """Make a joint of its fields."""
    kind = TYPES.get(str(fields.get("type")))
    if kind is None or "elastic" not in kind.model_fields:
        known = ", ".join(word for word, of in TYPES.items() if "elastic" in of.model_fields)
        raise MechanismError(
            f"only joints of one freedom are elastic: {known}", ("joints", name, "elastic")
        )
    try:
        return kind(**fields)
    except MechanismError as error:
        raise MechanismError(error.what, ("joints", name, *error.where)) from None
