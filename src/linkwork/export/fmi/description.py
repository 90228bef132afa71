"""The model description of an FMU, as XML: variables, units, types, and what depends on what."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from importlib.metadata import version
from typing import Literal
from xml.etree import ElementTree as ET

from linkwork.export.fmi.variables import FmuVariable, FmuVariables
from linkwork.robot import Robot

Version = Literal["3.0", "2.0"]
SI: dict[str, dict[str, int]] = {
    "1": {},
    "m": {"m": 1},
    "kg": {"kg": 1},
    "s": {"s": 1},
    "rad": {"rad": 1},
    "N": {"kg": 1, "m": 1, "s": -2},
    "J": {"kg": 1, "m": 2, "s": -2},
    "W": {"kg": 1, "m": 2, "s": -3},
    "Pa": {"kg": 1, "m": -1, "s": -2},
    "A": {"A": 1},
    "V": {"kg": 1, "m": 2, "s": -3, "A": -1},
    "ohm": {"kg": 1, "m": 2, "s": -3, "A": -2},
    "H": {"kg": 1, "m": 2, "s": -2, "A": -2},
}
"""Units by the SI's base units."""
POWERS = str.maketrans("²³⁴⁵⁶", "23456")
QUANTITIES = {
    "m": "Length",
    "rad": "Angle",
    "m/s": "Velocity",
    "rad/s": "AngularVelocity",
    "m/s2": "Acceleration",
    "rad/s2": "AngularAcceleration",
    "N": "Force",
    "N m": "Torque",
    "kg": "Mass",
    "s": "Time",
}
"""What numbers of a unit are, where it tells."""
CATEGORIES = {
    "logStatusError": "what cannot be done",
    "logStatusDiscard": "numbers for which there is no motion, and steps that come to such",
}


def exponents(unit: str) -> dict[str, int] | None:
    """Return the powers of the SI's base units of a unit; None where it is not one.

    "N m s/rad2": factors stand side by side, those behind the stroke divide.
    """
    found: Counter[str] = Counter()
    if not unit:
        return None
    for sign, side in zip((1, -1), unit.translate(POWERS).partition("/")[::2], strict=True):
        for factor in side.strip("() ").split():
            match = re.fullmatch(r"([A-Za-z]+|1)\^?(-?\d+)?", factor)
            if match is None or match[1] not in SI:
                return None
            for base, power in SI[match[1]].items():
                found[base] += sign * power * int(match[2] or 1)
    return {base: power for base, power in found.items() if power}


def described(robot: Robot, own: str, token: str, version: Version, known: FmuVariables) -> bytes:
    """Return the model description; own: the model identifier."""
    fmi2 = version == "2.0"
    root = ET.Element(
        "fmiModelDescription",
        {"guid" if fmi2 else "instantiationToken": token},
        fmiVersion=version,
        modelName=plain(robot.mechanism.name),
        description="Exact equations of motion; all numbers in SI units and radians",
        generationTool=tool(),
        variableNamingConvention="structured",
    )
    if fmi2:
        root.set("numberOfEventIndicators", str(known.counts["APART"]))
    for kind in ("ModelExchange", "CoSimulation"):
        root.append(interface(kind, own, fmi2))
    units = sorted({each.unit for each in known.all if exponents(each.unit) is not None})
    root.append(unit_definitions(units))
    root.append(type_definitions([unit for unit in units if unit in QUANTITIES], fmi2))
    categories = ET.SubElement(root, "LogCategories")
    for name, said in CATEGORIES.items():
        ET.SubElement(categories, "Category", name=name, description=said)
    ET.SubElement(root, "DefaultExperiment", startTime="0", stopTime="1", tolerance="1e-8")
    listed = ET.SubElement(root, "ModelVariables")
    references = {each.name: k for k, each in enumerate(known.all)}
    for place, each in enumerate(known.all):
        make = variable2 if fmi2 else variable3
        listed.append(make(each, place, references))
    root.append(structure2(known) if fmi2 else structure3(known))
    ET.indent(root)
    return ET.tostring(root, encoding="UTF-8", xml_declaration=True) + b"\n"


def tool() -> str:
    return f"Linkwork {version('linkwork')}"


def plain(text: str) -> str:
    """Return text without what XML cannot hold."""
    return re.sub(r"[\x00-\x1f\x7f]", " ", text)


SOURCES = ("{own}.c", "{own}_instance.c", "fmi{version}.c")


def source_names(own: str, version: str) -> list[str]:
    """Return the files that are compiled."""
    return [each.format(own=own, version=version[0]) for each in SOURCES]


def interface(kind: str, own: str, fmi2: bool) -> ET.Element:
    """Return what an importer may do with the model exchange, or the co-simulation."""
    state = "FMUstate" if fmi2 else "FMUState"
    found = ET.Element(kind, modelIdentifier=own)
    found.set(f"canGetAndSet{state}", "true")
    found.set(f"canSerialize{state}", "true")
    found.set("providesDirectionalDerivative" if fmi2 else "providesDirectionalDerivatives", "true")
    if fmi2:
        found.set("canNotUseMemoryManagementFunctions", "true")
    if kind == "CoSimulation":
        found.set("canHandleVariableCommunicationStepSize", "true")
    elif fmi2:
        found.set("completedIntegratorStepNotNeeded", "false")
    else:
        found.set("needsCompletedIntegratorStep", "true")
    if fmi2:
        files = ET.SubElement(found, "SourceFiles")
        for name in source_names(own, "2.0"):
            ET.SubElement(files, "File", name=name)
    return found


def unit_definitions(units: Sequence[str]) -> ET.Element:
    """Return the units by the SI's base units."""
    found = ET.Element("UnitDefinitions")
    for unit in units:
        powers = {base: str(power) for base, power in (exponents(unit) or {}).items()}
        ET.SubElement(ET.SubElement(found, "Unit", name=unit), "BaseUnit", powers)
    return found


def type_definitions(units: Sequence[str], fmi2: bool) -> ET.Element:
    """Return the types of variables: what their numbers are."""
    found = ET.Element("TypeDefinitions")
    for unit in units:
        quantity = QUANTITIES[unit]
        if fmi2:
            simple = ET.SubElement(found, "SimpleType", name=quantity)
            ET.SubElement(simple, "Real", quantity=quantity, unit=unit)
        else:
            ET.SubElement(found, "Float64Type", name=quantity, quantity=quantity, unit=unit)
    return found


CAUSALITIES = {
    "time": ("independent", "continuous", None),
    "input": ("input", "continuous", None),
    "parameter": ("parameter", "tunable", "exact"),
    "start": ("parameter", "fixed", "exact"),
    "switch": ("parameter", "fixed", "exact"),
    "state": ("local", "continuous", "calculated"),
    "derivative": ("local", "continuous", "calculated"),
    "output": ("output", "continuous", "calculated"),
    "local": ("local", "continuous", "calculated"),
}
"""Causality, variability and initial value of variables, by role."""


def common(each: FmuVariable, place: int) -> dict[str, str]:
    """Return the attributes that variables of both versions have."""
    causality, variability, initial = CAUSALITIES[each.role]
    found = {
        "name": each.name,
        "valueReference": str(place),
        "causality": causality,
        "variability": variability,
        "description": plain(each.about),
    }
    return found | ({"initial": initial} if initial else {})


def number(each: FmuVariable) -> dict[str, str]:
    """Return unit, type, least and start value of a variable that is a number."""
    found = {}
    if each.unit in QUANTITIES:
        found["declaredType"] = QUANTITIES[each.unit]
    if exponents(each.unit) is not None:
        found["unit"] = each.unit
    if each.least is not None:
        found["min"] = repr(each.least)
    if each.start is not None:
        found["start"] = repr(float(each.start))
    return found


def variable2(each: FmuVariable, place: int, references: dict[str, int]) -> ET.Element:
    """Return a variable of FMI 2.0; derivatives name states by their places, counted from 1."""
    found = ET.Element("ScalarVariable", common(each, place))
    if each.role == "switch":
        ET.SubElement(found, "Boolean", start="false")
        return found
    of = {} if each.of is None else {"derivative": str(references[each.of] + 1)}
    ET.SubElement(found, "Real", number(each) | of)
    return found


def variable3(each: FmuVariable, place: int, references: dict[str, int]) -> ET.Element:
    """Return a variable of FMI 3.0."""
    if each.role == "switch":
        return ET.Element("Boolean", common(each, place) | {"start": "false"})
    of = {} if each.of is None else {"derivative": str(references[each.of])}
    return ET.Element("Float64", common(each, place) | number(each) | of)


def dependencies(known: FmuVariables, each: FmuVariable) -> list[int]:
    """Return the references of what a variable depends on at the same time: the states, and the
    inputs of accelerations."""
    inputs = known.of("input") if each.direct else []
    return [place for place, _ in (*inputs, *known.of("state"))]


def structure2(known: FmuVariables) -> ET.Element:
    """Return outputs, derivatives and what is found at the start, by places counted from 1."""
    found = ET.Element("ModelStructure")
    for title, role in (("Outputs", "output"), ("Derivatives", "derivative")):
        part = ET.SubElement(found, title) if known.of(role) else None
        for place, each in known.of(role):
            on = " ".join(str(k + 1) for k in dependencies(known, each))
            assert part is not None
            ET.SubElement(part, "Unknown", index=str(place + 1), dependencies=on)
    first = sorted(k for role in ("output", "derivative", "state") for k, _ in known.of(role))
    part = ET.SubElement(found, "InitialUnknowns")
    for place in first:
        ET.SubElement(part, "Unknown", index=str(place + 1))
    return found


def structure3(known: FmuVariables) -> ET.Element:
    """Return outputs, derivatives and what is found at the start, by references."""
    found = ET.Element("ModelStructure")
    for title, role in (("Output", "output"), ("ContinuousStateDerivative", "derivative")):
        for place, each in known.of(role):
            on = " ".join(map(str, dependencies(known, each)))
            ET.SubElement(found, title, valueReference=str(place), dependencies=on)
    for role in ("output", "derivative", "state"):
        for place, _ in known.of(role):
            ET.SubElement(found, "InitialUnknown", valueReference=str(place))
    for place, each in known.of("local"):
        if each.kind == "apart":
            ET.SubElement(found, "EventIndicator", valueReference=str(place))
    return found


def build_description(own: str) -> bytes:
    """Return how an importer of FMI 3.0 compiles the sources."""
    root = ET.Element("fmiBuildDescription", fmiVersion="3.0")
    build = ET.SubElement(root, "BuildConfiguration", modelIdentifier=own)
    files = ET.SubElement(build, "SourceFileSet", language="C99")
    for name in source_names(own, "3.0"):
        ET.SubElement(files, "SourceFile", name=name)
    ET.indent(root)
    return ET.tostring(root, encoding="UTF-8", xml_declaration=True) + b"\n"
