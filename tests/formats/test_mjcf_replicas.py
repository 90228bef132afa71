"""Replicas are those that MuJoCo's compiler makes: names, poses, and what refers to them."""

import mujoco as mj
import numpy as np
import pytest

import linkwork as lw
from linkwork.formats import load

from tests.formats.test_mjcf_actuators import compared

ROW = """<mujoco><compiler angle="degree" eulerseq="zyx"/>
<default><geom contype="0" conaffinity="0"/></default>
<worldbody>
 <body name="base"><joint name="q" axis="0 0 1"/><geom size="0.1" mass="2"/>
  <frame pos="0 0 1">
   <replicate count="{count}" offset="1 0 0.5" euler="30 5 0" sep="-">
    <site name="s" pos="0.1 0 0"/>
    <body name="b" pos="0 1 0">
     <joint name="j" axis="0 1 0" damping="0.1"/><geom name="g" size="0.1" pos="0.2 0 0"/>
     <replicate count="2" offset="0.1 0 0">
      <body name="c"><joint name="k" axis="1 0 0"/><geom size="0.05" pos="0 0 0.1"/></body>
     </replicate>
    </body>
   </replicate>
  </frame>
 </body>
</worldbody>
<tendon><fixed name="t"><joint joint="j" coef="1"/><joint joint="q" coef="2"/></fixed></tendon>
<actuator><position name="m" joint="j" kp="3"/><motor name="n" joint="q"/><motor tendon="t"/>
<motor site="s" gear="0 0 1 0 0 0"/></actuator>
</mujoco>"""


def test_replicas_are_mujocos(tmp_path):
    path = tmp_path / "row.xml"
    path.write_text(ROW.format(count=3))
    model = mj.MjModel.from_xml_path(str(path))
    mechanism = load(path).mechanism
    names = {model.body(i).name for i in range(1, model.nbody)}
    assert names == {*mechanism.bodies} and "c1-2" in names
    assert mechanism.actuators[:3] == ("q", "j-0", "t-0") and model.nu == len(mechanism.actuators)
    assert compared(path, tmp_path) < 1e-12


@pytest.mark.parametrize("count", [9, 10, 11])
def test_numbers_have_as_many_digits_as_their_count(count, tmp_path):
    path = tmp_path / "row.xml"
    path.write_text(ROW.format(count=count))
    model = mj.MjModel.from_xml_path(str(path))
    names = {model.body(i).name for i in range(1, model.nbody)}
    assert names == {*load(path).mechanism.bodies} and {f"b-{0:0{len(str(count))}d}"} <= names


def test_a_tie_to_what_is_no_replica_is_left_out_as_mujoco_does(tmp_path):
    path = tmp_path / "row.xml"
    tie = '<equality><connect body1="b" body2="base" anchor="0 0 0"/></equality>'
    path.write_text(ROW.format(count=2).replace("<tendon>", f"{tie}<tendon>"))
    assert mj.MjModel.from_xml_path(str(path)).neq == 0
    imported = load(path)
    assert any("it ties a replica to what is none" in note for note in imported.notes)
    assert not imported.mechanism.caveats


@pytest.mark.parametrize(
    ("count", "sentence"),
    [("1.5", "count is 1.5; give a whole number"), ("1e9", "makes more than")],
)
def test_counts_that_are_refused(count, sentence, tmp_path):
    path = tmp_path / "row.xml"
    path.write_text(ROW.format(count=count))
    with pytest.raises(lw.MechanismError, match=sentence):
        load(path)


def test_files_are_included_from_stated_folders_alone(tmp_path):
    (tmp_path / "robots").mkdir()
    (tmp_path / "shared").mkdir()
    part = '<mujocoinclude><joint name="j"/><geom size="0.1"/></mujocoinclude>'
    (tmp_path / "shared" / "part.xml").write_text(part)
    path = tmp_path / "robots" / "arm.xml"
    for name in ("../shared/part.xml", "part.xml"):
        body = f'<body name="b"><include file="{name}"/></body>'
        path.write_text(f"<mujoco><worldbody>{body}</worldbody></mujoco>")
        with pytest.raises(lw.MechanismError):
            load(path)
        mechanism = load(path, includes=tmp_path / "shared").mechanism
        assert mechanism.coordinates == ("j",)
    assert np.isclose(mechanism.bodies["b"].mass, 4 / 3 * np.pi)
    # Those of the model's own folder come first, as they do without stated ones.
    (tmp_path / "robots" / "part.xml").write_text(part.replace('"j"', '"own"'))
    assert load(path, includes=tmp_path / "shared").mechanism.coordinates == ("own",)
    with pytest.raises(lw.LinkworkError, match="which is no folder"):
        load(path, includes=tmp_path / "nowhere")


def test_what_an_unread_element_would_have_made_is_no_other_fault(tmp_path):
    path = tmp_path / "rope.xml"
    made = '<composite type="cable" curve="s" count="4 1 1" size="1" prefix="r"/>'
    held = '<equality><connect body1="rB_last" anchor="0 0 0"/></equality>'
    path.write_text(f"<mujoco><worldbody><body>{made}</body></worldbody>{held}</mujoco>")
    with pytest.raises(lw.MechanismError, match=r"<composite>: makes bodies.*no body 'rB_last'"):
        load(path)
