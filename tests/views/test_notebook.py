"""What is shown of objects: a screen at most in terminals, a picture and the facts in notebooks."""

import re
from html.parser import HTMLParser

import numpy as np
import pytest

import linkwork as lw
from linkwork import analysis
from linkwork.notebooks import Portrayed
from linkwork.robot import Motion, State

from tests.catalogue import built

LINES, WIDTH = 24, 80


class Shown(HTMLParser):
    """Hold the text of a page, and that what opens is closed."""

    def __init__(self, page: str):
        super().__init__()
        self.open, self.text, self.ids = [], "", []
        self.feed(page)

    def handle_starttag(self, tag, attrs):
        self.open.append(tag)
        self.ids += [value for name, value in attrs if name == "id"]

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_startendtag(self, tag, attrs):
        self.ids += [value for name, value in attrs if name == "id"]

    def handle_data(self, data):
        self.text += data


def of_path(name="prr3") -> Motion:
    return built(name).follow(lw.paths.circle([0.5, 0.29], 0.04, 1.2), 1.0, samples=51)


def members(**options) -> lw.Ensemble:
    robot = built("pendulum")
    states = robot.state({"hinge_1": np.linspace(0.1, 1.0, 5)})
    return robot.ensemble(states, duration=0.5, **options)


def identified() -> analysis.Identification:
    robot, time = built("prr3"), np.linspace(0, 1, 41)
    forces = lw.Sampled(time, np.random.default_rng(3).normal(size=(41, 3)))
    return analysis.identify(robot, robot.simulate(robot.home, forces, duration=1.0, samples=401))


THINGS = {
    "robot": (lambda: built("prr3"), "Robot 3-PRR"),
    "spatial": (lambda: built("stewart"), "leg_1"),
    "free": (lambda: lw.Robot("pendulum").free("rod_1.mass"), "rod_1.mass = "),
    "mechanism": (lambda: lw.robots.five_bar(), "5 revolute"),
    "run": (lambda: built("prr3").simulate(built("prr3").home, [5, 0, 0], duration=0.3), "Sharp-"),
    "members": (lambda: members(), "finished"),
    "saved": (lambda: members(samples=11), "11"),
    "motion": (of_path, "1 s, 51 samples"),
    "modes": (lambda: analysis.working_modes(built("five_bar"), [0.15, 0.3]), "4 (sure)"),
    "none": (lambda: analysis.assembly_modes(
        built("five_bar"), {"motor_1": 3.14159, "motor_2": 0.0}, starts=300), "of which 0"),
    "identified": (identified, "base parameters"),
}  # fmt: skip


PLAIN = {
    "forces": lambda: lw.Sampled(np.linspace(0, 2, 501), np.zeros((501, 3))),
    "signal": lambda: lw.Sampled(np.linspace(0, 2, 501), np.zeros((501, 3))).signal,
    "base": lambda: analysis.base_parameters(built("prr3")),
    "measured": lambda: analysis.Measured(
        of_path().state, np.zeros((51, 3)), np.zeros((51, 3))
    ),
    "poses": lambda: analysis.MeasuredPoses(of_path().state, np.zeros((51, 3))),
    "excitation": lambda: analysis.Excitation(("slide_1",), 2.0, np.zeros((11, 1)), 3.5),
    "state": lambda: built("stewart").home,
}  # fmt: skip


@pytest.mark.parametrize("name", PLAIN)
def test_all_results_are_told_in_a_screen(name):
    screen(PLAIN[name]())


def test_states_of_large_robots_are_told_in_a_screen():
    names = tuple(f"a_long_name_of_joint_{i}" for i in range(70))
    one = State(np.full(70, -1.23456789e-5), np.full(70, 0.1), np.zeros(70), names, names)
    screen(one)
    assert "a_long_name_of_joint_23=-1.23457e-05, ... (70); rates" in repr(one)
    stack = State(np.zeros((5, 70)), np.zeros((5, 70)), np.zeros((5, 70)), names, names)
    screen(stack)
    screen(analysis.Measured(stack, np.zeros((5, 70)), np.zeros((5, 70))))


def screen(shown):
    """Hold that an object is told in a screen of a terminal, with its kind."""
    lines = [len(line) for line in repr(shown).splitlines()]
    assert sum(-(-length // WIDTH) for length in lines) <= LINES
    assert repr(shown).startswith(type(shown).__name__)


@pytest.fixture(params=THINGS, scope="module")
def thing(request):
    make, word = THINGS[request.param]
    return make(), word, request.param


@pytest.mark.sample(3)
def test_a_notebook_shows_a_picture_and_the_facts(thing):
    shown, word, name = thing
    first, second = shown._repr_html_(), shown._repr_html_()
    page = Shown(first)
    assert not page.open and word in page.text
    assert ("<svg" in first) == (name != "none")
    assert len(first) < 500_000 and "http://www.w3.org/1999/xlink" not in page.text
    assert {*page.ids}.isdisjoint(Shown(second).ids)


def test_a_terminal_shows_a_screen_at_most(thing):
    screen(thing[0])


def test_all_that_is_shown_in_notebooks_is_tried_here():
    kinds = {lw.Robot, lw.Mechanism, lw.Run, lw.Ensemble, Motion, analysis.Modes}
    assert {*Portrayed.__subclasses__()} == kinds | {analysis.Identification}


@pytest.mark.parametrize("name", lw.robots.__all__)
def test_a_mechanism_is_told_in_few_words(name):
    mechanism = getattr(lw.robots, name)()
    assert repr(mechanism).startswith(f"Mechanism({mechanism.name!r}, {len(mechanism.bodies)} bod")
    assert len(repr(mechanism)) < 300 and str(mechanism) == repr(mechanism)


def test_a_run_is_told_without_running_it_again():
    robot = built("prr3")
    run = robot.simulate(robot.home, duration=0.1)
    told = repr(run)
    assert re.fullmatch(r"Run\('3-PRR', FINISHED, \d+ steps, \d+ samples until t = 0.1 s\)", told)
    assert callable(vars(run)["message"]) and not run.variables._found
    one = analysis.linearise(robot, robot.home)
    assert repr(one) == (
        "LinearModel(6 states, 3 inputs, 6 outputs; inputs: slide_1, slide_2, slide_3)"
    )
    assert "3 modes: 0, 0, 0 Hz" in repr(analysis.natural_modes(robot, robot.home))


def test_names_of_users_are_no_markup():
    robot = lw.robots.pendulum().model_copy(update={"name": "<b>bold & co</b>"})
    page = robot._repr_html_()
    assert "<b>" not in page and "bold &amp; co" in page


def test_what_cannot_be_drawn_is_told_by_its_text():
    """A mechanism whose loops do not close has no picture."""
    five_bar = lw.robots.five_bar()
    far = five_bar.model_copy(
        update={"bodies": five_bar.bodies, "reference": {"motor_1": 0.0, "motor_2": np.pi}}
    )
    page = far._repr_html_()
    assert page is None or "<svg" in page
    assert "Mechanism(" in repr(far)
