"""The server of the viewer without a browser: ports, addresses, wishes of many hands, work beside the scene, the command."""

import signal
import socket
import sys
import threading
import urllib.request

import numpy as np
import pytest
from typer.testing import CliRunner

from linkwork import LinkworkError, Robot, robots
from linkwork.cli import app
from linkwork.views.viewer import Viewer
from linkwork.views.viewer.mailbox import Mailbox
from linkwork.views.viewer.viewer import free_port, shown_host

from tests.processes import PATIENCE, python
from tests.viewer.browser import until


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
    assert [shown_host(host) for host in ("127.0.0.1", "0.0.0.0", "::1")] == ["127.0.0.1", "localhost", "[::1]"]


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
        position, R = viewer.session.view().tool
        random = np.random.default_rng(2)

        def pull(seed: int) -> None:
            for shift in np.random.default_rng(seed).standard_normal((40, 3)):
                viewer.post(lambda shift=shift: viewer._drag(position + shift * (1, 1, 0), R), "drag")
                viewer.post(lambda: viewer.session.slide("slide_1", float(random.uniform(0, 0.4))), "slide")

        hands = [threading.Thread(target=pull, args=(seed,)) for seed in range(3)]
        for hand in hands:
            hand.start()
        for hand in hands:
            hand.join()
        viewer.post(viewer._released)
        until(lambda: not viewer.held)
        assert robot.closure_error(viewer.session.state) < 1e-9


def test_a_simulation_is_carried_out_beside_and_played(robot):
    with Viewer(robot) as viewer:
        viewer.simulate("hold the pose", {"slide_1": 1.0}, 0.2)
        until(lambda: viewer.session.playable and viewer.session.player.ended)
        final = viewer.session.replay.state(0.2)
        assert final.positions == pytest.approx(robot.home.positions, abs=0.05)


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


def test_the_command_serves_a_saved_run_until_it_is_interrupted(robot, tmp_path):
    run = robot.simulate(robot.home, duration=0.05).save(tmp_path / "run.nc")
    with python("-u", "-m", "linkwork", "view", run, "--no-browser", stderr=None) as process:
        assert process.stdout is not None
        line = next(line for line in process.stdout if line.startswith("3-PRR: "))
        with urllib.request.urlopen(line.split()[1], timeout=PATIENCE) as page:
            assert page.status == 200 and b"<html" in page.read()
        process.send_signal(signal.SIGINT)
        assert process.wait(PATIENCE) == 0
