"""The reference page tells the truth: all fields, types, defaults, limits and snippets."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import get_args

import pytest
from pydantic import TypeAdapter

from linkwork.mechanism import (
    Body,
    Contact,
    Joint,
    Lift,
    Mechanism,
    MechanismError,
    PointSpring,
    Shape,
    Transmission,
)
from linkwork.mechanism.document import MAX_DEPTH, MAX_ENTRIES, read_document
from linkwork.mechanism.files import MAX_BYTES
from linkwork.mechanism.fluid import Drag, Fluid
from linkwork.mechanism.joints import EFFECTS
from linkwork.mechanism.record import Record
from linkwork.mechanism.refusal import records_in

PAGE = (Path(__file__).parents[2] / "docs" / "mechanism-file.md").read_text(encoding="utf-8")
ROWS = [re.split(r"(?<!\\)\|", line)[1:-1] for line in PAGE.splitlines() if line.startswith("|")]
KINDS = {
    "bodies": Body,
    "joints": Joint,
    "springs": PointSpring,
    "contacts": Contact,
    "transmissions": Transmission,
    "lifts": Lift,
    "drags": Drag,
    "drives": Mapping[str, float | str],
}
SHAPES = {record.model_fields["type"].default: record for record in records_in(get_args(Shape)[0])}
JOINTS = {record.model_fields["type"].default: record for record in records_in(get_args(Joint)[0])}


def records(record=Mechanism):
    """Return all kinds of records that a mechanism holds."""
    found = {record}
    for field in record.model_fields.values():
        for part in records_in(field.annotation):
            if issubclass(part, Record):
                found |= records(part)
    return found


def row(field):
    """Return the row of a table about a field, which stands there alone, with others or as the end
    of a path."""
    rows = [row for row in ROWS if re.search(rf"[`.]{field}`", row[0])]
    assert rows, f"no table of the page has a row about {field!r}"
    return rows


@pytest.mark.parametrize("record", sorted(records(), key=str), ids=lambda record: record.__name__)
def test_every_field_and_its_default_is_there(record):
    for name, field in record.model_fields.items():
        if name in EFFECTS:
            assert row(name)[0][-1].strip() == "none"
            continue
        default = (
            None
            if field.is_required() or name == "type"
            else field.get_default(call_default_factory=True)
        )
        cells = [cells[-1].strip().strip("`") for cells in row(name)]
        if field.is_required() or name == "type":
            assert "required" in cells, name
        elif isinstance(default, float):
            assert any(cell == f"{default:g}" for cell in cells), name
        elif (
            isinstance(default, tuple)
            and all(isinstance(item, float) for item in default)
            and default
        ):
            assert any(
                cell == str([float(f"{x:g}") for x in default]).replace(".0", "") for cell in cells
            ), name
        else:
            assert any(cell and cell != "required" for cell in cells), name


@pytest.mark.parametrize("kind", JOINTS)
def test_every_joint_type_with_freedoms_coordinates_rates_and_fields(kind):
    cells = next(cells for cells in ROWS if cells[0].strip() == f"`{kind}`")
    joint = JOINTS[kind]
    assert re.findall(r"`(\w+)`", cells[2]) == list(joint.freedoms)
    example = joint.model_construct()
    for column, names in ((cells[3], example.coordinates("j")), (cells[4], example.rates("j"))):
        if names == ("j",):
            assert "the joint's name" in column
            continue
        for name in names:
            part = name.removeprefix("j.")
            assert f"`.{part}`" in column or (part in ("qx", "qy") and "`.qw` ... `.qz`" in column)
    own = set(joint.model_fields) - {
        "type",
        "connects",
        "frames",
        *EFFECTS,
        "elastic",
    }
    assert set(re.findall(r"`(\w+)`", cells[5])) == own


@pytest.mark.parametrize("kind", SHAPES)
def test_every_shape_with_its_fields(kind):
    cells = next(cells for cells in ROWS if cells[0].strip() == f"`{kind}`")
    own = set(SHAPES[kind].model_fields) - {"type", "frame", "colour", "density"}
    assert set(re.findall(r"`(\w+)`", cells[2])) == own


@pytest.mark.parametrize("text", re.findall(r"```yml\n(.*?)```", PAGE, re.S))
def test_snippets(text):
    for field, parts in read_document(text).data.items():
        if field == "fluid":
            assert Fluid(**parts) != Fluid()
            continue
        made = TypeAdapter(Mapping[str, KINDS[field]]).validate_python(parts)
        assert list(made) == list(parts)


def test_snippets_show_every_type_of_joint_and_shape():
    transmissions = {record.model_fields["type"].default for record in records_in(Transmission)}
    assert set(re.findall(r"type: (\w+)", PAGE)) >= {*JOINTS, *SHAPES, *transmissions}


def test_limits():
    assert f"{MAX_BYTES // 10**6} MB" in PAGE
    assert f"{MAX_DEPTH} levels" in PAGE
    assert f"{MAX_ENTRIES:,} entries" in PAGE


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (
            "bodies: {}\njoints: {hinge: {type: revolute, connects: [ground, arm], axis: [0, 0, "
            "0]}}",
            "joints.hinge.axis",
        ),
        (
            "bodies: {arm: {mass: 1, centre_of_mass: [0, 0]}}\njoints: {}",
            "bodies.arm.centre_of_mass: give 3",
        ),
        ("bodies: {arm: {mas: 1}}\njoints: {}", "bodies.arm.mas: is not a known field"),
        ("bodies: {}\njoints: {hinge: {type: revolut}}", "joints.hinge.type: 'revolut'"),
        ("joints: {hinge: {connects: [ground, on]}}", "joints.hinge.connects.1: on without quotes"),
    ],
)
def test_errors_are_those_of_the_reader(tmp_path, text, sentence):
    shown = next(line for line in PAGE.splitlines() if sentence in line)
    path = tmp_path / "robot.yaml"
    path.write_text("linkwork: 1\n" + text)
    with pytest.raises(MechanismError) as refusal:
        Mechanism.load(path)
    wanted = re.sub(r"^robot.yaml: line \d+: ", "", shown).removesuffix(" ...")
    assert wanted in str(refusal.value)
