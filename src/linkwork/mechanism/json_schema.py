"""The JSON schema of mechanism files: editors complete and check a file by it while it is written.

It is pydantic's schema of `Mechanism`, put in the terms of draft 7, which every editor knows, with
what a file must say and what the joint types leave open made explicit.
"""

from __future__ import annotations

from typing import Any

from linkwork.mechanism.contact import Surface
from linkwork.mechanism.joints import EFFECTS, Joint, ManyFreedoms
from linkwork.mechanism.mechanism import Mechanism
from linkwork.mechanism.refusal import records_in
from linkwork.mechanism.shapes import Shape
from linkwork.mechanism.transmissions import CablePart, Transmission

FORMAT_VERSION = 1
FORMULA = {
    "title": "Formula",
    "description": "a number worked out of named quantities, such as rod/2, or in degrees: 30 deg",
    "type": "string",
    "pattern": r"^[-+]?\(*[A-Za-z_0-9.][A-Za-z0-9_ .+*/(),-]*$",
}
PLAIN = ("axis", "axes", "elastic", "drives")
"""Fields in which numbers are numbers."""


def schema() -> dict[str, Any]:
    """Return the JSON schema (draft 7) of the mechanism file as a dict, ready for `json.dump`."""
    made = Mechanism.model_json_schema(ref_template="#/definitions/{model}")
    definitions = made.pop("$defs")
    made["properties"].pop("formulas")
    kinds = Joint, Shape, Surface, Transmission, CablePart
    for record in dict.fromkeys(record for kind in kinds for record in records_in(kind)):
        _say_type(definitions[record.__name__])
        if issubclass(record, ManyFreedoms):
            _name_freedoms(definitions[record.__name__], record.freedoms)
    version = {
        "const": FORMAT_VERSION,
        "title": "Format",
        "description": "version of the file format",
    }
    return _in_draft_7(
        {
            "$schema": "http://json-schema.org/draft-07/schema#",
            "title": "Linkwork mechanism",
            "description": (
                "Bodies, joints between them, actuators and tools. Units are SI, angles are in "
                "radians."
            ),
            "type": "object",
            "properties": {"linkwork": version, **made["properties"]},
            "required": ["linkwork", *made["required"]],
            "additionalProperties": False,
            "definitions": {**definitions, "Formula": FORMULA},
        }
    )


def _say_type(record: dict[str, Any]) -> None:
    """Require the type of a joint, a shape or a transmission, and put it first."""
    kind = record["properties"].pop("type")
    record["properties"] = {
        "type": {"const": kind["const"], "title": "Type"},
        **record["properties"],
    }
    record["required"] = ["type", *record.get("required", [])]


def _name_freedoms(joint: dict[str, Any], freedoms: tuple[str, ...]) -> None:
    """Let the effects of a joint be given for its own freedoms only."""
    for effect in EFFECTS:
        field = joint["properties"][effect]
        (each,) = field.pop("patternProperties").values()
        field["properties"] = dict.fromkeys(freedoms, each)


def _in_draft_7(part: Any, formulas: bool = True) -> Any:
    """Rewrite what draft 7 does not know: tuples of equal items, keywords beside a reference,
    discriminators; let formulas stand for numbers."""
    if isinstance(part, list):
        return [_in_draft_7(item, formulas) for item in part]
    if not isinstance(part, dict):
        return part
    part = {
        key: _in_draft_7(value, formulas and key not in PLAIN)
        for key, value in part.items()
        if key != "discriminator"
    }
    if "prefixItems" in part:
        part["items"] = part.pop("prefixItems")[0]
    if "patternProperties" in part or ("properties" in part and part.get("type") == "object"):
        part["additionalProperties"] = False
    if "$ref" in part and len(part) > 1:
        part["allOf"] = [{"$ref": part.pop("$ref")}]
    return _or_formula(part) if formulas and part.get("type") == "number" else part


def _or_formula(number: dict[str, Any]) -> dict[str, Any]:
    """Return a number, or a formula in its place."""
    said = {key: number.pop(key) for key in ("title", "description", "default") if key in number}
    return {**said, "anyOf": [number, {"$ref": "#/definitions/Formula"}]}
