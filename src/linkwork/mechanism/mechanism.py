"""The mechanism: a graph of bodies and joints.

Bodies are nodes, joints are edges between any two of them, and `ground` is a body. A loop is nothing special: it is
what one gets when joints close a cycle. Units are SI, angles are in radians.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Self

import networkx as nx
from pydantic import Field, model_validator

from linkwork.mechanism.body import Body
from linkwork.mechanism.frame import Frame
from linkwork.mechanism.joints import Joint
from linkwork.mechanism.record import MechanismError, Name, Real, Record, Vector3

GROUND = "ground"


class Tool(Record):
    """Name a frame on a body whose pose is the task of the mechanism."""

    body: Name = Field(description="name of the body that carries the tool")
    frame: Frame = Field(default=Frame(), description="the tool's frame in the body's frame")


class Mechanism(Record):
    """Describe a mechanism: bodies, joints between them, actuated joints, tools.

    `reference` holds approximate joint coordinates [m, rad] of a typical configuration; joints it leaves out are at
    zero. The loops are closed from there, and every choice that needs numbers is made there.

    Raises:
        MechanismError: one sentence that names the element, the value and what would be accepted.
    """

    name: str = Field(default="mechanism", description="name of the mechanism")
    gravity: Vector3 = Field(
        default=(0.0, 0.0, -9.81), description="acceleration of gravity in the ground's axes [m/s^2]"
    )
    bodies: Mapping[Name, Body] = Field(description="the bodies by name, without ground")
    joints: Mapping[Name, Joint] = Field(description="the joints by name")
    actuators: tuple[Name, ...] = Field(default=(), description="names of the actuated joints")
    tools: Mapping[Name, Tool] = Field(default_factory=dict, description="the tools by name; the first is the default")
    reference: Mapping[Name, Real] = Field(default_factory=dict, description="approximate joint coordinates [m, rad]")

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if GROUND in self.bodies:
            raise MechanismError(
                "'ground' is the fixed frame and cannot be described; rename the body", ("bodies", GROUND)
            )
        for name, joint in self.joints.items():
            for body in joint.connects:
                require(body, (GROUND, *self.bodies), "body", ("joints", name, "connects"))
            if joint.connects[0] == joint.connects[1]:
                raise MechanismError(f"connects {joint.connects[0]!r} to itself; name two bodies", ("joints", name))
        for name in self.actuators:
            require(name, self.joints, "joint", ("actuators",))
            if self.joints[name].type == "fixed":
                raise MechanismError(f"{name!r} is a fixed joint and cannot be actuated", ("actuators",))
            if self.actuators.count(name) > 1:
                raise MechanismError(f"{name!r} is named twice; name each actuated joint once", ("actuators",))
        for name, tool in self.tools.items():
            require(tool.body, self.bodies, "body", ("tools", name, "body"))
        for name in self.reference:
            require(name, self.joints, "joint", ("reference",))
        loose = set(self.bodies) - set(nx.node_connected_component(self.graph(), GROUND))
        if loose:
            first = next(name for name in self.bodies if name in loose)
            raise MechanismError("no chain of joints connects it to ground; add a joint to it", ("bodies", first))
        return self

    def graph(self) -> nx.MultiGraph:
        """Return the graph: nodes are `ground` and the bodies, edges the joints (key: the joint's name)."""
        graph = nx.MultiGraph()
        graph.add_nodes_from((GROUND, *self.bodies))
        for name, joint in self.joints.items():
            graph.add_edge(*joint.connects, key=name)
        return graph

    def save(self, path: str | Path) -> None:
        """Write the mechanism as a YAML file; `Mechanism.load` gives an equal mechanism back."""
        from linkwork.mechanism.files import write_yaml

        write_yaml(self, Path(path))

    @classmethod
    def load(cls, path: str | Path) -> Mechanism:
        """Read a mechanism from a YAML file; refusals name the file and the element."""
        from linkwork.mechanism.files import read_yaml

        return read_yaml(Path(path))


def require(name: str, known: Iterable[str], kind: str, where: tuple[str, ...]) -> None:
    """Refuse a name that is not among the known ones, and show those."""
    known = tuple(known)
    if name not in known:
        raise MechanismError(f"there is no {kind} {name!r}; the {kind} names are {', '.join(known) or '(none)'}", where)
