"""Numbers too near to zero for a double are refused, not read as zero."""

from functools import partial

import pytest

from linkwork.formats import load
from linkwork.mechanism import (
    Box,
    Capsule,
    Cylinder,
    Frame,
    Mechanism,
    MechanismError,
    Polygon,
    Sphere,
)
from linkwork.robots import four_bar
from linkwork.sweeps.designs import Values
from linkwork.sweeps.study import Study

ARM = """linkwork: 1
bodies:
  arm:
    mass: {mass}
    inertia: {{zz: {zz}}}
joints:
  hinge: {{type: revolute, connects: [ground, arm]}}
"""
MJCF = """<mujoco><worldbody><body name="arm"><joint name="hinge"/>
<inertial pos="0 0 0" mass="{mass}" diaginertia="1 1 1"/></body></worldbody></mujoco>"""


@pytest.mark.parametrize("number", ["1e-400", "-1E-330", "4e-310", "0.00001e-318"])
def test_a_number_that_a_double_does_not_hold_is_refused_with_its_line(number):
    with pytest.raises(
        MechanismError,
        match=f"line 5: bodies.arm.inertia.zz: {number} is nearer to zero than any number",
    ):
        Mechanism.parse(ARM.format(mass=1, zz=number))


@pytest.mark.parametrize("number", ["0", "0.0", "0e-400", "2.3e-308", "1e-300"])
def test_zero_and_small_numbers_are_read(number):
    assert Mechanism.parse(ARM.format(mass=1, zz=number)).bodies["arm"].inertia.zz == float(number)


def test_so_it_is_in_model_files(tmp_path):
    path = tmp_path / "arm.xml"
    path.write_text(MJCF.format(mass="1e-400"))
    with pytest.raises(MechanismError, match=r"line 2.*mass: 1e-400 is nearer to zero"):
        load(path)


@pytest.mark.parametrize(
    "shape",
    [
        partial(Box, size=(1, 1, 4e-310)),
        partial(Sphere, radius=5e-324),
        partial(Cylinder, radius=1, length=1e-310),
        partial(Capsule, radius=1e-310, length=1),
        partial(Polygon, points=((0, 0), (1, 0), (0, 1)), thickness=1e-310),
        partial(Sphere, radius=1e300),
    ],
)
def test_sizes_of_shapes_are_refused_as_other_lengths_are(shape):
    with pytest.raises(MechanismError, match=r"is nearer to zero than any number|is above 1e\+50"):
        shape()


def test_so_are_the_numbers_of_a_study():
    with pytest.raises(MechanismError, match="duration: 1e-310 is nearer to zero"):
        Study(
            robot=four_bar(),
            duration=1e-310,
            vary={"crank.mass": Values(values=(1,))},
            outputs={"e": "last energy"},
        )


def test_what_follows_from_numbers_is_zero_where_it_is_nothing_beside_one(tmp_path):
    """An axis of length 2 with a component of 3e-308 has one of 1.5e-308 at length 1, which no file
    may hold."""
    arm = Mechanism.parse(
        ARM.format(mass=1, zz=1).replace("arm]}", "arm], axis: [3.0e-308, 0, 2]}")
    )
    assert arm.joints["hinge"].axis == (0, 0, 1)
    assert Frame.from_quaternion((0, 0, 0), (4, 3e-308, 0, 0)).rotation == (0, 0, 0)
    arm.save(tmp_path / "arm.yaml")
    assert Mechanism.load(tmp_path / "arm.yaml") == arm
