"""One state asked for straight from Python: the same bits and the same refusals as on the long
way."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import linkwork as lw
from linkwork.gradients import derivatives
from linkwork.gradients.records import Derivatives, ForwardDynamicsDerivatives
from linkwork.model.directly import DirectCalls
from linkwork.model.state import State
from linkwork.model.task import values_directly, values_kernel
from linkwork.model.tool_motion import led_directly, led_kernel

from tests.catalogue import built
from tests.robot.test_hostile_calls import HOSTILE
from tests.robot.test_refusals import slider_driven

Asked = Callable[[lw.Robot, Any, Any], np.ndarray]
CALLS: dict[str, Asked] = {
    "forward": lambda robot, state, given: robot.forward_dynamics(state, given),
    "inverse": lambda robot, state, given: robot.inverse_dynamics(state, given),
    "derivatives": lambda robot, state, given: told(robot, state, given).by_q,
    "terms": lambda robot, state, given: robot.mass_matrix(state) + robot.coriolis(state),
    "forces' derivatives": lambda robot, state, given: together(
        robot.inverse_dynamics_derivatives(state, given), "forces by_q by_v by_accelerations by_p"
    ),
    "inertia's derivatives": lambda robot, state, given: together(
        robot.mass_matrix_derivatives(state), "M by_q by_p"
    ),
    "loops' derivatives": lambda robot, state, given: together(
        robot.closure_derivatives(state), "positions_by_q positions_by_p rates_by_q rates_by_v"
    ),
    "maps": lambda robot, state, given: np.concatenate(
        [robot.rate_map(state), robot.twist_map(state)], axis=-2
    ),
    "joints": lambda robot, state, given: (
        robot.joint_rates(state) + robot.joint_accelerations(state, given)
    ),
    "energy": lambda robot, state, given: np.array(robot.energy(state)),
    "actuation": lambda robot, state, given: robot.actuation(state),
    "its tool": lambda robot, state, given: robot.tool_acceleration(state, given),
    "its task": lambda robot, state, given: (
        robot.task_accelerations(state, given) + robot.task_rates(state) + robot.task_values(state)
    ),
    "its task's Jacobian": lambda robot, state, given: robot.jacobian(state),
    "its tool's derivatives": lambda robot, state, given: together(
        robot.tool_derivatives(state), "pose_by_q pose_by_p twist twist_by_q twist_by_v twist_by_p"
    ),
}
OF_TOOL = 4  # of these calls, the last
TAKING = "forward", "inverse", "derivatives", "forces' derivatives", "joints", "its task"
KERNELS = "motion", "inverse_dynamics", "joints_motion", "tool_motion"
OF_STATE = "terms", "energy", "actuation", "maps"
JACOBIANS = "forward_dynamics", "inverse_dynamics", "mass_matrix", "joints", "tool"
U = np.array([1.0, -2.0, 0.5])
GIVEN = {
    "array": U,
    "list": U.tolist(),
    "tuple": (*U,),
    "integers": [1, -2, 3],
    "mixed": (1, 2.5, 3),
    "names": {"slide_2": 2.0},
    "huge": [10**30, 1, 2],
    "too huge": [10**400, 1, 2],
    "true": [True, 1.0, 2.0],
    "nan": np.array([1.0, np.nan, 2.0]),
    "nan in a list": [1.0, np.nan, 2.0],
    "inf": [np.inf, 1.0, 2.0],
    "single": U.astype(np.float32),
    "gaps": np.repeat(U, 2)[::2],
    "reversed": U[::-1],
    "big endian": U.astype(">f8"),
    "row": U[None],
    "stack": np.ones((4, 3)),
    "short": U[:2],
    "long": np.ones(4),
    "empty": [],
    "texts": ["1", "2", "3"],
    "matrix": np.asmatrix(U),
    "masked": np.ma.array(U),
    **{f"hostile: {name}": value for name, value in HOSTILE.items()},
}


def told(robot: lw.Robot, state: Any, given: Any) -> ForwardDynamicsDerivatives:
    """Return derivatives."""
    return robot.forward_dynamics_derivatives(state, given)


def together(record: Derivatives, names: str) -> np.ndarray:
    """Return fields of a record one behind the other, and how they lie in memory."""
    arrays = [getattr(record, name) for name in names.split()]
    assert all(array.flags.writeable for array in arrays)
    return np.concatenate([np.append(array.ravel(), array.shape) for array in arrays])


def moving(robot: lw.Robot) -> State:
    """Return a state that moves, of a robot that has code."""
    last = None if robot.mechanism.tools else -1
    for name in (*OF_STATE, *KERNELS[:last]):
        assert robot.kernel(name).address
    if robot.mechanism.tools:
        task = robot.task_coordinates()
        kernels = [led_kernel(robot.chart, task, accelerating) for accelerating in (True, False)]
        assert all(kernel.address for kernel in (*kernels, values_kernel(robot.chart, task)))
    for name in JACOBIANS[:last]:
        assert derivatives.derivative_kernel(robot, name).address
    return robot.home.with_rates(np.linspace(0.1, 0.3, robot.mobility))


@pytest.fixture(scope="module")
def robot() -> lw.Robot:
    robot = lw.Robot("prr3").free("platform.mass")
    state = moving(robot)
    calls = [robot.directly(name) for name in KERNELS]
    for call in calls:
        assert call.at(state, U) is not None
    for name in OF_STATE:
        assert robot.directly(name).at(state) is not None
    task = robot.task_coordinates()
    assert robot.once(led_directly, task, True).at(state, U) is not None
    for call in (robot.once(led_directly, task, False), robot.once(values_directly, task)):
        assert call.at(state) is not None
    for name in JACOBIANS:
        given = U if name in JACOBIANS[:2] else None
        assert derivatives.directly(robot, name, state, given) is not None
    return robot


def outcome(call: Asked, *given: Any) -> str | bytes:
    """Return the bits of a result, or the sentence of a refusal."""
    try:
        found = call(*given)
    except lw.LinkworkError as error:
        return f"{type(error).__name__}: {error}"
    return str(found.shape).encode() + found.tobytes()


def both(monkeypatch: pytest.MonkeyPatch, *given: Any) -> tuple[str | bytes, str | bytes]:
    """Return what comes of a call, straight and on the long way."""
    straight = outcome(*given)
    with monkeypatch.context() as patch:
        patch.setattr(DirectCalls, "at", lambda *_: None)
        return straight, outcome(*given)


@pytest.mark.long
@pytest.mark.parametrize("name", GIVEN)
@pytest.mark.parametrize("call", TAKING)
def test_what_is_given_is_answered_or_refused_alike(robot, monkeypatch, call, name):
    straight, long = both(monkeypatch, CALLS[call], robot, moving(robot), GIVEN[name])
    assert straight == long


@pytest.mark.sample(13)
@pytest.mark.parametrize("call", CALLS)
def test_states_are_answered_or_refused_alike(robot, monkeypatch, call):
    state, other = moving(robot), lw.Robot("five_bar")
    heavier = robot.with_parameters({"platform.mass": 2 * robot.parameters["platform.mass"]})
    turned = robot.in_chart(state, ("slide_1", "slide_2", "pivot_1"))
    named = state.coordinates, state.independent
    states: dict[str, Any] = {
        "its own": state,
        "pickled": pickle.loads(pickle.dumps(state)),
        "a stack": robot.state(np.array([state.positions] * 3)),
        "one of a stack": robot.state(np.array([state.positions] * 3)).at(1),
        "another robot's": other.home,
        "of other free numbers": heavier.home,
        "in other rates": turned,
        "no number": State(state.positions, state.rates * np.nan, state.q, *named),
        "too short": State(state.positions, state.rates[:2], state.q, *named),
        "the robot": robot,
        "nothing": None,
    }
    for which in (robot, heavier, pickle.loads(pickle.dumps(robot))):
        for name, given in states.items():
            straight, long = both(monkeypatch, CALLS[call], which, given, U)
            assert straight == long, name


@pytest.mark.sample(10)
@pytest.mark.parametrize("call", list(CALLS)[:-OF_TOOL])
def test_singular_configurations_are_refused_alike(monkeypatch, call):
    """Where crank and rod are stretched the slider's rate does not determine the others."""
    robot = slider_driven()
    moving(robot)
    stretched = robot.state({"crank": 0, "knee": 0, "pin": 0, "slide": 2})
    straight, long = both(monkeypatch, CALLS[call], robot, stretched, [1.0])
    assert straight == long and "is singular" in str(straight)


@pytest.mark.parametrize("threads", ["many", 0, 2.5, True])
def test_threads_that_are_no_number_are_refused_of_one_state_too(threads):
    robot = built("five_bar")
    state, given = robot.home, [1.0, 2.0]
    for ask in (
        lambda n: robot.forward_dynamics(state, given, threads=n),
        lambda n: robot.inverse_dynamics(state, given, threads=n),
        lambda n: robot.forward_dynamics_derivatives(state, given, threads=n),
        lambda n: robot.inverse_dynamics_derivatives(state, given, threads=n),
        lambda n: robot.mass_matrix_derivatives(state, threads=n),
        lambda n: robot.closure_derivatives(state, threads=n),
        lambda n: robot.tool_derivatives(state, threads=n),
    ):
        ask(1)
        ask(None)
        with pytest.raises(lw.LinkworkError, match="threads"):
            ask(threads)
