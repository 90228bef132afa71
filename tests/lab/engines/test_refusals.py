"""What the engines refuse, and the sentence they give."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from linkwork.errors import LinkworkError
from linkwork.lab import engines
from linkwork.lab.engines import EngineError
from linkwork.lab.engines.interface import load_engine
from linkwork.lab.engines.tree import planar_loop, spanning_tree
from linkwork.mechanism import Body, Mechanism, RevoluteJoint, ScrewJoint
from linkwork.robots import prr3, stewart

from tests.lab.engines.test_accelerations import bennett, wedge
from tests.oracle.random_joints import random_loops

NAMES = ("pinocchio", "mujoco", "exudyn")


@pytest.fixture(params=NAMES)
def model(request):
    pytest.importorskip(
        request.param, reason=f"the optional engine {request.param} is not installed"
    )
    return engines.build(request.param, prr3())


def test_names_and_versions():
    assert set(engines.available()) <= set(NAMES)
    assert tuple(engines.versions()) == engines.available()
    for name in engines.available():
        model = engines.build(name, prr3())
        assert (model.name, model.version) == (name, engines.versions()[name])


def test_an_unknown_engine():
    with pytest.raises(
        EngineError, match="there is no engine 'bullet'; the engines are pinocchio, mujoco, exudyn"
    ):
        engines.build("bullet", prr3())


def test_a_missing_engine(monkeypatch):
    monkeypatch.setitem(sys.modules, "pinocchio", None)
    with pytest.raises(
        LinkworkError, match=r"Pinocchio cannot be imported .*try `pip install linkwork\[engines\]`"
    ):
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


def test_a_body_without_mass_in_mujoco():
    pytest.importorskip("mujoco", reason="the optional engine mujoco is not installed")
    hinge = RevoluteJoint(connects=("ground", "ghost"))
    mechanism = Mechanism(
        name="ghost", bodies={"ghost": Body(mass=0)}, joints={"hinge": hinge}, actuators=("hinge",)
    )
    with pytest.raises(
        EngineError, match=r"MuJoCo refuses 'ghost': .*mass and inertia.* 'body ghost'"
    ):
        engines.build("mujoco", mechanism)


def test_the_spanning_tree_cuts_revolute_joints_and_tells_planar_loops():
    tree = spanning_tree(prr3())
    assert [cut.joint for cut in tree.cuts] == ["wrist_2", "wrist_3"]
    assert [item.joint for item in tree.edges[:4]] == [
        "slide_1",
        "pivot_1",
        "wrist_1",
        "slide_2",
    ]  # depth first
    assert all(planar_loop(tree, cut) for cut in tree.cuts)
    spatial = spanning_tree(bennett())
    assert not planar_loop(spatial, spatial.cuts[0])
    assert spanning_tree(wedge(0.5)).cuts[0].kind == "prismatic"


def test_a_body_without_inertia_in_pinocchio():
    pytest.importorskip("pinocchio", reason="the optional engine pinocchio is not installed")
    hinge = RevoluteJoint(connects=("ground", "ghost"))
    mechanism = Mechanism(
        name="ghost", bodies={"ghost": Body(mass=0)}, joints={"hinge": hinge}, actuators=("hinge",)
    )
    with pytest.raises(
        EngineError, match=r"ghost: Pinocchio finds no accelerations; .* without inertia"
    ):
        engines.build("pinocchio", mechanism).accelerations(np.zeros(1), np.zeros(1), np.ones(1))


def test_a_loop_of_screws_in_exudyn():
    pytest.importorskip("exudyn", reason="the optional engine exudyn is not installed")
    screw = ScrewJoint(connects=("ground", "nut"), pitch=0.01)
    mechanism = Mechanism(bodies={"nut": Body(mass=1)}, joints={"left": screw, "right": screw})
    with pytest.raises(EngineError, match=r"joints\.right: closes a loop of screws"):
        engines.build("exudyn", mechanism)


def test_bodies_that_nothing_but_rods_reaches_have_no_tree():
    mechanism = random_loops(0, 1, platform="bare")
    with pytest.raises(
        EngineError,
        match=r"bodies\.body_.*: nothing but rods reaches it; add a free joint to ground",
    ):
        spanning_tree(mechanism)


def test_actuated_joints_that_close_a_loop_are_carried():
    mechanism = bennett()
    tree = spanning_tree(mechanism.model_copy(update={"actuators": tuple(mechanism.joints)}))
    assert [cut.joint for cut in tree.cuts] == list(tree.carried) and len(tree.carried) == 1
    assert not spanning_tree(mechanism).carried


def test_joints_of_little_use_in_the_tree_are_cut():
    tree = spanning_tree(stewart())
    assert {cut.kind for cut in tree.cuts} == {"spherical", "free"} and not tree.carried
