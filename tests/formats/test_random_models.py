"""Model files in which many features meet, drawn at random: what they make of the motion is what
other engines make of it, to rounding."""

import numpy as np
import pytest

import linkwork as lw
from linkwork.formats import load, save

from tests.formats import mujoco_side as side
from tests.formats.random_models import Mjcf, Sdf, Urdf

NEAR = 1e-9


@pytest.mark.sample(4)
@pytest.mark.parametrize("seed", range(20))
def test_mjcf_moves_as_in_mujoco(seed, tmp_path):
    path = tmp_path / "model.xml"
    path.write_text(Mjcf(seed).text())
    side.compiled(path)
    assert not load(path).mechanism.caveats
    assert side.apart(load(path).mechanism, path, seed) < NEAR


@pytest.mark.sample(4)
@pytest.mark.parametrize("seed", range(10))
def test_sdf_moves_as_what_it_says_plainly(seed, tmp_path):
    path, drawn = tmp_path / "model.sdf", Sdf(seed)
    path.write_text(drawn.text())
    assert not load(path).mechanism.caveats
    assert side.apart(load(path).mechanism, drawn.plainly(), seed) < NEAR


@pytest.mark.sample(4)
@pytest.mark.parametrize("seed", range(10))
def test_urdf_moves_as_in_pinocchio(seed, tmp_path):
    """Mimics hold there by the projection of M a = f on the motions that they leave."""
    pin = pytest.importorskip("pinocchio")
    path, drawn = tmp_path / "model.urdf", Urdf(seed)
    path.write_text(drawn.text())
    robot, model = lw.Robot(load(path).mechanism), pin.buildModelFromUrdf(str(path))
    random, data = np.random.default_rng(seed), model.createData()
    state = robot.assemble({name: random.uniform(-1, 1) for name in robot.independent})
    state = state.with_rates(random.normal(size=robot.mobility))
    rates = dict(zip(robot.rates, robot.joint_rates(state), strict=True))
    free = robot.forward_dynamics(state, np.zeros(len(robot.actuators)))
    found = dict(zip(robot.rates, robot.joint_accelerations(state, free), strict=True))
    # Its coordinates: cosine and sine of what turns without end.
    q, v, N = pin.neutral(model), np.zeros(model.nv), np.eye(model.nv)
    names = [name.replace(".", "_") for name in model.names[1:]]
    for name, joint in zip(names, model.joints[1:], strict=True):
        x = float(state[name])
        q[joint.idx_q :][: joint.nq] = [x] if joint.nq == 1 else [np.cos(x), np.sin(x)]
        v[joint.idx_v] = rates[name]
    rows = np.zeros((len(drawn.mimics), model.nv))
    for row, (name, (other, factor)) in zip(rows, drawn.mimics.items(), strict=True):
        for joint, part in ((name, 1.0), (other, -factor)):
            row[model.joints[model.getJointId(joint)].idx_v] += part
    if len(rows):
        N = np.linalg.svd(rows)[2][len(rows) :].T
    M = np.triu(pin.crba(model, data, q))
    M = M + np.triu(M, 1).T
    bias = pin.rnea(model, data, q, v, np.zeros(model.nv))
    wanted = N @ np.linalg.solve(N.T @ M @ N, -N.T @ bias)
    ours = np.array([found[name] for name in names])
    assert np.abs(ours - wanted).max() < NEAR * np.abs(wanted).max()


TURNED = """<sdf version="1.9"><model name="m">{joint}<link name="l"><pose>0 0 1 0.4 0 0</pose>\
<inertial><mass>1</mass></inertial></link></model></sdf>"""
BALL = """<joint name="b" type="ball"><pose>0 0 0 {} 0 0</pose><parent>world</parent>\
<child>l</child></joint>"""


@pytest.mark.parametrize(
    ("joint", "told"),
    [(BALL.format(0.3), "no axes of a ball"), (BALL.format(0), None), ("", "no frames of a free")],
)
def test_axes_that_mjcf_has_none_of_are_told(joint, told, tmp_path):
    """Rates of a ball are about its first frame's axes here, and about its body's when MJCF is read
    back; a free joint's coordinates are there those of its body in the world."""
    path = tmp_path / "model.sdf"
    path.write_text(TURNED.format(joint=joint))
    notes = save(load(path).mechanism, tmp_path / "model.xml")
    found = [note for note in notes if "MJCF has no" in note]
    assert len(found) == bool(told) and all(str(told) in note for note in found)
