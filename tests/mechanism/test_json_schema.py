"""The JSON schema says what the reader accepts: saved files satisfy it, and wrong ones are refused
by both."""

import copy
import json
from pathlib import Path
from tempfile import TemporaryDirectory

import jsonschema
import pytest
from hypothesis import HealthCheck, given, settings

from linkwork import robots
from linkwork.mechanism import Mechanism, MechanismError, schema
from linkwork.mechanism.document import read_document

from tests.mechanism.descriptions import mechanisms
from tests.mechanism.test_files import ARM

PAGE = Path(__file__).parents[2] / "docs" / "mechanism.schema.json"
REGENERATE = (
    "write json.dumps(linkwork.mechanism.schema(), indent=2) and a newline to "
    "docs/mechanism.schema.json"
)
VALIDATOR = jsonschema.Draft7Validator(schema())


def test_the_schema_is_one():
    jsonschema.Draft7Validator.check_schema(schema())
    assert next(iter(schema()["properties"])) == schema()["required"][0] == "linkwork"


def test_the_committed_schema_is_the_generated_one():
    assert PAGE.read_text(encoding="utf-8") == json.dumps(schema(), indent=2) + "\n", REGENERATE


def test_every_field_is_described():
    for name, part in {"Mechanism": schema(), **schema()["definitions"]}.items():
        for field, content in part.get("properties", {}).items():
            if field != "type":
                assert content.get("description"), f"{name}.{field}"


@pytest.mark.long
@settings(max_examples=15, deadline=None, suppress_health_check=list(HealthCheck))
@given(mechanisms())
def test_saved_files_satisfy_it(mechanism):
    with TemporaryDirectory() as folder:
        mechanism.save(Path(folder) / "x.yaml")
        VALIDATOR.validate(
            read_document((Path(folder) / "x.yaml").read_text(encoding="utf-8")).data
        )


@pytest.mark.sample(19)
@pytest.mark.parametrize("name", robots.__all__)
def test_files_of_the_catalogue_satisfy_it_and_give_the_robot_back(tmp_path, name):
    mechanism = getattr(robots, name)()
    mechanism.save(tmp_path / "x.yaml")
    assert Mechanism.load(tmp_path / "x.yaml") == mechanism
    VALIDATOR.validate(read_document((tmp_path / "x.yaml").read_text(encoding="utf-8")).data)


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("linkwork", None),
        ("linkwork", 2),
        ("bodies", None),
        ("joints", None),
        ("extra", 1),
        ("gravity", [0, 0]),
        ("gravity", [0, 0, "down!"]),
        ("bodies.a b ", {"mass": 1}),
        ("bodies.upper.mass", None),
        ("bodies.upper.mass", -1),
        ("bodies.upper.mass", "very heavy!"),
        ("bodies.upper.weight", 1),
        ("bodies.upper.inertia", {"xx": 1, "yy": 1}),
        ("bodies.upper.shapes", {"type": "sphere", "radius": 1}),
        ("bodies.upper.shapes", [{"radius": 1}]),
        ("bodies.upper.shapes", [{"type": "ball", "radius": 1}]),
        ("bodies.upper.shapes", [{"type": "sphere"}]),
        ("bodies.upper.shapes", [{"type": "sphere", "radius": 0}]),
        ("bodies.upper.shapes", [{"type": "sphere", "radius": 1, "length": 1}]),
        ("bodies.upper.shapes", [{"type": "sphere", "radius": 1, "colour": [0, 0, 1.1]}]),
        ("bodies.upper.shapes", [{"type": "box", "size": [1, 2]}]),
        ("bodies.upper.shapes", [{"type": "polygon", "points": [[0, 0], [1, 0]], "thickness": 1}]),
        ("joints.shoulder.type", None),
        ("joints.shoulder.type", "screw"),
        ("joints.shoulder.type", "hinge"),
        ("joints.shoulder.connects", ["ground"]),
        ("joints.shoulder.connects", ["ground", 1]),
        ("joints.shoulder.axis", [0, 0, 1, 0]),
        ("joints.shoulder.friction", {"viscous": -1}),
        ("joints.shoulder.friction", {"angle": {"viscous": 1}}),
        ("joints.elbow.axis", [0, 0, 1]),
        ("joints.elbow.friction", {"angle": {"viscous": 1}}),
        ("joints.elbow.rotor_inertia", {"turn": -1}),
        ("joints.elbow.frames", [{}]),
        ("joints.elbow.frames", [{}, {"position": [1, 2]}]),
        ("actuators", "shoulder"),
        ("actuators", ["elbow.wx.wy"]),
        ("reference.shoulder", "x!"),
        ("tools", {"tip": {}}),
        ("springs", {"s": {"connects": ["upper", "lower"]}}),
    ],
)
def test_schema_and_reader_refuse_the_same(tmp_path, path, value):
    data = copy.deepcopy(read_document(ARM).data)
    VALIDATOR.validate(data)
    *parents, last = path.split(".")
    place = data
    for part in parents:
        place = place[part]
    place[last] = value
    if value is None:
        del place[last]
    assert not VALIDATOR.is_valid(data)
    (tmp_path / "x.yaml").write_text(json.dumps(data))
    with pytest.raises(MechanismError):
        Mechanism.load(tmp_path / "x.yaml")
