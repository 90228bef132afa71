"""Films: the frames are poses of the mechanism, and a browser plays them without a network."""

import json
from itertools import pairwise

import numpy as np
import pytest

import linkwork as lw
from linkwork.mechanism import Box, Sphere
from linkwork.views.film import UNIT, film
from linkwork.views.motion import run_states
from linkwork.views.run_report import write_report

from tests.catalogue import built
from tests.processes import PATIENCE
from tests.viewer.browser import launch, until


@pytest.fixture(scope="module")
def made(run, robot):
    return film(robot, run.coords["time"].values, run_states(robot, run))


def placed(made, data):
    """Return the points (F, N, 2) of a planar film from its data [m]."""
    middle, size = made.frame
    frames = np.array(data["frames"], float).reshape(len(data["time"]), -1, 2)
    return frames * size / UNIT + middle[:2]


def test_bodies_keep_their_lengths_in_every_frame(made):
    points = placed(made, json.loads(made.data))
    rigid = [part for part in made.parts if part.kind in ("bar", "face")]
    lengths = []
    for part in rigid:
        for a, b in pairwise(part.points):
            along = np.linalg.norm(points[:, a] - points[:, b], axis=1)
            assert np.ptp(along) < 4e-4 * made.frame[1]
            lengths.append(along.mean())
    assert sum(abs(length - 0.3) < 2e-4 for length in lengths) == 3  # the links, l1 = 0.3 m


def test_the_path_runs_through_the_tools_places(made, run):
    path = next(part.points for part in made.fixed if part.width == 1.5)
    np.testing.assert_allclose(path[:, :2], run.variables["tool_pose"].values[:, :2], atol=1e-12)


def test_what_is_kept_of_a_long_run_is_even_in_time(robot):
    long = robot.simulate(
        robot.home, [0.5, 0, 0], duration=0.2, save_at=0.2 * np.linspace(0, 1, 1001) ** 2
    )
    short = film(robot, long.coords["time"].values, run_states(robot, long), frames=21)
    np.testing.assert_allclose(short.time, np.linspace(0, 0.2, 21), atol=4e-4)
    assert short.points.shape[0] == 21


def test_the_data_hold_numbers_only_and_no_markup(made):
    assert "<" not in made.data
    data = json.loads(made.data)
    assert {part[0] for part in data["parts"]} <= {
        "face",
        "solid",
        "bar",
        "line",
        "spring",
        "dashes",
        "dot",
        "box",
    }
    assert all(isinstance(number, int) for number in data["frames"][0])


def test_films_begin_in_real_time_or_slower(made):
    assert made.speed == 0.05  # 0.2 s last 4 s


@pytest.mark.parametrize("name", ["zoo", "flat"])
def test_mechanisms_with_every_kind_of_joint_are_filmed(name, request):
    odd = request.getfixturevalue(name)
    states = odd.make_state(np.stack([odd.home.q] * 2), np.zeros((2, odd.mobility)))
    found = film(odd, np.array([0.0, 1.0]), states)
    assert np.isfinite(found.points).all()
    kinds = {part.kind for part in found.parts}
    assert {"spring", "dashes", "bar"} <= kinds


@pytest.mark.long
def test_a_browser_plays_the_film(tmp_path):
    sync_api = pytest.importorskip(
        "playwright.sync_api", reason="playwright is not installed (the dev group)"
    )
    robot = built("stewart")
    run = robot.simulate(robot.home, duration=0.1, save_at=np.linspace(0, 0.1, 11))
    path = write_report(robot, run, tmp_path / "report.html")
    with sync_api.sync_playwright() as playwright, launch(playwright) as browser:
        page, wrong = browser.new_page(), []
        page.on(
            "console",
            lambda message: wrong.append(message.text) if message.type == "error" else None,
        )
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.on(
            "request",
            lambda request: (
                wrong.append(request.url) if not request.url.startswith("file:") else None
            ),
        )
        page.set_default_timeout(1000 * PATIENCE)
        page.goto(path.as_uri())
        time = "() => Number(document.querySelector('.film').dataset.time)"
        until(lambda: page.evaluate(time) > 0.001)
        page.get_by_role("button", name="Pause").click()
        picture = "() => document.querySelector('canvas').toDataURL()"
        before = page.evaluate(picture)
        goal = 0.1 if page.evaluate(time) < 0.05 else 0.01
        scrub = f"(scrub) => {{ scrub.value = {goal}; scrub.oninput(); }}"
        page.locator(".film input").evaluate(scrub)
        assert page.evaluate(time) == goal
        assert page.locator("output").inner_text() == f"{goal:.3f} s"
        after = page.evaluate(picture)
        assert after != before
        box = page.locator("canvas").bounding_box()
        page.mouse.move(box["x"] + 100, box["y"] + 100)
        page.mouse.down()
        page.mouse.move(box["x"] + 250, box["y"] + 160, steps=4)
        page.mouse.up()
        until(lambda: page.evaluate(picture) not in (before, after))
        assert wrong == []


def test_shapes_of_bodies_are_filmed_where_the_bodies_are():
    """A ball on the end of a pendulum: the corners that the page computes lie on the ball, wherever
    it swings."""
    plain = lw.robots.pendulum()
    (name, body), *_ = plain.bodies.items()
    ball = Sphere(radius=0.1, frame=lw.Frame(position=(1.0, 0, 0)))
    box = Box(size=(1.0, 0.04, 0.04), frame=lw.Frame(position=(0.5, 0, 0)), colour=(1, 0, 0))
    shaped = plain.model_copy(
        update={"bodies": {name: body.model_copy(update={"shapes": (ball, box)})}}
    )
    robot = lw.Robot(shaped)
    run = robot.simulate(robot.state([0.3]), duration=0.5, save_at=np.linspace(0, 0.5, 6))
    states = run_states(robot, run)
    found = film(robot, run.coords["time"].values, states)
    solids = [part for part in found.parts if part.kind == "solid"]
    assert [part.colour for part in solids][1] == "#ff0000"
    origins, turns = robot.body_poses(states)[name]
    middles = origins + turns @ [1.0, 0, 0]
    corners = found.drawn(solids[0])
    np.testing.assert_allclose(np.linalg.norm(corners - middles[:, None], axis=2), 0.1, atol=1e-4)
    assert found.frame[1] < 1.4  # nothing but what is drawn takes room


def test_another_motion_is_laid_over_faintly_at_the_same_times(robot, run):
    time, states = run.coords["time"].values, run_states(robot, run)
    other = robot.simulate(robot.home, [0, 0.5, 0], duration=0.1, save_at=np.linspace(0, 0.1, 401))
    over = other.coords["time"].values, run_states(robot, other)
    found, alone = film(robot, time, states, over=over), film(robot, time, states)
    faint = [stroke for stroke in found.parts if stroke.faint]
    assert len(found.parts) == 2 * len(alone.parts) and len(faint) == len(alone.parts)
    assert found.parts[: len(faint)] == tuple(faint)
    assert json.loads(found.data)["parts"][0][6] == 1

    def place_of_the_tool(stroke, frame):
        return found.points[frame, stroke.points[0], :2]

    tool = next(stroke for stroke in faint if stroke.kind == "line")
    for frame, t in enumerate(found.time):
        k = np.abs(over[0] - min(t, 0.1)).argmin()
        expected = other.variables["tool_pose"].values[k, :2]
        assert place_of_the_tool(tool, frame) == pytest.approx(expected, abs=1e-3)
