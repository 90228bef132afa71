"""Numbers from the command line and from files of forces: what is read, and one sentence for what
is refused."""

import numpy as np
import pytest

import linkwork as lw
from linkwork.cli.entries import by_name, read_columns
from linkwork.cli.grid_words import axes, ranges
from linkwork.cli.start import coordinates_given, tool_given
from linkwork.errors import LinkworkError

NAMES = ("slide_1", "slide_2", "slide_3")


def test_values_are_read_in_order_or_by_name():
    assert by_name("5,0,-1", NAMES, "--forces") == {"slide_1": 5.0, "slide_2": 0.0, "slide_3": -1.0}
    assert by_name("slide_3=2, slide_1 = -1", NAMES, "--forces") == {
        "slide_3": 2.0,
        "slide_1": -1.0,
    }


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("1,2", "--forces holds 2 numbers; give 3"),
        ("1,x,3", "--forces: 'x' is not a number"),
        ("1,inf,3", "--forces: inf is not a finite number"),
        ("slide_4=1", "--forces: there is no 'slide_4'; the names are slide_1, slide_2, slide_3"),
        ("slide_1=1,slide_1=2", "--forces: 'slide_1' is given twice"),
        ("slide_1=1,2", "--forces: '2' has no name"),
        ("slide_1=", "--forces: slide_1: '' is not a number"),
    ],
)
def test_values_that_are_refused(text, sentence):
    with pytest.raises(LinkworkError, match="^" + sentence.replace("(", r"\(")):
        by_name(text, NAMES, "--forces")


def written(folder, text):
    path = folder / "forces.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_columns_come_in_any_order_with_remarks_and_empty_lines(tmp_path):
    text = "\ufeff# made by hand\ntime, slide_3,slide_1,slide_2\n0,3,1,2\n\n# later\n0.5,30,10,20\n"
    times, values = read_columns(written(tmp_path, text), NAMES)
    np.testing.assert_array_equal(times, [0, 0.5])
    np.testing.assert_array_equal(values, [[1, 2, 3], [10, 20, 30]])


HEAD = "time,slide_1,slide_2,slide_3\n"


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "is empty; its first line names the columns: time,slide_1,slide_2,slide_3"),
        (HEAD, "holds 0 rows of numbers; give at least two"),
        (HEAD + "0,1,2,3\n", "holds 1 rows of numbers; give at least two"),
        ("time,slide_1,slide_2\n0,1,2\n", "lacks the column 'slide_3'"),
        ("slide_1,slide_2,slide_3\n0,1,2\n", "lacks the column 'time'"),
        (
            "time,slide_1,slide_2,slide_3,pivot_1\n",
            "has an unknown column 'pivot_1'; the columns are time, slide_1",
        ),
        ("time,slide_1,slide_2,slide_1\n", "has the column 'slide_1' more than once"),
        (HEAD + "0,1,2,3\n1,1,two,3\n", ", line 3, column 'slide_2': 'two' is not a number"),
        (HEAD + "0,1,2,3\n1,1,nan,3\n", ", line 3, column 'slide_2': nan is not a finite number"),
        (HEAD + "0,1,2,3\n1,1,,3\n", ", line 3, column 'slide_2': '' is not a number"),
        (HEAD + "0,1,2,3\n1,1,2\n", ", line 3: holds 3 entries; give 4: time, slide_1"),
        (
            HEAD + "0,1,2,3\n# x\n1,1,2,3\n1,1,2,3\n",
            ", line 5: the time 1 s does not come after 1 s in the row before",
        ),
        (
            HEAD + "0,1,2,3\n1,1,2,3\n0.5,1,2,3\n",
            ", line 4: the time 0.5 s does not come after 1 s",
        ),
    ],
)
def test_files_that_are_refused_name_line_and_column(tmp_path, text, sentence):
    path = written(tmp_path, text)
    with pytest.raises(LinkworkError) as refusal:
        read_columns(path, NAMES)
    assert str(refusal.value).startswith(str(path))
    assert sentence in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_files_that_cannot_be_read_are_refused(tmp_path):
    with pytest.raises(LinkworkError, match=r"none\.csv cannot be read: no such file"):
        read_columns(tmp_path / "none.csv", NAMES)
    (tmp_path / "image.csv").write_bytes(b"\x89PNG\xff\xfe\x00")
    with pytest.raises(LinkworkError, match=r"image\.csv is not a CSV file"):
        read_columns(tmp_path / "image.csv", NAMES)


def test_the_tool_is_given_by_numbers_or_by_name_with_units_or_without():
    flat, spatial = (lw.Robot(of()) for of in (lw.robots.prr3, lw.robots.stewart))
    assert tool_given(flat, "0.5,-40mm,90 deg") == [0.5, -0.04, np.pi / 2]
    assert tool_given(spatial, "z = 50cm, rx=-1") == {"z": 0.5, "rx": -1.0}
    for wrong, told in (
        ("z=1,2", "has no name"),
        ("z=1,z=2", "twice"),
        ("z=up", "not a number"),
        ("z=30deg", "the unit is not known; it is no angle, in m, cm, mm"),
        ("rx=1mm", "it is an angle, in rad, deg"),
    ):
        with pytest.raises(LinkworkError, match=told):
            tool_given(spatial, wrong)


def test_axes_and_ranges_of_maps_may_have_units():
    flat = lw.Robot("prr3")
    found = axes(flat, "x=0:50cm:3,angle=90 deg")
    assert found["x"].tolist() == [0, 0.25, 0.5] and found["angle"] == np.pi / 2
    assert ranges(flat, "slide_1=0:40mm,pivot_1=0:90deg") == {
        "slide_1": (0.0, 0.04),
        "pivot_1": (0.0, np.pi / 2),
    }
    for wrong, told in (
        ("x=0:1:0", "x=0:1:0 is no axis; give from:to:count, or one number"),
        ("x=0:1", "x=0:1 is no axis"),
        ("x=30deg", "the unit is not known; it is no angle"),
        ("u=1", "there is no coordinate of the tool 'u'"),
    ):
        with pytest.raises(LinkworkError, match=told):
            axes(flat, wrong)
    with pytest.raises(LinkworkError, match="slide_1=1 is no range; give lower:upper"):
        ranges(flat, "slide_1=1")


def test_angles_far_beyond_their_limits_are_told(capsys):
    """A joint without limits from zero on; two whole turns are none too many."""
    hinge = {"type": "revolute", "connects": ("ground", "arm")}
    limited = hinge | {"connects": ("arm", "hand"), "limits": {"lower": -1, "upper": 20}}
    mechanism = lw.Mechanism(
        bodies={"arm": {"mass": 1.0}, "hand": {"mass": 1.0}},
        joints={"crank": hinge, "screw": limited},
    )
    for text, told in (
        ("crank=12,screw=32", ""),
        ("crank=120", "crank is taken as 120 rad, 19.1 turns; degrees are written crank=120deg"),
        ("screw=-14", "screw is taken as -14 rad, -2.23 turns"),
    ):
        coordinates_given(mechanism, text, "--joints")
        said = capsys.readouterr().err
        assert told in said if told else not said
