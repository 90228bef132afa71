"""Programs in files are not run: those that act on the motion by their name are warned of."""

import pytest

from linkwork.formats import load

SDF = """<sdf version="1.9"><world name="w">{world}<wind/><atmosphere type="adiabatic"/>
<model name="m">{model}<link name="a"/></model></world></sdf>"""
LINK = """<link name="{}"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
URDF = f"""<robot name="r"><link name="a"/>{LINK.format("b")}{LINK.format("c")}
<joint name="j" type="continuous"><parent link="a"/><child link="b"/></joint>
<joint name="k" type="continuous"><parent link="b"/><child link="c"/>{{mimic}}</joint>
<gazebo>{{plugin}}</gazebo></robot>"""
MIMIC = """<plugin name="x" filename="libsome_mimic_joint_plugin.so"><joint>j</joint>
<mimicJoint>k</mimicJoint></plugin>"""


@pytest.mark.parametrize(
    ("filename", "acts"),
    [
        ("gz-sim-physics-system", False),
        ("gz-sim-buoyancy-system", True),
        ("libLiftDragPlugin.so", True),
        ("gz-sim-wind-effects-system", True),
        ("gz-sim-detachable-joint-system", True),
    ],
)
@pytest.mark.parametrize("place", ["world", "model"])
def test_programs_that_push_or_tie_bodies_are_warned_of(filename, acts, place, tmp_path):
    parts = {"world": "", "model": ""} | {place: f'<plugin name="p" filename="{filename}"/>'}
    path = tmp_path / "model.sdf"
    path.write_text(SDF.format(**parts))
    imported = load(path)
    assert any("it is a program" in note for note in imported.notes)
    assert len(imported.mechanism.caveats) == acts
    assert not any("wind>" in note or "atmosphere" in note for note in imported.notes)


@pytest.mark.parametrize("mimic", ["", '<mimic joint="j"/>'])
def test_programs_that_mimic_are_warned_of_where_the_file_itself_does_not(mimic, tmp_path):
    path = tmp_path / "model.urdf"
    path.write_text(URDF.format(mimic=mimic, plugin=MIMIC))
    caveats = load(path).mechanism.caveats
    assert len(caveats) == (not mimic)
    assert all("'mimic'" in caveat for caveat in caveats)
