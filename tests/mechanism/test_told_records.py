"""What `help`, an editor and the prompt tell of the records of a description."""

import inspect

import pytest

import linkwork as lw
from linkwork import mechanism, robots
from linkwork.mechanism.record import Record

RECORDS = [
    each for each in vars(mechanism).values() if isinstance(each, type) and issubclass(each, Record)
]


def test_signatures_are_those_of_the_source():
    assert str(inspect.signature(lw.Spring)) == (
        "(*, stiffness: float = 0.0, powers: tuple[float, ...] = (), rest: float = 0.0, "
        "damping: float = 0.0) -> None"
    )
    told = str(inspect.signature(lw.Body))
    assert "inertia: Inertia = Inertia(zz=0.0, xx=0.0, yy=0.0)" in told
    assert "shapes: tuple[Box | Cylinder" in told
    assert "spring: Spring = Spring()" in str(inspect.signature(lw.RevoluteJoint))


@pytest.mark.parametrize("record", RECORDS, ids=lambda record: record.__name__)
def test_every_field_is_told_with_its_plain_type(record):
    signature, told = inspect.signature(record), inspect.getdoc(record) or ""
    assert [*signature.parameters] == [*record.model_fields]
    assert not any(word in str(signature) for word in ("Annotated", "Validator", "Undefined"))
    for name, field in record.model_fields.items():
        assert name == "type" or f"    {name}: " in told
        assert not field.is_required() or signature.parameters[name].default is inspect._empty
    assert max(map(len, told.splitlines())) <= 100


@pytest.mark.parametrize("name", ["prr3", "delta", "flyball_governor", "rrs3"])
def test_what_is_written_of_a_part_makes_it_again(name):
    made = getattr(robots, name)()
    parts = [*made.bodies.values(), *made.joints.values(), *made.springs.values()]
    for part in [*parts, *made.transmissions.values(), *made.tools.values()]:
        assert eval(repr(part), vars(mechanism) | vars(lw)) == part
    assert repr(lw.RevoluteJoint(connects=("a", "b"))) == "RevoluteJoint(connects=('a', 'b'))"
