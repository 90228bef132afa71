"""The actuators of a URDF file: its transmissions, with their reductions, and limits of effort.

    simple            tau = n_a n_j tau_a                              the joint itself
    differential      tau_1 = n_1 (n_a tau_a + n_b tau_b),             a combination of both joints
                      tau_2 = n_2 (n_a tau_a - n_b tau_b)              for each motor
    four-bar linkage  tau_1 = n_1 n_a tau_a,                           likewise
                      tau_2 = n_2 (n_b tau_b - n_1 n_a tau_a)

with the torques tau_a, tau_b of the motors and reductions n. A joint's reduction and its limit of
effort are a drive of its actuator, whose command is the motor's torque then.

Source: ros_control and ros2_control, package transmission_interface.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import isfinite

from linkwork.formats.notes import Notes
from linkwork.formats.urdf.model import ONE_FREEDOM, UrdfJoint, UrdfModel
from linkwork.formats.xml import Element
from linkwork.mechanism import Combination, MechanismError, Transmission
from linkwork.mechanism.record import HUGE

REDUCTIONS = ("mechanicalReduction", "mechanical_reduction")
PAIRED = ("DifferentialTransmission", "FourBarLinkageTransmission")
ROLES = {"joint": ("joint1", "joint2"), "actuator": ("actuator1", "actuator2")}

Drive = dict[str, float | str]


@dataclass
class UrdfActuation:
    """Hold what is driven: rates of joints and transmissions, and the drives of some."""

    names: dict[str, None] = field(default_factory=dict)
    transmissions: dict[str, Transmission] = field(default_factory=dict)
    drives: dict[str, Drive] = field(default_factory=dict)


def read_actuation(
    model: UrdfModel, named: tuple[str, ...] | None, loops: bool, notes: Notes
) -> UrdfActuation:
    """Return what is driven.

    Args:
        named: the driven joints, where a convention for loops names them; loops: whether there are
            any.
    """
    found, reductions = UrdfActuation(), dict[str, float]()
    if named is None and any(model.root.each("transmission")):
        reductions = _transmissions(model, found, notes)
    else:
        joints = _undriven(model, loops, notes) if named is None else named
        found.names = dict.fromkeys(model.labels[name] for name in joints)
    # What stands between a command and the force at a joint.
    for joint in model.joints.values():
        label = model.labels[joint.name]
        drive = _drive(joint, reductions.get(joint.name, 1.0))
        if label in found.names and drive:
            found.drives[label] = drive
    if found.drives:
        notes.say(
            f"{model.root.file.name}: limits of effort and reductions are the mechanism's drives; "
            "they act in runs that are given them (drives=robot.drives)"
        )
    return found


def _transmissions(model: UrdfModel, found: UrdfActuation, notes: Notes) -> dict[str, float]:
    """Read the transmissions; return the reductions of the joints that have one of their own."""
    reductions: dict[str, float] = {}
    for transmission in model.root.each("transmission"):
        if _kind(transmission) in PAIRED and _paired(transmission, model, found, notes):
            continue
        # Each joint by itself.
        motor = transmission.first("actuator")
        reduction = _reduction(transmission, notes)
        reduction *= 1.0 if motor is None else _reduction(motor, notes)
        for element in transmission.each("joint"):
            name = element.text("name")
            if name not in model.joints:
                notes.on(element, "is driven by a transmission, which is left out: it is not there")
            elif model.joints[name].type in ONE_FREEDOM:
                found.names[model.labels[name]] = None
                reductions[name] = reduction * _reduction(element, notes)
            else:
                notes.on(
                    element,
                    "is driven by a transmission, which is left out: it is no hinge or slide",
                )
    return reductions


def _paired(transmission: Element, model: UrdfModel, found: UrdfActuation, notes: Notes) -> bool:
    """Read a transmission from two motors to two joints, each motor as a combination of the two
    coordinates; tell whether it has both of both."""
    parts = {
        tag: sorted(transmission.each(tag), key=lambda part: _role(part) or roles[-1])
        for tag, roles in ROLES.items()
    }
    names = [part.attributes.get("name", "") for part in parts["joint"]]
    both = len(names) == len(parts["actuator"]) == 2 and all(
        name in model.joints and model.joints[name].type in ONE_FREEDOM for name in names
    )
    if not both:
        notes.on(
            transmission,
            "does not lead from two motors to two hinges or slides; joints are "
            "driven one by one here",
        )
        return False
    one, two = (model.labels[name] for name in names)
    n_1, n_2 = (_reduction(part, notes) for part in parts["joint"])
    n_a, n_b = (_reduction(part, notes) for part in parts["actuator"])
    ratios = [{one: n_1 * n_a, two: n_2 * n_a}, {one: n_1 * n_b, two: -n_2 * n_b}]
    if _kind(transmission) == PAIRED[1]:
        ratios = [{one: n_1 * n_a, two: -n_2 * n_1 * n_a}, {two: n_2 * n_b}]
    for motor, ratio in zip(parts["actuator"], ratios, strict=True):
        name = model.names.give(motor.text("name"), motor)
        found.transmissions[name] = motor.make(Combination, ratios=ratio)
        found.names[name] = None
    return True


def _kind(transmission: Element) -> str:
    """Return the name of a transmission's class, without its package."""
    for tag in ("type", "plugin"):
        inner = transmission.first(tag)
        if inner is not None and inner.content:
            return inner.content.rpartition("/")[2]
    return transmission.attributes.get("type", "").rpartition("/")[2]


def _role(part: Element) -> str:
    inner = part.first("role")
    return part.attributes.get("role", "") if inner is None else inner.content


def _reduction(part: Element, notes: Notes) -> float:
    """Return a part's own reduction, 1 where it gives none or zero, or no number."""
    found = 1.0
    for tag in REDUCTIONS:
        try:
            found = part.inner_number(tag, found)
        except MechanismError:
            notes.on(part.named(tag), "is no number; the reduction is taken as 1")
    return found or 1.0


def _drive(joint: UrdfJoint, reduction: float) -> Drive:
    """Return what turns a command into a joint's force; nothing where it is the force."""
    effort = bound_of(joint, "effort")
    if reduction == 1.0:
        return {} if effort is None else {"type": "saturated", "limit": effort}
    bounds = {} if effort is None else {"least_force": -effort, "largest_force": effort}
    return {"type": "servo", "gain": reduction, **bounds}


def bound_of(joint: UrdfJoint, name: str) -> float | None:
    """Return a joint's limit of effort or velocity; none where it is zero or no finite number, as
    exporters write it that know none."""
    limit = joint.element.first("limit")
    try:
        found = float(limit.attributes.get(name, "0")) if limit else 0.0
    except ValueError:
        return None
    return found if isfinite(found) and 0 < found < HUGE else None


def reflected_inertia(model: UrdfModel, joint: UrdfJoint) -> float:
    """Return what the rotors of a joint's motors add to its inertia, gear_ratio^2 rotor_inertia of
    each that Drake's elements of its transmissions give."""
    total = 0.0
    for transmission in model.root.each("transmission"):
        driven = [part.attributes.get("name") for part in transmission.each("joint")]
        if driven == [joint.name]:
            for motor in transmission.each("actuator"):
                ratio, rotor = (
                    1.0 if (part := motor.first(f"drake:{name}")) is None else part.number("value")
                    for name in ("gear_ratio", "rotor_inertia")
                )
                known = motor.first("drake:rotor_inertia") is not None
                total += ratio**2 * rotor if known else 0.0
    return total


def _undriven(model: UrdfModel, loops: bool, notes: Notes) -> tuple[str, ...]:
    """Return what moves by itself in a tree, and nothing in a loop, where it would be too many."""
    where = model.root.file.name
    if loops:
        notes.say(f"{where}: nothing says which joints are driven; name the actuators")
        return ()
    moving = tuple(
        joint.name
        for joint in model.joints.values()
        if joint.type in ONE_FREEDOM
        and joint.element.first("mimic") is None
        and joint.child not in model.frames
    )
    if moving:
        notes.say(
            f"{where}: nothing says which joints are driven; all hinges and slides that mimic no "
            "other are actuators"
        )
    return moving
