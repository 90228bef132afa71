"""The regressor: linear in the parameters, equal to inverse dynamics, and no column but by what its
name says."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from linkwork import robots
from linkwork.equations import derive, functions, regressor
from linkwork.mechanism.numbers import edited

from tests.equations.evaluation import close, values
from tests.oracle.random_joints import grown, random_loops, random_tree

CASES = {
    "tree": partial(random_tree, 1, 9, effects=True, gears=1, actuation=-2),
    "loops with everything": partial(
        random_loops, 5, 2, effects=True, rods=1, gears=1, freedoms=2, actuation=1
    ),
    "loop closed by a free joint": partial(random_loops, 8, 1, effects=True, platform="free"),
    "springs and friction that grow": lambda: grown(random_tree(1, 9, effects=True, actuation=-2)),
    "planar loops": partial(
        random_loops, 5, 2, planar=True, effects=True, rods=1, gears=1, actuation=-1
    ),
    "3-PRR": robots.prr3,
}


@pytest.fixture(params=CASES, scope="module")
def case(request):
    mechanism = CASES[request.param]()
    equations = derive(mechanism)
    made = functions.regressor(equations), functions.inverse_dynamics(equations)
    return mechanism, equations, *made


def at_random(equations) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    random = np.random.default_rng(4)
    return equations.reference, *(random.normal(size=equations.mobility) for _ in range(2))


@pytest.mark.sample(2)
def test_it_is_inverse_dynamics(case):
    mechanism, equations, linear, inverse_dynamics = case
    q, v, dv = at_random(equations)
    out = values(linear, q, v, dv)
    pi = regressor.values(mechanism)
    assert len(regressor.names(mechanism)) == pi.size
    Y = out["Y"].reshape(equations.mobility, pi.size)
    close(
        Y @ pi + out["rest"],
        values(inverse_dynamics, q, v, dv)["forces"],
        1e-11,
    )
    terms = values(functions.terms(equations), q, v)
    M = terms["M"].reshape(v.size, v.size)
    close(Y @ pi + out["rest"], M @ dv + terms["Cv"] + terms["G"] - terms["f"], 1e-11)


@pytest.mark.sample(3)
def test_it_does_not_depend_on_masses_and_friction(case):
    mechanism, equations, linear, inverse_dynamics = case
    body = next(iter(mechanism.bodies))
    light = edited(mechanism, {f"bodies.{body}.mass": 7.0, f"bodies.{body}.com.x": 0.3})
    q, v, dv = at_random(equations)
    Y = values(linear, q, v, dv)["Y"]
    other = derive(light, equations.independent)
    close(values(functions.regressor(other), q, v, dv)["Y"], Y, 1e-11)
    close(
        Y.reshape(v.size, -1) @ (regressor.values(light) - regressor.values(mechanism)),
        values(functions.inverse_dynamics(other), q, v, dv)["forces"]
        - values(inverse_dynamics, q, v, dv)["forces"],
        1e-11,
    )


def test_names():
    names = regressor.names(robots.prr3())
    assert names[:10] == tuple(
        f"slider_1.{part}"
        for part in (
            *("mass", "first_moment.x", "first_moment.y", "first_moment.z"),
            *(f"inertia_at_origin.{element}" for element in ("xx", "yy", "zz", "xy", "xz", "yz")),
        )
    )
    assert names[70:73] == (
        "slide_1.friction.viscous",
        "slide_1.friction.coulomb",
        "slide_1.rotor_inertia",
    )
