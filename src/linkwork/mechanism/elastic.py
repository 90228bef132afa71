"""Elastic joints: a motor that turns a joint through a spring, as a field of the joint.

Spong's model of a joint with the coordinate q, whose motor has the coordinate theta and the inertia
B relative to the first body:

    f = stiffness (theta - q) + damping (theta' - q')  on the joint,    B theta'' + f = u

The field is short for what it is made into: a massless rotor on a joint "NAME motor", like the
joint itself, whose `rotor_inertia` is B, and a transmission "NAME spring", the sum theta - q.
Source: Spong 1987, Modeling and control of elastic joint robots.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import Field

from linkwork.mechanism.body import Body
from linkwork.mechanism.record import Amount, MechanismError, Positive, Record
from linkwork.mechanism.transmissions import Combination, SlackSpring


class Elastic(Record):
    """Drive a joint by a motor through a spring and a damper."""

    stiffness: Positive = Field(description="force per twist of the spring [N/m, N m/rad]")
    damping: Amount = Field(default=0.0, description="force per rate of it [N s/m, N m s/rad]")
    motor_inertia: Positive = Field(
        description="inertia that moves with the motor's rate, seen at the joint [kg, kg m^2]"
    )


def drawn_by_spring(joint: Any) -> bool:
    """Tell whether a joint, or its fields, are those of an elastic one."""
    elastic = joint.get("elastic") if isinstance(joint, Mapping) else getattr(joint, "elastic", 0)
    return bool(elastic)


def expanded(fields: Mapping[str, Any], joints: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of a mechanism with motors and springs for the joints that are elastic.

    joints: those of the fields, made
    """
    made = {
        name: dict(fields.get(name) or {})
        for name in ("bodies", "joints", "transmissions", "reference")
    }
    actuators = list(fields.get("actuators", ()))
    for name, joint in joints.items():
        elastic = getattr(joint, "elastic", None)
        if elastic is None:
            continue
        # Names that are not taken.
        rotor, motor, spring = f"{name} rotor", f"{name} motor", f"{name} spring"
        for section, own in (("bodies", rotor), ("joints", motor), ("transmissions", spring)):
            if own in made[section]:
                raise MechanismError(
                    f"{own!r} is what the elastic joint {name!r} is made into; rename it",
                    (section, own),
                )
        # The joint without its motor, the motor beside it, the spring between them.
        known, frames = type(joint).model_fields, (joint.frames[0], type(joint.frames[0])())
        made["bodies"][rotor] = Body(mass=0.0)
        made["joints"][name] = joint.model_copy(update={"elastic": None})
        made["joints"][motor] = joint.model_copy(
            update={
                **{of: own.get_default() for of, own in known.items() if of in LOADS},
                "connects": (joint.connects[0], rotor),
                "frames": frames,
                "rotor_inertia": elastic.motor_inertia,
                "elastic": None,
            }
        )
        made["transmissions"][spring] = Combination(
            ratios={motor: 1.0, name: -1.0},
            spring=SlackSpring(stiffness=elastic.stiffness, damping=elastic.damping),
        )
        if name in made["reference"]:
            made["reference"][motor] = made["reference"][name]
        actuators = [motor if own == name else own for own in actuators]
    return {**fields, **{of: own for of, own in made.items() if own}, "actuators": tuple(actuators)}


LOADS = ("friction", "spring", "limits", "stop", "bearing")
"""What the motor has not of its joint."""
