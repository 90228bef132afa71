"""What takes long says so on a terminal, and nowhere else."""

import io
import threading
import time
from types import SimpleNamespace

import pytest

import linkwork as lw
from linkwork import patience
from linkwork.cli.terminal import patience as spinner
from linkwork.patience import announced, ongoing

from tests.catalogue import built
from tests.processes import PATIENCE


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture
def terminal(monkeypatch):
    """Let everything take long, on a terminal."""
    shown = Terminal()
    monkeypatch.setattr(patience, "sys", SimpleNamespace(stderr=shown))
    monkeypatch.setattr(patience, "PATIENCE", 0.0)
    return shown


def done(what="weighing"):
    with announced(what):
        time.sleep(0.05)


def test_what_takes_long_is_named_while_it_lasts_and_timed_at_its_end(terminal):
    with announced("weighing"):
        time.sleep(0.2)
        assert terminal.getvalue() == "linkwork: weighing ...\n"
    first, last = terminal.getvalue().splitlines()
    assert first == "linkwork: weighing ..."
    assert last == "linkwork: weighing took 0.2 s"


def test_what_is_quick_says_nothing(terminal, monkeypatch):
    monkeypatch.setattr(patience, "PATIENCE", 60.0)
    done()
    assert terminal.getvalue() == ""


def test_parts_of_what_is_announced_say_nothing(terminal):
    with announced("weighing"):
        done("counting")
    assert "counting" not in terminal.getvalue()


def test_a_fault_is_passed_on_and_ends_the_announcement(terminal):
    with pytest.raises(ValueError, match="too heavy"), announced("weighing"):
        raise ValueError("too heavy")
    done("counting")
    assert "counting took" in terminal.getvalue()


@pytest.mark.long
def test_a_run_is_named_while_it_lasts_without_what_is_announced_in_it(terminal):
    with ongoing("simulating"):
        with announced("compiling"):
            time.sleep(0.5)
        assert terminal.getvalue().splitlines()[1].startswith("linkwork: compiling took 0.5")
        time.sleep(0.4)
        assert terminal.getvalue().endswith("linkwork: simulating ...\n")
    assert terminal.getvalue().endswith("linkwork: simulating took 0.4 s\n")


@pytest.mark.long
def test_runs_are_announced_and_quick_ones_are_not(terminal, monkeypatch):
    robot = built("prr3")
    robot.simulate(robot.home, duration=1e-3)
    options = {"rtol": 1e-11, "max_steps": 10**7}
    seconds, duration = 0.0, 10.0
    while seconds < 1.0:  # what is compiled meanwhile does not count
        begun, duration = time.perf_counter(), 2 * duration
        robot.simulate(robot.home, [0.5, 0, 0], duration=duration, **options)
        seconds = time.perf_counter() - begun
    assert "linkwork: simulating took" in terminal.getvalue()
    monkeypatch.setattr(patience, "PATIENCE", 60.0)
    before = terminal.getvalue()
    robot.simulate(robot.home, [0.5, 0, 0], duration=duration, **options)
    assert terminal.getvalue() == before


def test_files_and_threads_are_not_told(terminal, monkeypatch):
    thread = threading.Thread(target=done)
    thread.start()
    thread.join(PATIENCE)
    monkeypatch.setattr(patience.sys, "stderr", file := io.StringIO())
    done()
    monkeypatch.setattr(patience.sys, "stderr", None)
    done()
    assert terminal.getvalue() + file.getvalue() == ""


def test_the_spinner_of_commands_stands_for_all(terminal, monkeypatch):
    monkeypatch.setenv("FORCE_COLOR", "1")
    with spinner("mapping"):
        done()
    assert "weighing" not in terminal.getvalue()


def test_deriving_compiling_and_searching_are_announced(terminal, monkeypatch, tmp_path):
    monkeypatch.setenv("LINKWORK_CACHE_DIR", str(tmp_path))
    description = lw.robots.prr3()
    robot = lw.Robot(description.model_copy(update={"name": "patient"}))
    robot.forward_dynamics(robot.home, [0.0, 0.0, 0.0])
    assert robot.kernel("motion").address
    lw.analysis.assembly_modes(robot, starts=64)
    lw.analysis.workspace(robot, {"x": [0.5], "y": [0.3], "angle": 0.5})
    limits = lw.motions.ActuatorLimits(force=20.0, speed=1.0)
    line = lw.paths.line((0.5, 0.3, 0.5), (0.55, 0.33, 0.5))
    lw.motions.fastest(robot, line, limits, points=5)
    run = robot.simulate(robot.home, [0.0, 0.0, 0.0], duration=0.01)
    lw.views.write_report(robot, run, tmp_path / "run.html")
    lw.views.write_video(robot, run, tmp_path / "run.gif")
    lw.formats.save(description, tmp_path / "patient.xml")
    lw.formats.load(tmp_path / "patient.xml")
    said = terminal.getvalue()
    assert "linkwork: deriving the equations of motion of patient took" in said
    assert "linkwork: preparing" in said
    assert "linkwork: compiling motion" in said
    assert "linkwork: searching for assembly modes took" in said
    assert "linkwork: mapping the workspace took" in said
    assert "linkwork: finding the law of the least time took" in said
    assert "linkwork: writing the report took" in said
    assert "linkwork: drawing the video took" in said
    assert "linkwork: reading patient.xml took" in said
