"""The benchmarks of the mechanisms run, on tiny sizes, and what they compare agrees. Nothing here
depends on speed."""

import json
from dataclasses import replace

import numpy as np
import pytest

import linkwork as lw
from linkwork.robots import stewart as stewart_platform

from benchmarks import catalogue, export, ladder, table, timing
from benchmarks.machine import describe

engines_needed = "the engines are not installed"


def values(figures):
    return {figure.what: figure.value for figure in figures if figure.value is not None}


@pytest.fixture(scope="module")
def platform():
    return lw.Robot(stewart_platform())


def test_engines_agree_on_the_stewart_platform(platform):
    stewart = pytest.importorskip("benchmarks.stewart", reason=engines_needed)
    states, forces = stewart.poses(platform, 4)
    assert np.abs(platform.tool_pose(states) - platform.tool_pose(platform.home)).max() > 0.2
    errors = stewart.errors(platform, states, forces)
    assert errors[stewart.PINOCCHIO].max() < 1e-10
    assert errors[stewart.MUJOCO].max() < 1e-4


def test_both_charts_are_timed_on_the_same_motions(platform):
    """The accelerations of the chart that runs start in, read off at the legs, are those of the
    legs' chart."""
    stewart = pytest.importorskip("benchmarks.stewart", reason=engines_needed)
    states, forces = stewart.poses(platform, 4)
    names = platform.run_chart.independent
    found, joint_rates = [], []
    for chart in (platform.run_chart, platform.chart):
        x = stewart.inputs(platform, chart, states, forces)
        q, v, u = np.split(x[:8], np.cumsum([platform.equations.nq, platform.mobility]), axis=1)
        v_dot = chart.kernel("motion")(q, v, u)[1]
        *_, rates, accelerations, _ = chart.kernel("joints_motion")(q, v, v_dot)
        joint_rates.append(rates)
        found.append(accelerations)
    columns = [platform.rates.index(name) for name in (*names, *platform.actuators)]
    assert np.allclose(joint_rates[0], joint_rates[1], rtol=0, atol=1e-11)
    assert np.allclose(found[0][:, columns], found[1][:, columns], rtol=1e-9, atol=1e-9)


@pytest.mark.long
def test_the_ladder_grows_linearly_and_swings_as_published():
    section = ladder.run(loops=(2, 4, 6), a02=3, rounds=1)
    found = values(section.figures)
    assert found["instructions per further loop, largest over smallest"] == pytest.approx(
        1, abs=0.05
    )
    assert found["N = 6: instructions per loop"] < 150
    assert found["A02, N = 3, 10 s: largest error of a crank's angle at the end"] < 1e-4
    assert found["A02, N = 2: error of the first tip's place at the end"] < 1e-4
    json.dumps(section.raw)


@pytest.mark.long
def test_trees_are_compiled_and_timed_beside_pinocchio():
    growth = pytest.importorskip("benchmarks.growth", reason=engines_needed)
    section = growth.run(counts=(3, 14), limbs=(1, 2), loops=3, rounds=1)
    assert [row[0] for row in section.listing.rows][:2] == ["chain of 3", "chain of 14"]
    assert all(tree["ours"] > 0 and tree["operations"] > 500 for name, tree in section.raw.items()
               if name != "ladder")  # fmt: skip
    json.dumps(section.raw)


def test_exported_c_is_measured_beside_the_kernel():
    section = export.run(names=("pendulum", "four_bar"), states=50, rounds=1)
    assert [row[0] for row in section.listing.rows] == ["pendulum", "four_bar"]
    assert all(each["ulp"] <= 4 and each["c"] > 0 for each in section.raw.values())
    json.dumps(section.raw)


@pytest.mark.long
def test_exudyn_converges_to_the_motion_of_andrews_squeezer():
    """Both come near the reference: Exudyn by the second order of its steps, Linkwork to its
    tolerance."""
    linkages = pytest.importorskip("benchmarks.linkages", reason=engines_needed)
    problem = replace(linkages.andrews_squeezer(), tolerances=(1e-5, 1e-8), steps=(200, 400))
    ours, theirs = linkages.linkwork(problem, rounds=1), linkages.exudyn(problem, repeats=1)
    assert ours.curve.errors[0] < 1e-2 and ours.curve.errors[1] < 1e-6
    assert np.log2(theirs.curve.errors[0] / theirs.curve.errors[1]) == pytest.approx(2, abs=0.3)
    assert max(ours.gaps) < 1e-11 and max(theirs.gaps) < 1e-9
    assert all(len(row) + 1 == len(linkages.COLUMNS) for row in (*ours.rows, *theirs.rows))


def test_bricards_reference_is_where_the_linkage_goes():
    linkages = pytest.importorskip("benchmarks.linkages", reason=engines_needed)
    problem = linkages.bricard_linkage()
    run = linkages.simulated(problem, 1e-9)
    assert problem.error(run.variables["joint_position"].values[-1]) < 1e-5
    assert problem.error(problem.robot.home.positions) > 1e-2


def test_catalogue_lists_robots():
    section = catalogue.run(("pendulum", "five_bar"), rounds=1)
    assert section.listing is not None
    assert [row[0] for row in section.listing.rows] == ["pendulum", "five_bar"]
    assert all(len(row) == len(section.listing.columns) for row in section.listing.rows)
    freedoms, instructions = (int(text) for text in section.listing.rows[1][1:3])
    assert freedoms == 2 and 50 < instructions < 1000
    assert all(float(text) > 0 for row in section.listing.rows for text in row[1:])
    json.dumps(section.raw)


def test_pages_are_written_when_they_are_whole(tmp_path, monkeypatch, capsys):
    main = pytest.importorskip("benchmarks.__main__", reason=engines_needed)
    section = table.Section(
        "Speed", "So.", [table.Figure("a", 1.0)], {"b": [1.0]}, {"plot.svg": "<svg/>"}
    )
    host = describe(lanes=2)
    monkeypatch.setattr(main, "RESULTS", tmp_path)
    monkeypatch.setattr(main.machine, "describe", lambda _: host)
    monkeypatch.setattr(
        main, "PAGES", {"one": {"x": lambda _: section, "y": lambda _: section}, "two": {}}
    )
    assert main.main(["x"]) == 0
    assert not list(tmp_path.iterdir())
    assert main.main(["one"]) == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["one.json", "one.md", "plot.svg"]
    assert "`python -m benchmarks one`" in (tmp_path / "one.md").read_text()
    assert json.loads((tmp_path / "one.json").read_text())["sections"]["Speed"]["raw"] == {
        "b": [1.0]
    }
    assert main.main([]) == 0
    assert (tmp_path / "two.md").exists()
    assert main.main(["nonsense"]) == 2
    assert "the benchmarks are one, two, x, y" in " ".join(capsys.readouterr().out.split())


def test_interleaved_takes_names_of_any_kind():
    seconds = timing.interleaved(
        {("a", 1): timing.Contender(lambda: sum(range(100)))}, rounds=2, block=1e-4
    )
    assert list(seconds) == [("a", 1)]


@pytest.mark.long
def test_derivatives_agree_with_pinocchio_and_are_timed():
    gradients = pytest.importorskip("benchmarks.gradients", reason=engines_needed)
    section = gradients.run(rounds=5, robots={"prr3": 6.0})
    found = values(section.figures)
    assert found["3-PRR: largest relative difference of Pinocchio's"] < 1e-9
    assert len(found) == 16 and all(value > 0 for value in found.values())
    json.dumps(section.raw)
