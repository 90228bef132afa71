"""XML that is broken, hostile or too large is refused in one sentence, quickly; garbled models
never end in a traceback."""

from xml.etree import ElementTree as ET

import mujoco
import pytest

from linkwork.formats import load, xml
from linkwork.mechanism import MechanismError

from tests.catalogue import WHOLE
from tests.formats import samples

BOMB = (
    '<?xml version="1.0"?><!DOCTYPE lolz [<!ENTITY a "aaaaaaaaaa">'
    + "".join(f'<!ENTITY {chr(98 + k)} "{("&" + chr(97 + k) + ";") * 10}">' for k in range(9))
    + ']><mujoco model="&j;"/>'
)
HOSTILE = {
    BOMB: "declares a document type or entities, which are not read; remove <!DOCTYPE ...>",
    (
        '<!DOCTYPE mujoco SYSTEM "http://example.org/x.dtd"><mujoco/>'
    ): "declares a document type or entities",
    (
        '<!DOCTYPE mujoco [<!ENTITY x SYSTEM "file:///etc/passwd">]><mujoco model="&x;"/>'
    ): "declares a document type",
    "<mujoco>\n<worldbody>\n</mujoco>": "line 3: is not well-formed XML: mismatched tag",
    (
        "<mujoco>\n<body name=a/></mujoco>"
    ): "line 2: is not well-formed XML: not well-formed (invalid token)",
    '<mujoco model="&x;"/>': "line 1: is not well-formed XML: undefined entity",
    "": "is not well-formed XML: no element found",
    "\0\1\2": "is not well-formed XML",
    '<?xml version="1.0" encoding="klingon"?><mujoco/>': "encoding",
    "<mujoco>"
    + "<body>" * 300
    + "</body>" * 300
    + "</mujoco>": "line 1: elements are nested deeper than 250",
    "<usd version='1.9'/>": (
        "<usd>: is not the root of a model known here; MJCF begins with <mujoco>, URDF with "
        "<robot>, SDF with <sdf>"
    ),
}


@pytest.mark.parametrize("text", HOSTILE)
def test_hostile_and_broken_text(text, tmp_path):
    path = tmp_path / "model.xml"
    path.write_bytes(text.encode("utf-8"))
    with pytest.raises(MechanismError) as refusal:
        load(path)
    assert str(refusal.value).startswith(str(path))
    assert HOSTILE[text] in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_files_that_are_too_large(tmp_path):
    path = tmp_path / "model.xml"
    path.write_bytes(b"<mujoco>" + b" " * 20_000_000 + b"</mujoco>")
    with pytest.raises(MechanismError, match="is larger than 20 MB"):
        load(path)


def test_files_of_too_many_elements(tmp_path, monkeypatch):
    monkeypatch.setattr(xml, "MOST", 1000)
    path = tmp_path / "model.xml"
    path.write_text("<mujoco>\n" + "<worldbody/>\n" * 1000 + "</mujoco>")
    with pytest.raises(MechanismError, match="line 1001: holds more than 1000 elements"):
        load(path)


def test_what_is_no_file(tmp_path):
    with pytest.raises(
        MechanismError, match=r"none\.xml: cannot be read: no such file or directory"
    ):
        load(tmp_path / "none.xml")
    (tmp_path / "folder.xml").mkdir()
    with pytest.raises(MechanismError, match=r"folder\.xml: is not a file; name a model file"):
        load(tmp_path / "folder.xml")


def test_other_encodings_are_read(tmp_path):
    path = tmp_path / "model.xml"
    path.write_bytes(
        '<?xml version="1.0" encoding="iso-8859-1"?><mujoco model="Gerät"/>'.encode("latin-1")
    )
    assert load(path).mechanism.name == "Gerät"


BROKEN = {
    "blank lines first": ("<?xml", "\n\n <?xml"),
    "words first": ('<?xml version="1.0"?>', "a model > of mine"),
    "half a declaration": ("<?xml", "?xml"),
    "hyphens in comments": ("</worldbody>", "<!-- a -- <b/> --->\n</worldbody>"),
    "a comment that is none": ("</worldbody>", "<!-\\- a\n <b/ -\\->\n</worldbody>"),
    "a lone ampersand": (
        "</worldbody>",
        '</worldbody><custom><text name="x" data="R & D"/></custom>',
    ),
    "attributes that touch": ('name="a" pos', 'name="a"pos'),
    "an unprinted character": ("</worldbody>", "\x0b</worldbody>"),
    "Windows letters": ("</worldbody>", "<!-- Größe -->\n</worldbody>"),
    "the last end tag twice": ("</worldbody></mujoco>", "</worldbody>\n  </mujoco>\n</mujoco>"),
    "a document type of a name": ("<mujoco", "<!DOCTYPE mujoco>\n<mujoco"),
}
WELL_FORMED = """<?xml version="1.0"?>
<mujoco model="m"><worldbody>
 <body name="a" pos="0 0 1"><joint name="j" foo="1"/><geom size="0.1"/></body>
</worldbody></mujoco>
"""


@pytest.mark.parametrize("kind", BROKEN)
def test_what_tinyxml_reads_is_read_in_the_same_lines(kind, tmp_path):
    path = tmp_path / "model.xml"
    path.write_text(WELL_FORMED)
    right = load(path)
    broken = WELL_FORMED.replace(*BROKEN[kind])
    path.write_bytes(broken.encode("cp1252"))
    theirs = tmp_path / "theirs.xml"
    theirs.write_bytes(broken.replace(' foo="1"', "").encode("cp1252"))
    assert mujoco.MjModel.from_xml_path(str(theirs)).nq == 1
    imported = load(path)
    assert imported.mechanism.model_copy(update={"caveats": ()}) == right.mechanism.model_copy(
        update={"caveats": ()}
    )
    line = 1 + broken[: broken.index("<joint")].count("\n")
    assert any(f"line {line}: <joint 'j'> says foo" in note for note in imported.notes)


def test_what_stands_behind_the_end_of_the_root_is_passed_over_and_told(tmp_path):
    """MuJoCo reads the first root and stops at the next end tag: a model of one hinge."""
    path = tmp_path / "model.xml"
    text = WELL_FORMED.replace(' foo="1"', "")
    behind = "<!-- <a/> -->\n<site/>\n</spatial>\n<mujoco><worldbody/></mujoco>"
    path.write_text(text + behind)
    assert mujoco.MjModel.from_xml_path(str(path)).nq == 1
    imported = load(path)
    assert imported.mechanism.joints.keys() == {"j"}
    line = 1 + (text + behind).split("<site")[0].count("\n")
    told = f"model.xml, line {line}: <what stands behind </mujoco>> is left out"
    assert [note for note in imported.notes if told in note]
    path.write_text(text + "<!-- <a/> --></mujoco>")
    assert not load(path).notes


@pytest.mark.long
def test_mending_takes_time_by_the_length_of_the_file(tmp_path):
    path = tmp_path / "model.xml"
    for start in ("<!--", " ", "&", '="', "<?xml "):
        path.write_text("<mujoco>" + start * (4_000_000 // len(start)))
        with pytest.raises(MechanismError, match="is not well-formed XML"):
            load(path)


def test_includes_in_a_circle_and_without_end(tmp_path):
    path = tmp_path / "model.xml"
    path.write_text('<mujoco><include file="one.xml"/></mujoco>')
    (tmp_path / "one.xml").write_text('<mujocoinclude><include file="model.xml"/></mujocoinclude>')
    with pytest.raises(MechanismError, match="is included twice; include it once"):
        load(path)
    for k in range(60):
        (tmp_path / f"{k}.xml").write_text(
            f'<mujocoinclude><include file="{k + 1}.xml"/></mujocoinclude>'
        )
    path.write_text('<mujoco><include file="0.xml"/></mujoco>')
    with pytest.raises(MechanismError, match="more than 50 files are included"):
        load(path)


def test_a_link_does_not_lead_out_of_the_folder(tmp_path):
    (tmp_path / "secret.xml").write_text("<mujocoinclude/>")
    (tmp_path / "models").mkdir()
    (tmp_path / "models" / "link.xml").symlink_to(tmp_path / "secret.xml")
    path = tmp_path / "models" / "model.xml"
    path.write_text('<mujoco><include file="link.xml"/></mujoco>')
    with pytest.raises(MechanismError, match="lies outside the model's folder and is not opened"):
        load(path)


# ----------------------------------------------------------------------------------- garbled models

WORDS = ("", "nan", "x", "1 2", "-1", "0", "world", "a.b", None)
FEW = 1000 if WHOLE else 20  # elements


def garbled(text):
    """Yield the document with each attribute in turn replaced or missing, each element left out,
    doubled or renamed, and each text replaced or missing.

    An attribute, and a text, meets a third of the words, of many elements a ninth, the next one
    the next.
    """
    turn = 0
    count = len(list(ET.fromstring(text).iter()))
    apart = 3 if count < FEW else 9
    for place in range(1, count):
        for change in ("drop", "double", "rename"):
            root = ET.fromstring(text)
            element, parents = (
                list(root.iter())[place],
                {child: parent for parent in root.iter() for child in parent},
            )
            if change == "drop":
                parents[element].remove(element)
            elif change == "double":
                parents[element].append(element)
            else:
                element.tag = "blob"
            yield ET.tostring(root)
        root = ET.fromstring(text)
        element = list(root.iter())[place]
        if element.text and element.text.strip():
            own = element.text
            turn += 1
            for word in WORDS[turn % apart :: apart]:
                element.text = word
                yield ET.tostring(root)
            element.text = own
        for name, value in list(element.attrib.items()):
            turn += 1
            for word in WORDS[turn % apart :: apart]:
                element.attrib.pop(name) if word is None else element.set(name, word)
                yield ET.tostring(root)
            element.set(name, value)


@pytest.mark.long
@pytest.mark.parametrize("name", samples.MODELS)
def test_garbled_models_are_read_or_refused(name, tmp_path):
    path = tmp_path / name
    refused = accepted = 0
    for text in garbled(samples.MODELS[name]):
        path.write_bytes(text)
        try:
            load(path)
            accepted += 1
        except MechanismError as refusal:
            assert "\n" not in str(refusal)
            refused += 1
    assert refused > 40
    assert accepted > 40


def test_an_attribute_of_blanks_gives_nothing(tmp_path):
    path = tmp_path / "blank.xml"
    path.write_text('<mujoco><geom rgba="" pos=" "/></mujoco>')
    (geom,) = xml.read(path).children
    assert geom.numbers("rgba", (4,), (1.0,)) == (1.0,) and geom.vector("pos", (1, 2, 3)) == (
        1,
        2,
        3,
    )
    with pytest.raises(MechanismError, match="pos holds 0 numbers; give 3"):
        geom.vector("pos")


def test_a_colour_of_blanks_is_the_materials_or_none(tmp_path):
    path = tmp_path / "blank.xml"
    path.write_text(
        '<mujoco><worldbody><body name="b"><joint/><geom type="box" rgba="" size=".1 .2 .3"/>'
        "</body></worldbody></mujoco>"
    )
    (shape,) = load(path).mechanism.bodies["b"].shapes
    assert shape.size == (0.2, 0.4, 0.6)
