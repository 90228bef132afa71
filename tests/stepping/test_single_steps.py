"""A single step straight from Python: the same bits, charts and refusals as steps that go the long
way."""

from __future__ import annotations

import sys
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

import linkwork as lw
from linkwork.kernels.from_python import left_to_others
from linkwork.stepping import Stepper

from tests.catalogue import built

U = np.array([0.5, -0.25, 0.75])
GIVEN: dict[str, Any] = {
    "array": U,
    "list": U.tolist(),
    "integers": (1, 2, 3),
    "none": None,
    "names": {"slide_2": 1.0},
    "nan": np.array([1.0, np.nan, 2.0]),
    "nan in a list": [1.0, np.nan, 2.0],
    "single": U.astype(np.float32),
    "gaps": np.repeat(U, 2)[::2],
    "short": U[:2],
    "table": U[None],
    "text": "abc",
    "true": [True, 1.0, 2.0],
}


def long_way(stepper: Stepper) -> Stepper:
    """Return a stepper that never steps straight."""
    stepper._single = left_to_others
    return stepper


def outcome(stepper: Stepper, u: Any, own: bool) -> tuple[object, ...]:
    """Return what comes of a step, in bits or in a sentence, and what is left of forces and
    state."""
    try:
        found = stepper.step(u, out=stepper.y if own else None).tobytes()
    except lw.LinkworkError as error:
        found = f"{type(error).__name__}: {error}"
    return found, stepper.time, stepper.u.tobytes(), stepper.y.tobytes()


@pytest.mark.parametrize("own", [False, True], ids=["a new array", "its own"])
@pytest.mark.parametrize("method", ["rk4", "rodas"])
def test_whatever_is_given_is_taken_or_refused_alike(method, own):
    robot = built("prr3")
    start = robot.home.with_rates([0.1, 0.2, 0.1])
    straight, other = (robot.stepper(start, 1e-3, method=method) for _ in range(2))
    long_way(other)
    for name, u in GIVEN.items():
        assert outcome(straight, u, own) == outcome(other, u, own), name
        assert outcome(straight, U, own) == outcome(other, U, own), name
    for stepper in (straight, other):
        stepper.y[0] += 1e-3  # written between two steps
    assert outcome(straight, None, own) == outcome(other, None, own)
    for stepper in (straight, other):
        stepper.u[1] = np.inf
    assert outcome(straight, None, own) == outcome(other, None, own)


def test_charts_change_on_the_way_alike():
    robot = built("rrr3")
    start = robot.home.with_rates(0.3 * np.ones(robot.mobility))
    straight, other = robot.stepper(start, 1e-3), long_way(robot.stepper(start, 1e-3))
    for k in range(200):
        assert outcome(straight, U, False) == outcome(other, U, False), k
    assert straight.independent == other.independent != robot.independent


def test_steppers_step_in_threads_of_their_own():
    robot = built("prr3")
    steppers = [robot.stepper(robot.home, 1e-3) for _ in range(4)]
    alone = long_way(robot.stepper(robot.home, 1e-3))
    for _ in range(500):
        alone.step(U)

    def walk(stepper: Stepper) -> bytes:
        for _ in range(500):
            stepper.step(U)
        return stepper.y.tobytes()

    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        with ThreadPoolExecutor(4) as pool:
            assert set(pool.map(walk, steppers)) == {alone.y.tobytes()}
    finally:
        sys.setswitchinterval(interval)


def test_a_single_step_goes_straight(monkeypatch):
    robot = built("prr3")
    stepper = robot.stepper(robot.home, 1e-3)
    monkeypatch.setattr(Stepper, "_take", None)
    kept = stepper.step(U)
    before = kept.copy()
    assert stepper.step(U.tolist()) is not kept and (kept == before).all()
    assert stepper.step(out=stepper.y) is stepper.y
    assert stepper.time == pytest.approx(3e-3)
