"""Calls with what does not belong there: each is refused in one sentence, or answered with finite
numbers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import linkwork as lw
from linkwork import analysis, control, paths, views

HOSTILE: dict[str, Any] = {
    "none": None,
    "text": "x",
    "numeral": "2",
    "no names": {},
    "nan": np.nan,
    "inf": np.inf,
    "huge": 1e30,
    "object": object(),
    "complex": 1j,
    "holes": [1.0, None],
    "table": np.ones((2, 2, 2)),
    "function": lambda: 1.0,
}


class World:
    """Hold robots, states and a run for the calls."""

    def __init__(self) -> None:
        self.arm = lw.Robot(lw.robots.five_bar())
        self.four = lw.Robot(lw.robots.four_bar().model_copy(update={"actuators": ()}))
        self.state = self.arm.home
        self.run = self.arm.simulate(self.state, duration=0.01)
        self.path = paths.line([0.1, 0.3], [0.15, 0.3])


@pytest.fixture(scope="module")
def world():
    return World()


def run(w: World, **options: Any) -> lw.Run:
    return w.arm.simulate(w.state, **({"duration": 1e-3, "save_at": [1e-3]} | options))


def many(w: World, **options: Any):
    return w.arm.ensemble(w.state, **({"duration": 1e-3, "threads": 1} | options))


CALLS: dict[str, Callable[[World, Any], Any]] = {
    "Robot": lambda w, x: lw.Robot(x),
    "Robot.independent": lambda w, x: lw.Robot(w.arm.mechanism, x),
    "from_file": lambda w, x: lw.Robot.from_file(x),
    "Mechanism.load": lambda w, x: lw.Mechanism.load(x),
    "Mechanism.parse": lambda w, x: lw.Mechanism.parse(x),
    "Mechanism.save": lambda w, x: w.arm.mechanism.save(x),
    "Run.load": lambda w, x: lw.Run.load(x),
    "Run.save": lambda w, x: w.run.save(x),
    "free": lambda w, x: w.arm.free(x),
    "with_parameters": lambda w, x: w.arm.with_parameters(x),
    "state": lambda w, x: w.arm.state(x),
    "state.rates": lambda w, x: w.arm.state(w.state.positions, x),
    "state.tolerance": lambda w, x: w.arm.state(w.state.positions, tolerance=x),
    "with_rates": lambda w, x: w.state.with_rates(x),
    "at": lambda w, x: w.arm.make_state(np.tile(w.state.q, (3, 1)), np.zeros((3, 2))).at(x),
    "state[]": lambda w, x: w.state[x],
    "assemble": lambda w, x: w.arm.assemble(x),
    "assemble.joint": lambda w, x: w.arm.assemble({w.arm.coordinates[0]: x}),
    "assemble.tool": lambda w, x: w.arm.assemble(tool=x),
    "assemble.guess": lambda w, x: w.arm.assemble(tool=[0.1, 0.3], guess=x),
    "follow": lambda w, x: w.arm.follow(x, 1.0, samples=3),
    "follow.duration": lambda w, x: w.arm.follow(w.path, x, samples=3),
    "follow.samples": lambda w, x: w.arm.follow(w.path, 1.0, samples=x),
    "in_chart": lambda w, x: w.arm.in_chart(w.state, x),
    "in_chart.state": lambda w, x: w.arm.in_chart(x, w.arm.independent),
    "forward": lambda w, x: w.arm.forward_dynamics(w.state, x),
    "forward.state": lambda w, x: w.arm.forward_dynamics(x, [0.0, 0.0]),
    "forward without actuators": lambda w, x: w.four.forward_dynamics(w.four.home, x),
    "inverse": lambda w, x: w.arm.inverse_dynamics(w.state, x),
    "inverse.state": lambda w, x: w.arm.inverse_dynamics(x, [0.0, 0.0]),
    "inverse.weights": lambda w, x: w.arm.inverse_dynamics(w.state, [0.0, 0.0], weights=x),
    "mass_matrix": lambda w, x: w.arm.mass_matrix(x),
    "energy": lambda w, x: w.arm.energy(x),
    "body_poses": lambda w, x: w.arm.body_poses(x),
    "tool_pose": lambda w, x: w.arm.tool_pose(x),
    "joint_accelerations": lambda w, x: w.arm.joint_accelerations(w.state, x),
    "unit": lambda w, x: w.arm.unit(x),
    "reactions": lambda w, x: w.arm.reactions(w.state, x).wrenches,
    "reactions.frame": lambda w, x: w.arm.reactions(w.state, [0.0, 0.0], frame=x).wrenches,
    "reactions.length": lambda w, x: w.arm.reactions(w.state, [0.0, 0.0], length=x).wrenches,
    "linearise": lambda w, x: w.arm.linearise(w.state, x),
    "observe": lambda w, x: w.arm.observe(x),
    "simulate.state": lambda w, x: w.arm.simulate(x, duration=1e-3),
    "simulate.forces": lambda w, x: w.arm.simulate(w.state, x, duration=1e-3),
    "simulate.duration": lambda w, x: w.arm.simulate(w.state, duration=x, max_steps=3),
    **{
        f"simulate.{name}": lambda w, x, name=name: run(w, **{name: x})
        for name in (
            *(
                "drives",
                "wrenches",
                "method",
                "step",
                "events",
                "parameters",
                "rtol",
                "atol",
                "save_at",
            ),
            *("max_step", "max_steps", "on_singular"),
        )
    },
    "simulate.rk4": lambda w, x: run(w, method="rk4", step=x, max_steps=3),
    "resume": lambda w, x: w.arm.resume(x, duration=1e-3),
    "resume.duration": lambda w, x: w.arm.resume(w.run, duration=x, max_steps=3),
    "ensemble": lambda w, x: w.arm.ensemble(x, duration=1e-3),
    **{
        f"ensemble.{name}": lambda w, x, name=name: many(w, **{name: x})
        for name in ("forces", "parameters", "save_at", "threads", "max_steps", "rtol")
    },
    "run.reactions": lambda w, x: w.run.reactions(x),
    "run.plot": lambda w, x: w.run.plot(x),
    "plot_run": lambda w, x: views.plot_run(x),
    "circle": lambda w, x: paths.circle(x, 0.1).sample(np.array([0.0, 1.0]), 1.0),
    "circle.radius": lambda w, x: paths.circle([0.0, 0.0], x).sample(np.array([0.0, 1.0]), 1.0),
    "circle.orientation": lambda w, x: paths.circle([0.0, 0.0], 0.1, x).sample(
        np.array([0.0, 1.0]), 1.0
    ),
    "circle.turns": lambda w, x: paths.circle([0.0, 0.0], 0.1, turns=x).sample(
        np.array([0.0, 1.0]), 1.0
    ),
    "circle.law": lambda w, x: paths.circle([0.0, 0.0], 0.1, law=x),
    "line": lambda w, x: paths.line(x, [0.0, 0.0]).sample(np.array([0.0, 1.0]), 1.0),
    "line.end": lambda w, x: paths.line([0.0, 0.0], x).sample(np.array([0.0, 1.0]), 1.0),
    "through": lambda w, x: paths.through(x).sample(np.array([0.0, 1.0]), 1.0),
    "together": lambda w, x: paths.together(x).sample(np.array([0.0, 1.0]), 1.0),
    "swing": lambda w, x: paths.swing(x, 1.0).sample(np.array([0.0, 1.0]), 1.0),
    "Frame": lambda w, x: lw.Frame(position=x),
    "Frame.planar": lambda w, x: lw.Frame.planar(x),
    "Frame.from_quaternion": lambda w, x: lw.Frame.from_quaternion((0, 0, 0), x),
    "Frame.from_rpy": lambda w, x: lw.Frame.from_rpy((0, 0, 0), x, 0.0, 0.0),
    "Body": lambda w, x: lw.Body(mass=x),
    "Sampled": lambda w, x: lw.Sampled([0.0, 1.0], x),
    "Sampled.time": lambda w, x: lw.Sampled(x, [[0.0], [1.0]]),
    "Sampler": lambda w, x: control.Sampler(x),
    "Sampler.rate": lambda w, x: control.Sampler(lambda t, s: [0.0, 0.0], x),
    "Sampler.quantise": lambda w, x: control.Sampler(lambda t, s: [0.0, 0.0], quantise=x),
    "Event": lambda w, x: run(w, events=control.Event(x)),
    "Lag": lambda w, x: control.Lag(x),
    "jacobians": lambda w, x: analysis.jacobians(x),
    "jacobians of a state": lambda w, x: analysis.jacobians(w.arm, x),
}


def finite(value: Any) -> bool:
    """Tell whether an answer holds no number that is none."""
    parts = (
        value
        if isinstance(value, tuple | list)
        else value.values()
        if isinstance(value, dict)
        else [value]
    )
    arrays = [
        part
        for part in parts
        if isinstance(part, np.ndarray | float) and np.asarray(part).dtype.kind == "f"
    ]
    return all(np.isfinite(array).all() for array in arrays)


@pytest.mark.parametrize("call", CALLS)
def test_a_call_is_refused_in_a_sentence_or_answered(world, tmp_path, monkeypatch, call):
    monkeypatch.chdir(tmp_path)
    for kind, hostile in HOSTILE.items():
        try:
            answer = CALLS[call](world, hostile)
        except lw.LinkworkError as error:
            sentence = str(error)
            short = 15 < len(sentence) < 1000 and "\n" not in sentence.strip()
            assert short, (kind, sentence)
        except Exception as error:
            error.add_note(f"{call} was given {kind}")
            raise
        else:
            assert finite(answer), (kind, answer)
