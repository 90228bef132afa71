"""What the engines refuse, and the sentence they give."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from linkwork import engines
from linkwork.engines import EngineError
from linkwork.engines.common import load_engine, planar_loop, spanning_tree
from linkwork.errors import LinkworkError
from linkwork.mechanism import Body, Mechanism, RevoluteJoint
from linkwork.robots import prr3

from tests.engines.test_accelerations import bennett, wedge

NAMES = ("pinocchio", "mujoco", "exudyn")


@pytest.fixture(params=NAMES)
def model(request):
    pytest.importorskip(request.param, reason=f"the optional engine {request.param} is not installed")
    return engines.build(request.param, prr3())


def test_names_and_versions():
    assert set(engines.available()) <= set(NAMES)
    assert tuple(engines.versions()) == engines.available()
    for name in engines.available():
        model = engines.build(name, prr3())
        assert (model.name, model.version) == (name, engines.versions()[name])


def test_an_unknown_engine():
    with pytest.raises(EngineError, match="there is no engine 'bullet'; the engines are pinocchio, mujoco, exudyn"):
        engines.build("bullet", prr3())


def test_a_missing_engine(monkeypatch):
    monkeypatch.setitem(sys.modules, "pinocchio", None)
    with pytest.raises(LinkworkError, match=r"Pinocchio cannot be imported .*try `pip install linkwork\[engines\]`"):
        load_engine("pinocchio", "Pinocchio")


def test_wrong_shapes_and_times(model):
    q, forces = np.zeros(9), np.zeros(3)
    with pytest.raises(EngineError, match="positions: give 9 finite numbers"):
        model.accelerations(np.zeros(3), q, forces)
    with pytest.raises(EngineError, match="rates: give 9 finite numbers"):
        model.accelerations(q, np.full(9, np.nan), forces)
    with pytest.raises(EngineError, match="forces: give 3 numbers"):
        model.accelerations(q, q, np.zeros(4))
    with pytest.raises(EngineError, match="must be positive"):
        model.simulate(q, q, lambda _: forces, 1.0, 0.0)
    with pytest.raises(EngineError, match="forces: give 3 numbers"):
        model.simulate(q, q, lambda _: np.zeros(2), 1.0, 0.1)


def test_actuated_joints_that_close_a_loop():
    mechanism = bennett()
    driven = mechanism.model_copy(update={"actuators": tuple(mechanism.joints)})
    with pytest.raises(EngineError, match=r"actuators: '.*' closes a loop of actuated joints"):
        spanning_tree(driven)


def test_a_body_without_mass_in_mujoco():
    pytest.importorskip("mujoco", reason="the optional engine mujoco is not installed")
    hinge = RevoluteJoint(connects=("ground", "ghost"))
    mechanism = Mechanism(name="ghost", bodies={"ghost": Body(mass=0)}, joints={"hinge": hinge}, actuators=("hinge",))
    with pytest.raises(EngineError, match=r"MuJoCo refuses 'ghost': .*positive.* 'body ghost'"):
        engines.build("mujoco", mechanism)


def test_the_spanning_tree_cuts_revolute_joints_and_tells_planar_loops():
    tree = spanning_tree(prr3())
    assert [cut.joint for cut in tree.cuts] == ["wrist_2", "wrist_3"]
    assert [item.joint for item in tree.edges[:4]] == ["slide_1", "pivot_1", "wrist_1", "slide_2"]  # depth first
    assert all(planar_loop(tree, cut) for cut in tree.cuts)
    spatial = spanning_tree(bennett())
    assert not planar_loop(spatial, spatial.cuts[0])
    assert spanning_tree(wedge(0.5)).cuts[0].kind == "prismatic"
