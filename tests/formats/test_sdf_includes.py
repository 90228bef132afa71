"""SDF models of other files: what an <include> says of them, and what their own files say."""

import numpy as np
import pytest

from linkwork.mechanism import MechanismError

from tests.formats.test_sdf import LINK, joint, model, read

ARM = LINK.format("arm", "0 0 1 0 0 0", 1) + joint("s", "revolute", "world", "arm")
PALM = LINK.format("palm", "0 0 0 0 0 0", 1)
HAND = "<include{}><uri>hand</uri><name>hand</name>{}</include>"
WORLD = "<sdf version='{}'><world name='w'>{}</world></sdf>"


def hand(folder, *parts, name="model.sdf", **more):
    (folder / "hand").mkdir(exist_ok=True)
    (folder / "hand" / name).write_text(model(*(parts or [PALM]), **more))


@pytest.mark.parametrize(("version", "axis"), [("1.4", (0, 1, 0)), ("1.9", (0, 0, 1))])
@pytest.mark.parametrize("main", ["1.4", "1.9"])
def test_axes_are_in_the_frame_that_the_version_of_their_own_file_says(
    main, version, axis, tmp_path
):
    turned = LINK.format("palm", f"0 0 0 {np.pi / 2} 0 0", 1)
    hinge = joint("j", "revolute", "world", "palm", "<axis><xyz>0 0 1</xyz></axis>")
    hand(tmp_path, turned, hinge, version=version)
    found = read(WORLD.format(main, HAND.format("", "")), tmp_path).mechanism.joints["j"]
    np.testing.assert_allclose(found.axis, axis, atol=1e-12)


@pytest.mark.parametrize(("version", "word"), [("1.6", "frame"), ("1.9", "relative_to")])
def test_poses_are_relative_to_what_the_version_calls_so(version, word, tmp_path):
    far = LINK.format("far", "1 0 0 0 0 0", 1).replace("<pose>", f"<pose {word}='arm'>")
    text = model(ARM, far, joint("t", "revolute", "arm", "far"), version=version)
    at = read(text, tmp_path).mechanism.joints["t"].frames[0].position
    np.testing.assert_allclose(at, (1, 0, 0), atol=1e-12)


@pytest.mark.parametrize(("own", "says", "still"), [(1, 0, False), (0, 1, True), (1, "", True)])
def test_an_include_says_whether_its_model_stands_still(own, says, still, tmp_path):
    hand(tmp_path, f"<static>{own}</static>", PALM)
    said = f"<static>{says}</static>" if says != "" else ""
    text = WORLD.format("1.9", HAND.format("", said) + f"<model name='m'>{ARM}</model>")
    assert ("hand::palm" in read(text, tmp_path).mechanism.bodies) != still


def test_a_folder_has_the_file_of_the_latest_version(tmp_path):
    for name, link in (("old.sdf", "old"), ("new.sdf", "new"), ("odd.sdf", "odd")):
        hand(tmp_path, LINK.format(link, "0 0 0 0 0 0", 1), name=name)
    (tmp_path / "hand/model.config").write_text(
        "<model><sdf>odd.sdf</sdf><sdf version='1.10'>new.sdf</sdf><sdf version='1.9'>old.sdf</sdf>"
        "</model>"
    )
    assert "hand::new" in read(model(ARM, HAND.format("", "")), tmp_path).mechanism.bodies


def test_what_an_include_changes_of_its_model_is_warned_of(tmp_path):
    hand(tmp_path)
    more = "<plugin name='p' filename='libbuoyancy.so'/><experimental:params/>"
    caveats = read(model(ARM, HAND.format("", more)), tmp_path).mechanism.caveats
    assert any("<plugin 'p'> is left out: it is a program, which acts" in told for told in caveats)
    assert any("<experimental:params> is left out" in told for told in caveats)


def test_a_second_model_of_an_included_file_is_warned_of(tmp_path):
    hand(tmp_path)
    text = (tmp_path / "hand/model.sdf").read_text()
    again = text[text.index("<model") : text.index("</sdf>")].replace("name='m'", "name='n'")
    (tmp_path / "hand/model.sdf").write_text(text.replace("</sdf>", f"{again}</sdf>"))
    (told,) = read(model(ARM, HAND.format("", "")), tmp_path).mechanism.caveats
    assert "is left out: of a file that is included the first model counts" in told


@pytest.mark.parametrize(
    ("parts", "words"),
    [
        ((ARM.replace("arm", "palm"), HAND.format(" merge='1'", "")), "brings 'palm', and its"),
        ((ARM, *2 * [HAND.format(" merge='1'", "")]), "brings 'palm', and its model has a part of"),
        ((ARM, "<include><uri>a.urdf</uri></include>"), "linkwork convert a.urdf a.sdf"),
        ((LINK.format("", "0 0 0 0 0 0", 1),), "is called '', which is no name; give it one"),
        ((ARM, "<model name='::'/>"), "<model '::'>: is called '::', which is no name"),
    ],
)
def test_refusals(parts, words, tmp_path):
    hand(tmp_path)
    (tmp_path / "a.urdf").write_text("<robot name='r'><link name='a'/></robot>")
    with pytest.raises(MechanismError, match=words):
        read(model(*parts), tmp_path)
