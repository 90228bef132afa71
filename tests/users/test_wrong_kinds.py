"""Arguments of a wrong kind: each of a call that works is made wrong in turn, and either that is
taken, or one sentence says what would be right."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from typing import Any

import matplotlib
import numpy as np
import pytest

import linkwork as lw
from linkwork import analysis, design, export, gradients, motions, sweeps, views

matplotlib.use("Agg")

NAN = float("nan")
FIT = ("robot", "state", "states", "run", "path", "timed", "workspace", "figure")


class Things:
    """What calls that work are made of."""

    def __init__(self) -> None:
        robot = lw.Robot("prr3")
        self.robot, self.state, self.limits = robot, robot.home, motions.AxisLimits(1.0, 2.0, 9.0)
        self.states = robot.state(np.tile(robot.home.positions, (3, 1)), np.zeros((3, 3)))
        self.run = robot.simulate(robot.home, [0.1, 0, 0], duration=0.02)
        start = np.asarray(robot.task_values(robot.home)).ravel()
        self.path = lw.paths.line(start, start + np.array([2e-3, 0, 0]))
        self.timed = motions.along(self.path, self.limits)
        grid = {"x": start[0] + np.array([0, 1e-3]), "y": start[1] + np.array([0, 1e-3])}
        self.workspace = analysis.workspace(robot, {**grid, "angle": [start[2]]})
        self.figure = views.plot_run(self.run)

    def wrong(self) -> list[Any]:
        """Return what fits few arguments: other kinds, numbers that are none, parts of calls."""
        others = [getattr(self, name) for name in FIT]
        plain = [None, "nonsense", -1, -1.5, NAN, True, [1.0, 2.0], [], {"a": "b"}, [None], b"x"]
        arrays = [np.array(["a"]), np.full(3, NAN), np.zeros((2, 2))]
        return [*others, *plain, *arrays, {"slide_1": None}, object(), lambda given: given]


@pytest.fixture(scope="module")
def things():
    return Things()


def calls(t: Things, folder: Any) -> Mapping[Callable[..., Any], dict[str, Any]]:
    """Return functions with arguments that they take."""
    force, here = motions.ActuatorLimits(force=50.0), {"robot": t.robot, "state": t.state}
    points = {"points": [[0, 0], [1, 0], [1, 1]], "limits": t.limits}
    law = {"distance": 1.0, "speed": 1.0, "acceleration": 1.0, "jerk": None}
    period = {"period": 1.0, "harmonics": 2, "guess": None}
    measured = np.tile(t.state.positions[:3], (9, 1))
    poses = {"measure": "pose", "joints": (), "position": None, "encoders": None}
    stiffness = dict.fromkeys(t.robot.actuators, 1e5)
    return {
        analysis.along: {"robot": t.robot, "motion": t.run, "what": None, "length": None},
        analysis.base_parameters: {"robot": t.robot, "effects": (), "samples": 30, "seed": 0},
        analysis.best_poses: {"robot": t.robot, "candidates": t.states, "count": 2, "seed": 0}
        | poses,
        analysis.calibrate: {"robot": t.robot, "measured": None},
        analysis.content: {"mapped": t.workspace},
        analysis.dexterity: {**here, "what": None, "length": None},
        analysis.distributed_forces: {**here, "accelerations": [0, 0, 0], "lower": -9, "upper": 9},
        analysis.equilibria: {"robot": t.robot, "forces": [0, 0, 0], "starts": 2, "seed": 0},
        analysis.equilibrium: {"robot": t.robot, "forces": None, "guess": None, "stable": True},
        analysis.error_budget: {"robot": t.robot, "states": t.state, "tolerances": None},
        analysis.global_conditioning: {"mapped": t.workspace},
        analysis.identify: {"robot": t.robot, "measured": t.run, "effects": (), "seed": 0},
        analysis.input_output: {**here, "what": None},
        analysis.inscribed: {"mapped": t.workspace, "at_least": 0.0},
        analysis.jacobians: {"robot": t.robot, "what": None},
        analysis.linearise: {**here, "forces": None, "outputs": None, "inputs": None},
        analysis.loci: {"mapped": t.workspace, "name": "det_A", "level": 0.0},
        analysis.natural_modes: {**here, "forces": None},
        analysis.observability: {"robot": t.robot, "states": t.states, **poses},
        analysis.payload: {"robot": t.robot, "measured": t.run, "tool": None, "spread": 3.0},
        analysis.periodic: {"robot": t.robot, "time": np.linspace(0, 1, 9), "positions": measured}
        | {"forces": np.zeros((9, 3)), **period},
        analysis.possible: {"identification": None, "spread": 1.0},
        analysis.singularity: {**here, "what": None, "bound": 1e-6},
        analysis.stiffness_matrix: {**here, "forces": None},
        analysis.tool_stiffness: {**here, "stiffness": stiffness, "forces": None},
        analysis.transmission_indices: here,
        analysis.workspace: {"robot": t.robot, "grid": {"x": [0.5]}, "guess": None}
        | {"limits": None, "rates": None, "forces": None, "length": None},
        design.optimise: {"robot": t.robot, "numbers": {"link_1.mass": (0.1, 1.0)}}
        | {"objective": None, "subject_to": None},
        export.c: {"robot": t.robot, "functions": ["nonsense"], "precision": "double"}
        | {"parameters": "fixed", "sines": "polynomial", "name": None, "misra": False},
        export.casadi: {"robot": t.robot, "chart": None},
        export.mujoco: {"robot": t.robot, "softness": 1e-3},
        gradients.compiled: {"chart": t.robot.chart, "what": "actuation", "form": "jacobian"},
        gradients.derivative_kernel: {"robot": t.robot, "what": "actuation", "state": None},
        gradients.expressed: {"equations": t.robot.equations, "what": "actuation", "form": "jvp"},
        motions.along: {"path": t.path, "limits": t.limits, "law": "s_curve", "position": None},
        motions.blended: {**points, "blend": 0.25, "law": "s_curve"},
        motions.cycloidal: law,
        motions.fastest: {"robot": t.robot, "path": t.path, "limits": force, "points": 9},
        motions.follow: {"robot": t.robot, "timed": t.timed, "samples": 5, "guess": None}
        | {"keep_limits": True, "what": None},
        motions.gcode: {"text": "G1 X1 Y1 F60", "limits": t.limits, "start": None}
        | {"orientation": None, "law": "s_curve", "planar": False},
        motions.pick_and_place: {"pick": [0, 0], "place": [1, 0], "lift": [0, 0.1]}
        | {"limits": t.limits, "blend": 0.25, "law": "s_curve"},
        motions.point_to_point: {"start": [0, 0], "end": [1, 1], "limits": t.limits}
        | {"law": "s_curve", "synchronised": True},
        motions.polynomial: {**law, "degree": 5},
        motions.read_csv: {"path": "no.csv", "names": ()},
        motions.s_curve: {**law, "jerk": 1.0},
        motions.through: {**points, "degree": 3, "timing": "straight"},
        motions.trapezoidal: law,
        motions.write_csv: {"path": folder / "t.csv", "motion": t.timed, "robot": None}
        | {"forces": None, "samples": 5},
        sweeps.Study.load: {"path": "no.yaml"},
        sweeps.summary: {"store": None},
        sweeps.sweep: {"study": None, "folder": folder / "results"},
        sweeps.write: {"store": None, "found": None, "folder": folder},
        views.plot_mechanism: {**here, "ax": None, "names": False},
        views.plot_motion: {
            "robot": t.robot,
            "motion": t.run,
            "ax": None,
            "poses": 2,
            "path": True,
        },
        views.plot_phase: {"runs": t.run, "coordinates": None},
        views.plot_run: {"run": t.run, "quantities": None},
        views.plot_timed_path: {"timed": t.timed, "robot": None},
        views.plot_workspace: {"mapped": t.workspace, "quantity": "conditioning", "ax": None},
        views.save_figure: {"drawn": t.figure, "path": folder / "f.svg"},
        views.write_gltf: {
            "robot": t.robot,
            "motion": t.run,
            "path": folder / "a.glb",
            "fps": 30.0,
        },
        views.write_report: {"robot": t.robot, "run": t.run, "path": "report.pdf", "over": t.state},
    }


def faults(function: Callable[..., Any], given: dict[str, Any], wrong: list[Any]) -> list[str]:
    """Return what a function raises that is no sentence of ours."""
    found = []
    for name in given:
        for value in wrong:
            try:
                function(**{**given, name: value})
            except lw.LinkworkError as refusal:
                if "\n" in str(refusal):
                    found.append(f"{name}={value!r}: {refusal}")
            except Exception as error:
                found.append(f"{name}={value!r}: {type(error).__name__}: {error}")
    return found


@pytest.mark.long
@pytest.mark.parametrize("module", [analysis, design, export, gradients, motions, sweeps, views])
def test_each_argument_made_wrong_in_turn(things, module, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    wrong = things.wrong()
    for function, given in calls(things, tmp_path).items():
        owner = inspect.getmodule(function)
        if function.__name__ in (*module.__all__, "load") and owner.__name__.startswith(
            module.__name__ if function is not analysis.linearise else "linkwork.model"
        ):
            assert not (found := faults(function, given, wrong)), f"{function.__name__}: {found}"


def test_what_is_said_names_the_argument_and_what_would_be_right(things):
    robot, state = things.robot, things.state
    for sentence, ask in {
        "the state is None; give a linkwork.State": lambda: analysis.tool_stiffness(
            robot, None, {"slide_1": 1e5}
        ),
        "the stiffnesses are 1e5; give them by name, such as {'slide_1': 1e5}": (
            lambda: analysis.tool_stiffness(robot, state, 1e5)
        ),
        "the robot is None; give a linkwork.Robot": lambda: analysis.tool_stiffness(
            None, state, {"slide_1": 1e5}
        ),
        "the folder is 3; give the path of a folder": lambda: sweeps.sweep(
            sweeps.Study.model_construct(), 3
        ),
        "seed is -1; give a whole number, not below zero": lambda: analysis.equilibria(
            robot, seed=-1
        ),
        "the path of a study is 3; give the path of a file": lambda: sweeps.Study.load(3),
        "ax is 3; give axes of matplotlib, or leave it out": lambda: views.plot_mechanism(
            robot, state, 3
        ),
        "the run is 3; give a linkwork.Run": lambda: views.plot_phase(3),
        "no coordinate of the tool is named; name one at least": lambda: analysis.jacobians(
            robot, ()
        ),
    }.items():
        with pytest.raises(lw.LinkworkError) as refusal:
            ask()
        assert sentence.replace("1e5;", "100000.0;") in str(refusal.value)
