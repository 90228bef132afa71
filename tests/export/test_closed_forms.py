"""Equations to print: closed forms against the kernels, the paper and each other."""

from __future__ import annotations

import re

import numpy as np
import pytest
import sympy
from matplotlib.mathtext import MathTextParser

import linkwork as lw
from linkwork.export.symbolic import derivation
from linkwork.export.symbolic.closed import ClosedForms
from linkwork.export.symbolic.page import escaped
from linkwork.mechanism import Body, Frame, Inertia, Mechanism, RevoluteJoint, ScrewJoint

NAMES = {
    "four_bar": "free all",
    "prr3": "free all",
    "rpr3": "free",
    "rrr3": "all",
    "five_bar": "all",
    "slider_crank": "free all",
    "andrews": "all",
    "bennett": "all",
    "spatial_slider_crank": "free all",
    "flyball_governor": "all",
    "pendulum": "all",
}
CASES = [(name, symbols) for name, every in NAMES.items() for symbols in every.split()]


def differences(robot: lw.Robot, forms: ClosedForms, seed: int = 3) -> dict[str, float]:
    """Return how far the closed forms are from the kernels at states near home, relative."""
    rng, worst = np.random.default_rng(seed), dict.fromkeys(("phi", "L", "M", "Cv", "G"), 0.0)
    own = [robot.coordinates.index(name) for name in forms.coordinates]
    for _ in range(3):
        home = dict(zip(robot.coordinates, robot.home.positions, strict=True))
        joints = {name: home[name] + 0.002 * rng.normal() for name in robot.independent}
        rates = rng.normal(size=robot.mobility)
        state = robot.assemble(joints, rates=dict(zip(robot.independent, rates, strict=True)))
        found = forms.evaluate(state.positions[own], rates)
        expected = {
            "phi": np.zeros(len(forms.rows)),
            "L": robot.rate_map(state)[[robot.rates.index(name) for name in forms.rates]],
            "M": robot.mass_matrix(state),
            "Cv": robot.coriolis(state),
            "G": robot.gravity(state),
        }
        for name, values in expected.items():
            size = 1.0 if name in ("phi", "L") else np.abs(expected["M"]).max()
            size = max(size, np.abs(values).max(initial=0.0))
            worst[name] = max(worst[name], np.abs(found[name] - values).max(initial=0.0) / size)
    return worst


@pytest.mark.sample(2)
@pytest.mark.parametrize(("name", "symbols"), CASES)
def test_closed_forms_are_the_kernels(name, symbols):
    robot = lw.Robot(name)
    forms = lw.export.sympy(robot, symbols=symbols)
    worst = differences(robot, forms)
    assert max(worst.values()) < 1e-12, worst


@pytest.mark.long
def test_the_loop_equations_of_the_paper():
    """phi_1, phi_4 and phi_5 of its appendix, with the terms that are misprinted there put right
    (`docs/the-paper.md`): P by leg 1 is P by leg 2, and by leg 3."""
    forms = lw.export.sympy(lw.Robot("prr3"), symbols="all")
    q1, q2, q3, q4, q5, q6, q7, q8, q9 = forms.coordinates.values()
    l1, l2, l3 = sympy.symbols("l_1:4", real=True)
    root = sympy.sqrt(3)
    cos, sin = sympy.cos, sympy.sin

    def centre(q, link, wrist, a, corner):
        x = corner[0] + q * cos(a) + l1 * cos(a + link) + l2 * cos(a + link + wrist)
        y = corner[1] + q * sin(a) + l1 * sin(a + link) + l2 * sin(a + link + wrist)
        return sympy.Matrix([x, y])

    one = centre(q1, q4, q7, 0, (0, 0))
    two = centre(q2, q5, q8, 2 * sympy.pi / 3, (l3, 0))
    three = centre(q3, q6, q9, 4 * sympy.pi / 3, (l3 / 2, root / 2 * l3))
    paper = [*(one - two), q7 + q4 - q8 - q5, *(one - three), q7 + q4 - q9 - q6]
    for ours, theirs in zip(forms.phi, paper, strict=True):
        written = forms.written_out(ours)
        zero = [sympy.simplify(sympy.expand_trig(written - sign * theirs)) for sign in (1, -1)]
        assert 0 in zero


def test_phi_is_what_its_jacobian_is_of():
    forms = lw.export.sympy(lw.Robot("five_bar"), symbols="all")
    phi, Phi = forms.written_out(forms.phi), forms.written_out(forms.Phi)
    assert sympy.simplify(phi.jacobian([*forms.coordinates.values()]) - Phi).is_zero_matrix


def test_a_four_bar_reads_as_in_a_book():
    forms = lw.export.sympy(lw.Robot("four_bar"), symbols="all")
    q1, q2, q3, _ = forms.coordinates.values()
    _, l2, l3 = sympy.symbols("l_1:4", real=True)
    delta = next(x for name, x in forms.definitions.items() if name.name == "Delta_1")
    assert delta in (l2 * l3 * sympy.sin(q1 + q2 - q3), -l2 * l3 * sympy.sin(q1 + q2 - q3))
    assert forms.operations < 300
    assert sorted(x.name for x in forms.parameters) == [
        *("I_1", "I_2", "I_3", "g", "l_1", "l_2", "l_3", "l_4", "m_1", "m_2", "m_3"),
    ]


def test_free_numbers_are_symbols_and_may_change():
    free = ("platform.mass", "link_1.com.x", "wrist_1.frames.0.position.x", "gravity.y")
    robot = lw.Robot("prr3").free(*free)
    forms = lw.export.sympy(robot)
    assert {*forms.meanings.values()} >= {"platform.mass", "link_1.com.x"}
    values = {"platform.mass": 2.5, "gravity.y": -9.81}
    other = robot.with_parameters(values)
    state = other.state(other.home.positions, [0.3, -0.2, 0.5])
    named = {symbol.name: path for symbol, path in forms.meanings.items() if path in values}
    found = forms.evaluate(
        state.positions, state.rates, {name: values[path] for name, path in named.items()}
    )
    np.testing.assert_allclose(found["M"], other.mass_matrix(state), rtol=1e-12)
    np.testing.assert_allclose(found["G"], other.gravity(state), rtol=1e-12)
    np.testing.assert_allclose(found["Cv"], other.coriolis(state), rtol=1e-11)


@pytest.mark.long
def test_screws_rotors_and_skew_frames():
    """A screw carries an arm by a skew hinge with a rotor; nothing is exact or aligned."""
    part = Inertia(xx=0.02, yy=0.03, zz=0.025, xy=0.001, xz=-0.002, yz=0.003)
    skew = Frame(position=(0.1, -0.2, 0.3), rotation=(0.3, -0.5, 0.7))
    mechanism = Mechanism(
        name="drill",
        bodies={
            name: Body(mass=mass, centre_of_mass=(0.1, 0.2, -0.1), inertia=part)
            for name, mass in (("nut", 2.0), ("arm", 1.5))
        },
        joints={
            "thread": ScrewJoint(connects=("ground", "nut"), pitch=0.02, frames=(skew, Frame())),
            "hinge": RevoluteJoint(
                connects=("arm", "nut"), frames=(skew, skew), axis=(0.6, 0.8, 0), rotor_inertia=0.1
            ),
        },
        actuators=("thread", "hinge"),
    )
    robot = lw.Robot(mechanism)
    for symbols in ("free", "all"):
        worst = differences(robot, lw.export.sympy(robot, symbols=symbols))
        assert max(worst.values()) < 1e-12, worst


@pytest.mark.long
@pytest.mark.parametrize("name", ["prr3", "spatial_slider_crank"])
def test_latex_is_well_formed(name):
    """Lines of all equations, every so many, are set by mathtext; braces and environments close."""
    robot = lw.Robot(name)
    text = robot.latex(symbols="all")
    assert text.count("{") == text.count("}")
    assert re.findall(r"\\begin\{(.*?)\}", text).count("align*") == text.count(r"\end{align*}")
    parser = MathTextParser("path")
    blocks = re.findall(r"\\begin\{align\*\}(.*?)\\end\{align\*\}", text, re.DOTALL)
    lines = [line for block in blocks for line in block.split(r"\\")]
    assert len(lines) > 40
    for line in lines[:: 1 + len(lines) // 40]:
        parser.parse(f"${line.strip().replace('&', '')}$")
    assert r"\dot q_{4}" in text and r"\Delta_{1}" in text
    assert "mass centre [kg m$^2$] of" in text


@pytest.mark.parametrize(
    "plain, latex",
    [
        ("acceleration [m/s^2] of link_1", r"acceleration [m/s$^2$] of link\_1"),
        (
            r"100 % & {a}~b\c ^",
            r"100 \% \& \{a\}\textasciitilde{}b\textbackslash{}c \textasciicircum{}",
        ),
    ],
)
def test_plain_text_in_latex(plain, latex):
    assert escaped(plain) == latex


def test_the_module_for_sympy_gives_the_same_numbers():
    robot = lw.Robot("slider_crank").free("gravity.y")
    forms = lw.export.sympy(robot)
    made: dict = {}
    exec(compile(forms.source(), "made", "exec"), made)
    state = robot.state(robot.home.positions, [1.3])
    found = forms.evaluate(state.positions, state.rates)
    values = {
        **dict(zip(made["q"], state.positions, strict=True)),
        **dict(zip(made["v"], state.rates, strict=True)),
        **made["parameters"],
    }
    for name in ("phi", "L", "M", "Cv", "G"):
        number = np.array(made["written_out"](made[name]).subs(values).evalf(), float)
        np.testing.assert_allclose(number.reshape(found[name].shape), found[name], atol=1e-12)


def test_any_name_fits_into_the_module():
    name = 'a """ \\x "b'
    described = lw.Robot("pendulum").mechanism.model_copy(update={"name": name})
    made: dict = {}
    exec(compile(lw.export.sympy(lw.Robot(described)).source(), "made", "exec"), made)
    assert made["__doc__"].startswith(f"{name}: equations")


@pytest.mark.long
def test_refusals(monkeypatch):
    prr3 = lw.Robot("prr3")
    for wrong, sentence in (
        (
            lambda: lw.export.sympy("prr3"),  # pyright: ignore
            "the robot is 'prr3'; give a linkwork.Robot",
        ),
        (
            lambda: prr3.latex(symbols="some"),  # pyright: ignore
            "symbols is 'some'; choose from 'free', 'all'",
        ),
        (lambda: lw.export.sympy(lw.Robot("stewart")), "turns freely, by a quaternion"),
        (lambda: lw.export.sympy(lw.Robot("tripteron")), "the loops couple 5 rates"),
        (lambda: lw.export.sympy(lw.Robot("puma560"), symbols="all"), "at most 6000 are printed"),
        (lambda: lw.export.sympy(prr3).evaluate([0.0], [0, 0, 0]), "give 9 numbers: slide_1"),
        (
            lambda: lw.export.sympy(prr3).evaluate(np.zeros(9), [0, 0, 0], {"m": 1.0}),
            "there is no parameter 'm'; the symbols are none",
        ),
    ):
        with pytest.raises(lw.LinkworkError, match=re.escape(sentence)):
            wrong()
    monkeypatch.setattr(derivation, "AGREEING", 1e-30)
    with pytest.raises(lw.LinkworkError, match="differs from its kernel by"):
        lw.export.sympy(prr3)


def test_without_sympy_it_says_how_to_get_it(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "sympy", None)
    for name in [*__import__("sys").modules]:
        if name.startswith("linkwork.export.symbolic."):
            monkeypatch.delitem(__import__("sys").modules, name)
    with pytest.raises(lw.LinkworkError, match=re.escape("pip install 'linkwork[sympy]'")):
        lw.Robot("pendulum").latex()
