"""What a long file takes grows with its length and no faster; what has no bound of its own has a
limit that is told."""

import sys
import tracemalloc

import pytest

from linkwork.formats import load
from linkwork.mechanism import MechanismError

INERTIA = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
LINK = (
    '<link name="l{0}"><inertial><mass value="1"/><inertia ixx="1" iyy="1" '
    'izz="1"/></inertial></link>'
)
ARMS = "linkwork: 1\nbodies: {{{0}}}\njoints:\n{1}{2}"


def arms(n, *more):
    bodies = ", ".join(f"b{k}: {{mass: 1}}" for k in range(n))
    joints = "".join(f"  j{k}: {{type: revolute, connects: [ground, b{k}]}}\n" for k in range(n))
    return ARMS.format(bodies, joints, "".join(more))


def bodies(n, tag=""):
    inside = "".join(
        f'<body{tag.format(k)}><joint name="j{k}"/>{INERTIA}<site name="s.{k}"/></body>'
        for k in range(n)
    )
    motors = "".join(f'<motor joint="j{k}"/>' for k in range(n))
    return f"<mujoco><worldbody>{inside}</worldbody><actuator>{motors}</actuator></mujoco>"


def chain(n):
    joints = "".join(
        f'<joint name="j.{k}" type="revolute"><parent link="l{k}"/><child link="l{k + 1}"/></joint>'
        for k in range(n)
    )
    return (
        '<robot name="r"><link '
        f'name="l0"/>{"".join(LINK.format(k + 1) for k in range(n))}{joints}</robot>'
    )


LONG = {
    "actuators.yaml": lambda n: arms(n, "actuators: [", ", ".join(f"j{k}" for k in range(n)), "]"),
    "reference.yaml": lambda n: arms(n, "reference:\n", "".join(f"  j{k}: 1\n" for k in range(n))),
    "gears.yaml": lambda n: arms(
        n, *(f"  g{k}: {{type: gear, ratios: {{j{k}: 1, j{k + 1}: 1}}}}\n" for k in range(n - 1))
    ),
    "tools.yaml": lambda n: arms(
        n, "tools:\n", "".join(f"  t{k}: {{body: b{k}}}\n" for k in range(n))
    ),
    "bodies.xml": lambda n: bodies(n, ' name="b.{0}"'),
    "unnamed.xml": bodies,
    "hinges.xml": lambda n: "".join(
        [
            "<mujoco><worldbody><body>",
            INERTIA,
            *(f'<joint name="j{k}"/>' for k in range(n)),
            "</body></worldbody></mujoco>",
        ]
    ),
    "chain.urdf": chain,
}


def calls(path):
    """Return how many functions are called while a file is read."""
    count = 0

    def noted(*_):
        nonlocal count
        count += 1

    sys.setprofile(noted)
    try:
        load(path)
    finally:
        sys.setprofile(None)
    return count


@pytest.mark.sample(1)
@pytest.mark.parametrize("name", LONG)
def test_the_work_of_reading_grows_with_the_length(name, tmp_path):
    path, counts = tmp_path / name, []
    for length in (3, 10, 60, 240):
        path.write_text(LONG[name](length))
        counts.append(calls(path))
    assert counts[3] - counts[2] < 1.2 * 3.6 * (counts[2] - counts[1])


def nested_defaults(n):
    kinds = (
        f'<default class="c{i}">' + "".join(f'<t{i}_{k} a="1"/>' for k in range(n))
        for i in range(n)
    )
    return f"<mujoco><default>{''.join(kinds)}{'</default>' * n}</default><worldbody/></mujoco>"


@pytest.mark.long
def test_nested_defaults_take_no_more_memory_than_they_hold(tmp_path):
    path = tmp_path / "model.xml"
    path.write_text(nested_defaults(120))
    tracemalloc.start()
    load(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 1e8


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            "<mujoco><worldbody {}/></mujoco>".format(" ".join(f'a{k}="1"' for k in range(201))),
            "more than 200 attributes",
        ),
        (
            bodies(2, ' name="b{0}"').replace(
                "<actuator>",
                "<equality>"
                + '<connect body1="b0" body2="b1" anchor="1 0 0"/>' * 101
                + "</equality><actuator>",
            ),
            "line 1: <connect>: and 100 more hold the same two bodies together; three fix them",
        ),
        (bodies(2).replace('joint="j1"', f'joint="{"x" * 5000}"'), "there is no joint 'xxxx"),
    ],
)
def test_what_has_no_bound_has_a_limit(text, words, tmp_path):
    path = tmp_path / "model.xml"
    path.write_text(text)
    with pytest.raises(MechanismError, match=words) as refusal:
        load(path)
    assert len(str(refusal.value)) < 1000


def test_a_refusal_does_not_list_thousands_of_names(tmp_path):
    path = tmp_path / "arms.yaml"
    path.write_text(arms(1000, "actuators: [nobody]"))
    with pytest.raises(
        MechanismError,
        match=r"there is no joint 'nobody'; the joint names are j0, j1, .* and 900 more",
    ) as it:
        load(path)
    assert len(str(it.value)) < 1000


def test_files_that_include_files_count_as_one(tmp_path, monkeypatch):
    path = tmp_path / "model.xml"
    path.write_text('<mujoco><include file="0.xml"/></mujoco>')
    for k in range(40):
        inside = f"{'<worldbody>' * 30}<include file='{k + 1}.xml'/>{'</worldbody>' * 30}"
        (tmp_path / f"{k}.xml").write_text(
            f"<mujocoinclude>{inside if k < 39 else ''}</mujocoinclude>"
        )
    with pytest.raises(
        MechanismError, match="is nested deeper than 250, with the files that include its own"
    ):
        load(path)
    path.write_text(
        "<mujoco>" + "".join(f'<include file="{k}.xml"/>' for k in range(9)) + "</mujoco>"
    )
    for k in range(9):
        (tmp_path / f"{k}.xml").write_text(f"<mujocoinclude>{'<worldbody/>' * 100}</mujocoinclude>")
    load(path)
    monkeypatch.setattr("linkwork.formats.xml.MOST", 500)
    with pytest.raises(MechanismError, match="comes after more than 500 elements of all files"):
        load(path)
    monkeypatch.undo()
    monkeypatch.setattr("linkwork.formats.xml.LARGEST", 9000)
    with pytest.raises(MechanismError, match="the files included are larger than 0 MB together"):
        load(path)


FRAMES = [
    ("pos='1e200 0 0'", "pos holds 1e200; give numbers up to 1e+50"),
    ("zaxis='1e-200 0 1e-201'", "zaxis '1e-200 0 1e-201' has no length; give a direction"),
    ("zaxis='1e40 0 0'", None),
    ("quat='1e40 1e40 0 0'", None),
    ("xyaxes='1 0 0 1e40 1e20 0'", "xyaxes gives two parallel axes; turn one of them"),
    ("quat='0 0 0 0'", "quat '0 0 0 0' has no length; give a direction"),
    ("pos='1e400 0 0'", "pos holds 1e400, which is not a finite number"),
]


@pytest.mark.parametrize(("frame", "words"), FRAMES)
def test_frames_that_are_huge_or_degenerate(frame, words, tmp_path):
    path = tmp_path / "model.xml"
    path.write_text(
        f"<mujoco><worldbody>\n<body {frame}><joint/>{INERTIA}</body></worldbody></mujoco>"
    )
    if words is None:
        load(path)
        return
    with pytest.raises(MechanismError) as refusal:
        load(path)
    assert str(refusal.value) == f"{path}: line 2: <body>: {words}"


def test_limits_may_be_as_wide_as_numbers_go(tmp_path):
    path = tmp_path / "arm.urdf"
    limit = '<limit lower="-1.7976931348623157e308" upper="1.7976931348623157e308"/>'
    path.write_text(chain(1).replace("</joint>", f"{limit}</joint>"))
    limits = load(path).mechanism.joints["j_0"].limits
    assert (limits.lower, limits.upper) == (None, None)  # so wide that they bound nothing
