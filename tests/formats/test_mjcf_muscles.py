"""Muscles: activation and pull are MuJoCo's, of joints, tendons of joints and cables."""

import dataclasses

import mujoco as mj
import numpy as np
import pytest

import linkwork as lw
from linkwork import control
from linkwork.formats import load, save

from tests.formats.test_mjcf_actuators import ARM as CHAIN
from tests.formats.test_mjcf_actuators import compared
from tests.formats.test_mjcf_tendons import ARM

MUSCLES = """
<muscle name="m" joint="j1" gear="0.3" lengthrange="-0.4 0.5" force="30" vmax="3" lmax="1.4"
 range="0.6 1.2" timeconst="0.02 0.05" ctrlrange="0.1 0.7"/>
<muscle name="s" tendon="split" lengthrange="-1 1.5" scale="40" tausmooth="0.3" fvmax="1.4"/>
<muscle name="j" joint="j4" gear="-1" lengthrange="-2 2" fpmax="0.7" lmin="0.3"/>"""
# The same in the words of <general>, as models of MyoSuite have it.
PRM = "0.6 1.2 30 200 0.5 1.4 3 1.3 1.2 0"
GENERAL = f"""
<general name="m" joint="j1" gear="0.3" lengthrange="-0.4 0.5" ctrlrange="0.1 0.7"
 gaintype="muscle" biastype="muscle" dyntype="muscle" dynprm="0.02 0.05" gainprm="{PRM}"
 biasprm="{PRM}"/>
<general name="s" tendon="split" lengthrange="-1 1.5" class="flesh" gainprm="0.75 1.05 -1 40"
 biasprm="0.75 1.05 -1 40"/>"""
FLESH = """<default><default class="flesh"><general gaintype="muscle" biastype="muscle"
 dyntype="muscle" dynprm="0.01 0.04 0.3" gainprm="1 1 1 1 0.5 1.6 1.5 1.3 1.4"
 biasprm="1 1 1 1 0.5 1.6 1.5 1.3 1.4"/></default></default>"""
MODEL = control.Muscle(
    peak_force=7.0, optimum_length=0.4, tendon_length=0.2, fastest=2.0, lengthening=1.3
)


@pytest.mark.parametrize("blend", [0.0, 0.4])
def test_the_law_is_the_one_that_mujoco_computes(blend):
    """At lengths and rates on all pieces of its curves, activations outside of 0 and 1 included."""
    random, muscle = np.random.default_rng(4), dataclasses.replace(MODEL, blend=blend)
    prm = np.array([0.0, 1.0, 7.0, 0.0, 0.5, 1.6, 2.0, 1.3, 1.3])
    lengths, times = np.array([0.2, 0.6]), np.array([0.01, 0.04, blend])
    for _ in range(300):
        length, rate = random.uniform(0.3, 1.0), random.uniform(-1.2, 1.2)
        command, a = random.uniform(-0.3, 1.3), random.uniform(-0.2, 1.2)
        force, (change,) = muscle.equations(command, length, rate, (a,))
        gain = mj.mju_muscleGain(length, rate, lengths, 1.0, prm)
        assert force == pytest.approx(gain * a + mj.mju_muscleBias(length, lengths, 1.0, prm))
        assert change == pytest.approx(mj.mju_muscleDynamics(command, a, times))


@pytest.fixture
def cables(tmp_path):
    """The muscle's force, and the servo's damping, follow from the inertia at qpos0."""
    path = tmp_path / "arm.xml"
    muscle = '<muscle tendon="t1" lengthrange="0.3 1.2" gear="1.1"/><position tendon="t3" kp="10" '
    actuators = f'<actuator>{muscle} dampratio="0.7"/></actuator></mujoco>'
    text = ARM[: ARM.index("<actuator>")] + actuators
    path.write_text(text.replace('name="t3"', 'name="t3" armature="0.2"'))
    path.write_text(path.read_text().replace("springdamper", "user"))
    return path


@pytest.fixture
def chain(tmp_path):
    path = tmp_path / "chain.xml"
    path.write_text(CHAIN.format(joint="", actuators=MUSCLES))
    return path


@pytest.fixture
def general(tmp_path):
    path = tmp_path / "general.xml"
    text = CHAIN.format(joint="", actuators=GENERAL)
    path.write_text(text.replace("<worldbody>", f"{FLESH}<worldbody>"))
    return path


@pytest.mark.sample(2)
@pytest.mark.parametrize("which", ["cables", "chain", "general"])
def test_muscles_pull_as_in_mujoco(which, request, tmp_path):
    path = request.getfixturevalue(which)
    imported = load(path)
    assert not imported.mechanism.caveats
    assert not any("plain actuator" in note for note in imported.notes)
    assert compared(path, tmp_path) < 1e-12
    save(imported.mechanism, tmp_path / "again.xml")
    assert compared(tmp_path / "again.xml", tmp_path) < 1e-12


def test_a_run_has_the_activations_of_mujocos(chain):
    """In small steps of both; an explicit Euler step of MuJoCo is of first order."""
    robot = lw.Robot(load(chain).mechanism)
    run = robot.simulate(
        robot.home, [0.5, 0.8, 0.2], duration=0.02, drives=robot.drives, rtol=1e-10
    )
    model = mj.MjModel.from_xml_path(str(chain))
    model.opt.integrator, model.opt.timestep = mj.mjtIntegrator.mjINT_RK4, 2e-5
    data = mj.MjData(model)
    data.ctrl[:] = 0.5, 0.8, 0.2
    mj.mj_step(model, data, 1000)
    np.testing.assert_allclose(run.final.q, data.qpos, atol=1e-7)


@pytest.mark.parametrize(
    ("more", "why"),
    [("", "it has no lengthrange"), ('lengthrange="0 1" forcerange="-9 0"', "has no forcerange")],
)
def test_a_muscle_that_is_none_here_is_noted(more, why, tmp_path):
    path = tmp_path / "chain.xml"
    path.write_text(CHAIN.format(joint="", actuators=f'<muscle joint="j1" {more}/>'))
    imported = load(path)
    assert not imported.mechanism.drives
    assert any("is taken as a plain actuator" in note and why in note for note in imported.notes)


@pytest.mark.parametrize(
    "wrong", [{"least_length": 1.2}, {"lengthening": 1.0}, {"largest_excitation": 1.5}]
)
def test_curves_that_do_not_rise_are_refused(wrong):
    with pytest.raises(lw.LinkworkError, match=f"of Muscle do not fit.*{next(iter(wrong))}"):
        dataclasses.replace(MODEL, **wrong)
