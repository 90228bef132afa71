"""The server of the viewer without a browser: ports, addresses, wishes of many hands, work beside
the scene, the command."""

import json
import signal
import socket
import sys
import threading
import urllib.error
import urllib.request
from contextlib import nullcontext
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from typer.testing import CliRunner
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from linkwork import LinkworkError, Robot, robots
from linkwork.cli import app
from linkwork.viewer import Viewer
from linkwork.viewer.access import LOOPBACK, Door, free_port, shown_host
from linkwork.viewer.mailbox import Mailbox
from linkwork.viewer.panels import stand

from tests.processes import PATIENCE, python
from tests.viewer.browser import until

UPRIGHT = (1.0, 0.0, 0.0, 0.0)


@pytest.fixture(scope="module")
def robot() -> Robot:
    return Robot(robots.prr3())


@pytest.fixture
def taken():
    with socket.socket() as busy:
        busy.bind(("127.0.0.1", 0))
        busy.listen()
        yield busy.getsockname()[1]


def test_a_port_in_use_is_refused_and_without_one_the_next_free_is_taken(robot, taken):
    with pytest.raises(LinkworkError, match=f"port {taken} on 127.0.0.1 is in use"):
        Viewer(robot, port=taken)
    with Viewer(robot) as first, Viewer(robot) as second:
        assert first.url != second.url and first.url.startswith("http://127.0.0.1:")


@pytest.mark.parametrize(
    ("host", "port", "said"),
    [
        ("no.such.host.invalid", None, "there is no address 'no.such.host.invalid'"),
        ("192.0.2.7", None, "192.0.2.7 is no address of this computer"),
        ("127.0.0.1", 99999, "port 99999 is none"),
    ],
)
def test_addresses_that_cannot_be_listened_on(host, port, said):
    with pytest.raises(LinkworkError, match=said):
        free_port(host, port)


def test_addresses_as_browsers_reach_them():
    assert [shown_host(host) for host in ("127.0.0.1", "0.0.0.0", "::1")] == [
        "127.0.0.1",
        "localhost",
        "[::1]",
    ]


def test_what_is_no_robot_and_runs_of_others_are_refused(robot):
    with pytest.raises(LinkworkError, match="shows a Robot, not 5"):
        Viewer(5)  # pyright: ignore
    other = Robot(robots.five_bar())
    with pytest.raises(LinkworkError, match="not one of the robot"):
        Viewer(robot, other.simulate(other.home, duration=0.05))


def test_without_viser_what_to_install_is_said(robot, monkeypatch):
    monkeypatch.setitem(sys.modules, "viser", None)
    with pytest.raises(LinkworkError, match=r"pip install 'linkwork\[viewer\]'"):
        Viewer(robot)


def test_of_wishes_about_the_same_only_the_last_counts():
    box, done = Mailbox(), []
    for k in range(5):
        box.post(lambda k=k: done.append(("drag", k)), "drag")
        box.post(lambda k=k: done.append(("button", k)))
    for wish in box.take(0):
        wish()
    assert ("drag", 4) in done and len([what for what, _ in done if what == "drag"]) == 1
    assert len(done) == 6 and box.take(0) == []


def test_many_hands_at_once_tear_nothing(robot):
    with Viewer(robot) as viewer:
        position, _ = viewer.session.view().tool
        random = np.random.default_rng(2)

        def pull(seed: int) -> None:
            for shift in np.random.default_rng(seed).standard_normal((40, 3)):
                viewer.post(
                    lambda shift=shift: viewer._drag(position + shift * (1, 1, 0), UPRIGHT), "drag"
                )
                viewer.post(
                    lambda: viewer.session.slide("slide_1", float(random.uniform(0, 0.4))), "slide"
                )

        hands = [threading.Thread(target=pull, args=(seed,), daemon=True) for seed in range(3)]
        for hand in hands:
            hand.start()
        for hand in hands:
            hand.join(PATIENCE)
            assert not hand.is_alive()
        viewer.post(viewer._released)
        until(lambda: not viewer.held)
        assert robot.closure_error(viewer.session.state) < 1e-9


def asked(url: str, headers: dict[str, str] | None = None) -> tuple[int, str | None]:
    """Return the status that a page is answered with, and the cookie that it sets."""
    try:
        with urllib.request.urlopen(
            urllib.request.Request(url, headers=headers or {}), timeout=PATIENCE
        ) as page:
            return page.status, page.headers["Set-Cookie"]
    except urllib.error.HTTPError as error:
        return error.code, None


def knocks(url: str, **options) -> int:
    """Return the status with which a websocket is answered: 101 if it is let in."""
    import viser

    try:
        with connect(
            url, subprotocols=[f"viser-v{viser.__version__}"], open_timeout=PATIENCE, **options
        ):
            return 101
    except InvalidStatus as error:
        return error.response.status_code


def test_a_page_is_given_to_who_knows_the_token_alone(robot):
    with Viewer(robot) as viewer:
        bare, _, token = viewer.url.partition("?token=")
        assert len(token) > 20 and token not in repr(Door("a", token))
        assert (
            asked(bare)
            == asked(f"{bare}?token=")
            == asked(f"{bare}?token={token[:-1]}")
            == (403, None)
        )
        status, cookie = asked(viewer.url)
        assert status == 200 and cookie is not None and "HttpOnly; SameSite=Strict" in cookie
        assert asked(bare, {"Cookie": f"other=1; {cookie.partition(';')[0]}"})[0] == 200
        assert asked(bare, {"Cookie": "linkwork-8080=guessed"})[0] == 403


def test_a_websocket_of_another_origin_or_without_the_token_is_not_let_in(robot):
    with Viewer(robot) as viewer:
        page, _, token = viewer.url.partition("?token=")
        url, own = page.replace("http", "ws", 1), page.rstrip("/")
        cookie = {"Cookie": (asked(viewer.url)[1] or "").partition(";")[0]}
        assert knocks(url) == knocks(url, origin=own) == 403
        assert knocks(url, origin=own, additional_headers=cookie) == 101
        assert knocks(f"{url}?token={token}") == 101  # a program, which says no origin
        for origin in (
            "http://evil.example",
            f"http://{LOOPBACK}:1",
            "null",
            own.replace(LOOPBACK, "localhost"),
        ):
            assert knocks(f"{url}?token={token}", origin=origin, additional_headers=cookie) == 403


def test_a_viser_that_lets_everybody_in_is_refused(robot, monkeypatch):
    monkeypatch.setattr("linkwork.viewer.access.kept", lambda door, used: nullcontext())
    with pytest.raises(LinkworkError, match="cannot be kept from strangers' pages"):
        Viewer(robot)


@pytest.mark.sample(3)
@pytest.mark.parametrize(
    ("position", "wxyz", "sentence"),
    [
        ((np.nan, 0, 0), UPRIGHT, "position[0] is nan; give finite numbers"),
        ((0, np.inf, 0), UPRIGHT, "position[1] is inf; give finite numbers"),
        ((0, 0), UPRIGHT, "has the shape (2,)"),
        ((0, 0, 0), "turned", "orientation is 'turned'; give numbers"),
        ((0, 0, 0), (0, 0, 0, 0), "a quaternion of zeros"),
        ((0, 0, 0), (1, np.nan, 0, 0), "orientation[1] is nan; give finite numbers"),
    ],
)
def test_a_drag_to_nowhere_is_said_and_the_next_one_is_followed(robot, position, wxyz, sentence):
    with Viewer(robot) as viewer:
        start = viewer.session.state.q.copy()
        viewer.post(lambda: viewer._drag(position, wxyz))
        until(lambda: sentence in viewer.session.notice)
        assert (viewer.session.state.q == start).all()
        place, _ = viewer.session.view().tool
        viewer.post(lambda: viewer._drag(np.add(place, (0.02, 0, 0)), UPRIGHT))
        until(lambda: abs(viewer.session.view().tool[0][0] - place[0]) > 0.01)


def test_what_fails_while_time_passes_does_not_end_the_viewer(robot, monkeypatch):
    with Viewer(robot) as viewer:
        monkeypatch.setattr(viewer.session, "advance", lambda seconds: 1 / 0)
        viewer.post(lambda: None)
        until(lambda: "failed unexpectedly" in viewer.session.notice)
        monkeypatch.undo()
        viewer.post(lambda: viewer.session.slide("slide_1", float("nan")))
        until(lambda: "slide_1 is nan" in viewer.session.notice)
        home = viewer.session.state["slide_1"]
        viewer.post(lambda: viewer.session.slide("slide_1", home + 0.01))
        until(lambda: abs(viewer.session.state["slide_1"] - home - 0.01) < 1e-6)


def test_a_simulation_is_carried_out_beside_and_played(robot):
    with Viewer(robot) as viewer:
        viewer.simulate("hold the pose", {"slide_1": 1.0}, 0.2)
        until(lambda: viewer.session.playable and viewer.session.player.ended)
        final = viewer.session.replay.state(0.2)
        assert final.positions == pytest.approx(robot.home.positions, abs=0.05)


def test_a_slider_tells_of_turns_and_of_ways_beyond_its_range():
    robot = Robot(robots.five_bar())
    run = robot.simulate(robot.home, dict.fromkeys(robot.actuators, 0.4), duration=3.0)
    turned = float(run.final["motor_1"])
    with Viewer(robot, run) as viewer:
        slider = viewer.panels.sliders["motor_1"]
        assert turned > slider.max + 2 * np.pi
        viewer.post(lambda: viewer.session.seek(3.0))
        until(lambda: np.isclose(np.sin((slider.value - turned) / 2), 0, atol=1e-9))
        assert slider.min <= slider.value <= slider.max
        way = viewer.server.gui.add_slider("way [m]", -0.5, 0.5, 0.001, 0.0)
        for far in (9.1234, -9.1234):
            stand(way, far, turns=False)
            assert way.value == far and way.min <= far <= way.max


def test_the_curves_that_were_chosen_stay_so_with_the_next_run(robot):
    run = robot.simulate(robot.home, {"slide_1": 1.0}, duration=0.1)
    with Viewer(robot, run) as viewer:
        panels = viewer.panels
        assert panels.quantity.value == "joint_position"
        panels.quantity.value = "kinetic_energy"
        panels.show_run(run)
        assert panels.quantity.value == "kinetic_energy" and panels.traces.unit == "J"


def test_a_camera_goes_as_far_as_the_mechanism_reaches_now():
    robot = Robot(robots.double_pendulum())
    with Viewer(robot) as viewer:
        stage, camera = viewer.stage, SimpleNamespace(aspect=1.5)
        away = []
        for turn in (0.0, 9.0):
            placement = viewer.session.layout.place(robot.home)
            stage.show(replace(placement, positions=placement.positions + turn))
            stage.look(SimpleNamespace(camera=camera, atomic=nullcontext), "iso", None)
            away.append(np.linalg.norm(camera.position - camera.look_at))
        assert away[1] > away[0] + 9 * np.sqrt(3)


def test_what_cannot_be_simulated_is_said(robot):
    with Viewer(robot) as viewer:
        viewer.simulate("constant forces", {}, float("nan"))
        until(lambda: "duration" in viewer.session.notice)
        assert not viewer.busy


def test_branches_are_found_and_shown(robot):
    with Viewer(robot) as viewer:
        viewer.find_branches("tool")
        until(lambda: len(viewer.branches) > 1)
        assert len(viewer.branches) == 8  # two ways to bend each leg
        pose = robot.tool_pose(robot.home)
        for k, state in enumerate(viewer.branches):
            viewer.show_branch(k)
            until(lambda state=state: np.allclose(viewer.session.state.q, state.q))
            off = robot.tool_pose(state) - pose
            assert [*off[:2], np.sin(off[2] / 2)] == pytest.approx([0, 0, 0], abs=1e-8)


def invoke(*words: str):
    return CliRunner().invoke(app, list(words))


def test_the_command_refuses_in_a_sentence(robot, tmp_path, taken):
    run = robot.simulate(robot.home, duration=0.05).save(tmp_path / "run.nc")
    for words, said in (
        (("view", "prr3", "--port", str(taken)), "is in use"),
        (("view", "nonesuch"), "there is no robot 'nonesuch'"),
        (("view", "prr3", "--robot", "prr3"), "is no run"),
        (("view", str(run), "--robot", "five_bar"), "not one of the robot"),
        (("view", str(tmp_path / "absent.nc")), "cannot read a run"),
    ):
        result = invoke(*words)
        assert result.exit_code == 2 and said in " ".join(result.output.split()), words


def test_the_command_tells_one_address_and_nothing_but_data_where_that_is_asked_for(monkeypatch):
    monkeypatch.setattr(Viewer, "wait", lambda self: None)
    told = invoke("view", "prr3", "--no-browser", "--json")
    assert set(json.loads(told.stdout)) == {"robot", "url"}
    said = invoke("view", "prr3", "--no-browser")
    assert said.stdout.count("http://") == 1 and "?token=" in said.stdout
    assert "://" not in said.stderr  # as viser's address, by which nobody is let in


@pytest.mark.long
def test_the_command_serves_a_saved_run_until_it_is_interrupted(robot, tmp_path):
    run = robot.simulate(robot.home, duration=0.05).save(tmp_path / "run.nc")
    with python("-u", "-m", "linkwork", "view", run, "--no-browser", stderr=None) as process:
        assert process.stdout is not None
        line = next(line for line in process.stdout if line.startswith("3-PRR: "))
        with urllib.request.urlopen(line.split()[1], timeout=PATIENCE) as page:
            assert page.status == 200 and b"<html" in page.read()
        process.send_signal(signal.SIGINT)
        assert process.wait(PATIENCE) == 0
