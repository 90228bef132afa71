"""Functions of long expressions: CasADi is not asked what is computed twice, and runs of large
trees ask once how long their motion is."""

import numpy as np
import pytest

import linkwork as lw
from linkwork.equations import functions
from linkwork.kernels import Kernel
from linkwork.model import charts

from tests.catalogue import built


@pytest.mark.parametrize("name", ["prr3", "rrs3", "puma560"])
def test_kernels_find_what_is_computed_twice(name, monkeypatch):
    """The code of a function in which CasADi looked for it does the same operations."""
    robot = built(name)
    shared = functions.motion(robot.equations)
    monkeypatch.setattr(functions, "LONG", 0)
    plain = functions.motion(robot.equations)
    assert plain.n_instructions() > shared.n_instructions()
    kernels = Kernel(shared), Kernel(plain)
    assert kernels[1].operations == kernels[0].operations
    given = robot.home.q, np.linspace(0.3, 0.7, robot.mobility), np.ones(len(robot.actuators))
    for one, other in zip(*(kernel(*given, robot.p) for kernel in kernels), strict=True):
        assert np.array_equal(one, other)


def test_a_large_tree_runs_in_its_own_chart_without_another_one_derived(monkeypatch):
    """Its accelerations are found body by body, in whatever order the rates are named."""
    bodies = {
        f"link_{k}": lw.Body(mass=1.0, inertia=lw.Inertia(xx=1, yy=1, zz=1)) for k in range(25)
    }
    joints: dict[str, lw.mechanism.Joint] = {"base": lw.FreeJoint(connects=("ground", "link_0"))}
    joints |= {
        f"pin_{k}": lw.RevoluteJoint(connects=(f"link_{k - 1}", f"link_{k}")) for k in range(1, 25)
    }
    robot = lw.Robot(lw.Mechanism(bodies=bodies, joints=joints))
    monkeypatch.setattr(functions, "motion", lambda _: pytest.fail("derived"))
    assert charts.shorter(robot.chart, robot.home.q) is robot.chart
