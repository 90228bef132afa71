"""Many members in vector lanes against `integrate`, which takes them one by one."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import simulation_problems as problems
from numba import cfunc, njit, types

from linkwork.errors import LinkworkError
from linkwork.simulation import (
    DORMAND_PRINCE,
    SHARP_SMART,
    Sampled,
    Status,
    as_signal,
    dop853,
    integrate,
)
from linkwork.simulation.many import Starts, as_inputs, integrate_many
from linkwork.simulation.turns import Turning
from linkwork.simulation.vectors import LANES

NUMBERS = types.CPointer(types.double)
COUNTS = ("nfev", "steps", "rejected")
T = np.linspace(0.0, 1.0, 7)
METHODS = pytest.mark.parametrize(
    "method", [DORMAND_PRINCE, SHARP_SMART, dop853()], ids=lambda method: method.name
)
USUAL = pytest.mark.parametrize(
    "method", [DORMAND_PRINCE, SHARP_SMART], ids=lambda method: method.name
)


@cache
def widened(kernel, n_in, n_out):
    """Return the kernel for LANES states side by side that does in each lane what a kernel for one
    state does."""
    body = njit(error_model="numpy")(kernel.__wrapped__)

    @cfunc(types.void(NUMBERS, NUMBERS), error_model="numpy")
    def wide(x, out):
        one, result = np.empty(n_in), np.empty(n_out)
        for lane in range(LANES):
            for m in range(n_in):
                one[m] = x[m * LANES + lane]
            body(one, result)
            for m in range(n_out):
                out[m * LANES + lane] = result[m]

    return wide


def many(motion, y, inputs=(), p=(), closure=None, nq=1, duration=1.0, **options):
    y = np.asarray(y, float)
    table = np.array(p, ndmin=2)
    signal = inputs if not isinstance(inputs, list) else inputs[0]
    nu = (
        as_signal(signal).coefficients.shape[2]
        if not isinstance(signal, np.ndarray)
        else signal.shape[-1]
    )
    n = y.shape[-1]
    wide = widened(motion, n + nu + table.shape[1], n + 1)
    lock = widened(closure, nq + table.shape[1], nq + 1).address if closure else None
    return integrate_many(wide.address, lock, y, inputs, p, nq=nq, duration=duration, **options)


def alone(motion, y, inputs=(), p=(), closure=None, nq=1, duration=1.0, save_at=(), **options):
    lock = closure.address if closure else None
    return integrate(
        motion.address, lock, y[:nq], y[nq:], inputs, p, duration=duration,
        save_at=save_at, **options
    )  # fmt: skip


def require_equal(outcomes, runs):
    for i, run in enumerate(runs):
        assert outcomes.status[i] == run.status, (i, run.message)
        assert outcomes.end_time[i] == pytest.approx(run.end_time, rel=1e-12)
        assert [getattr(outcomes, name)[i] for name in COUNTS] == [
            getattr(run, name) for name in COUNTS
        ]
        np.testing.assert_allclose(
            outcomes.y_end[i], np.concatenate([run.q_end, run.v_end]), rtol=1e-12, atol=1e-14
        )
        assert outcomes.saved[i] == len(run.t)
        samples = np.concatenate([run.q, run.v], axis=1)
        np.testing.assert_allclose(
            outcomes.samples[i, : len(run.t)], samples, rtol=1e-12, atol=1e-14
        )
        assert np.isnan(outcomes.samples[i, len(run.t) :]).all()
        assert outcomes.pivot[i] == pytest.approx(run.pivot, rel=1e-12)


def states(count, size, seed=5):
    return np.random.default_rng(seed).normal(size=(count, size))


@METHODS
@pytest.mark.parametrize("count", [0, 1, LANES - 1, LANES, LANES + 1, 5 * LANES + 2])
def test_members_come_to_what_they_come_to_alone(count, method):
    y = states(count, 2)
    outcomes = many(problems.pendulum, y, save_at=T, method=method)
    require_equal(outcomes, [alone(problems.pendulum, one, save_at=T, method=method) for one in y])
    assert outcomes.samples.shape == (count, len(T), 2)


def test_members_of_very_different_length_share_the_lanes():
    """Pendulums from nearly at rest to hundreds of turns a second."""
    y = np.column_stack([np.zeros(4 * LANES), np.geomspace(1e-3, 2e3, 4 * LANES)[::-1]])
    outcomes = many(problems.pendulum, y, rtol=1e-6)
    assert outcomes.steps.max() > 10 * outcomes.steps.min()
    require_equal(outcomes, [alone(problems.pendulum, one, rtol=1e-6) for one in y])


@USUAL
@pytest.mark.parametrize("save_at", [(), T, [0.0], [1.0], [0.123]])
def test_loops_stay_closed_as_alone(save_at, method):
    angle = np.linspace(0.3, 2.7, 3 * LANES + 1)
    y = np.column_stack([np.cos(angle), np.sin(angle), 0.3 * np.sin(7 * angle)])
    given = {
        "closure": problems.bead_closure,
        "nq": 2,
        "duration": 0.5 * (1 + (len(save_at) > 0)),
        "pivot_bound": 0.05,
    }
    given["method"] = method
    outcomes = many(problems.bead, y, save_at=save_at, **given)
    require_equal(outcomes, [alone(problems.bead, one, save_at=save_at, **given) for one in y])
    assert {Status.FINISHED, Status.SINGULAR} == set(outcomes.status.tolist())
    assert outcomes.closure_error.max() < 1e-13


def test_every_member_has_its_numbers_and_parameters():
    y, u, mass = states(11, 2), states(11, 1, 6), 1 + np.arange(11.0)[:, None]
    outcomes = many(problems.point_mass, y, u, mass)
    require_equal(
        outcomes, [alone(problems.point_mass, *one) for one in zip(y, u, mass, strict=True)]
    )
    np.testing.assert_allclose(outcomes.y_end[:, 0], y[:, 0] + y[:, 1] + u[:, 0] / mass[:, 0] / 2)


@METHODS
@pytest.mark.parametrize("kind", ["spline", "linear", "hold"])
def test_members_follow_one_signal_or_each_its_own(kind, method):
    y, options = states(9, 2), {"save_at": T, "method": method}
    signals = [
        as_signal(Sampled(np.linspace(0, 1, 4 + i), states(4 + i, 1, i), kind)) for i in range(9)
    ]
    require_equal(
        many(problems.point_mass, y, signals[0], [2.0], **options),
        [alone(problems.point_mass, one, signals[0], [2.0], **options) for one in y],
    )
    require_equal(
        many(problems.point_mass, y, signals, [2.0], **options),
        [
            alone(problems.point_mass, *one, [2.0], **options)
            for one in zip(y, signals, strict=True)
        ],
    )


ENDINGS = [
    (problems.drift, None, 2, Status.NON_FINITE, {}),
    (problems.fading, None, 2, Status.SINGULAR, {}),
    (problems.explosion, None, 1, None, {}),
    (problems.free, problems.half_line, 3, Status.CLOSURE_LOST, {"nq": 2}),
    (problems.free, problems.gap, 3, Status.CLOSURE_LOST, {"nq": 2}),
    (problems.pendulum, None, 2, Status.TOO_MANY_STEPS, {}),
]


@pytest.mark.sample(4)
@USUAL
@pytest.mark.parametrize(("motion", "closure", "size", "status", "options"), ENDINGS)
def test_members_that_fail_keep_their_status_and_the_others_go_on(
    motion, closure, size, status, options, method
):
    y = np.zeros((4 * LANES + 1, size))
    y[:, -1] = np.geomspace(0.02, 3.0, len(y))
    given = {"closure": closure, "save_at": T, "method": method} | options
    if status is Status.TOO_MANY_STEPS:
        given["max_steps"] = int(np.median(many(motion, y, **given).steps))
    outcomes = many(motion, y, **given)
    require_equal(outcomes, [alone(motion, one, **given) for one in y])
    found = set(outcomes.status.tolist())
    assert Status.FINISHED in found
    assert len(found) > 1
    assert status in (None, *found)


def test_forces_that_are_not_a_number_end_their_own_member_only():
    y, u = states(3 * LANES, 2), states(3 * LANES, 1)
    good = many(problems.point_mass, y, u, [2.0])
    u[LANES + 1] = math.nan
    outcomes = many(problems.point_mass, y, u, [2.0])
    assert np.flatnonzero(outcomes.status != Status.FINISHED).tolist() == [LANES + 1]
    assert outcomes.status[LANES + 1] == Status.NON_FINITE
    assert outcomes.end_time[LANES + 1] == 0.0
    others = np.arange(3 * LANES) != LANES + 1
    assert np.array_equal(outcomes.y_end[others], good.y_end[others])


def test_members_set_out_where_and_when_each_stands():
    """With their own rows of parameters, spans, steps, times to save at and whole turns."""
    y, u, p = states(7, 2), states(4, 1), np.linspace(1.0, 2.0, 4)[:, None]
    start, duration = np.linspace(0.0, 0.5, 7), np.linspace(0.7, 0.5, 7)
    row, most = np.array([3, 0, 2, 2, 1, 3, 0]), np.array([99, 99, 99, 1, 99, 99, 99])
    stop = start + duration
    first, last = (np.searchsorted(T, times, "right") for times in (start, stop))
    turns = np.where(np.arange(7) % 2, 3.0, 0.0)[:, None]
    turning, bound = Turning(np.array([4.0]), np.ones(1)), np.full(7, 1e-4)
    outcomes = integrate_many(
        widened(problems.point_mass, 4, 3).address, None, y, as_inputs(u, 4), p,
        nq=1, duration=1.0, save_at=T, turning=turning,
        starts=Starts((start, stop, bound), (row, most, first, last), turns),
    )  # fmt: skip
    for i in range(7):
        run = integrate(
            problems.point_mass.address, None, y[i, :1], y[i, 1:], u[row[i]], p[row[i]],
            start=start[i], duration=duration[i], save_at=T[first[i] : last[i]],
            max_steps=int(most[i]), turning=turning, turns=turns[i],
        )  # fmt: skip
        assert outcomes.status[i] == run.status
        assert outcomes.nfev[i] == run.nfev
        assert outcomes.end_time[i] == run.end_time
        assert np.array_equal(outcomes.y_end[i], run.y_end)
        assert np.array_equal(outcomes.turns[i], run.turns)
        kept = outcomes.samples[i, first[i] : outcomes.saved[i]]
        assert np.array_equal(kept, np.concatenate([run.q, run.v], axis=1))
    assert set(outcomes.status.tolist()) == {Status.FINISHED, Status.TOO_MANY_STEPS}


@USUAL
def test_first_steps_are_those_that_are_given(method):
    """Next to members whose first steps are guessed, and in registers where none is."""
    y, u, count = states(2 * LANES + 5, 2), np.array([0.3]), 2 * LANES + 5
    first_steps = np.where(np.arange(count) < LANES, 0.02, np.linspace(0.0, 2.0, count) % 0.7)
    first_steps[-2:] = 0.0
    given = {"max_step": 0.25, "rtol": 1e-7, "method": method}
    starts = replace(Starts.alike(count, (0.0, 1.0, 1e-4), 99, 0, 1), first_steps=first_steps)
    outcomes = integrate_many(
        widened(problems.point_mass, 4, 3).address, None, y, u, [1.5],
        nq=1, duration=1.0, starts=starts, **given,
    )  # fmt: skip
    for i, first in enumerate(first_steps.tolist()):
        run = integrate(
            problems.point_mass.address, None, y[i, :1], y[i, 1:], u, [1.5],
            duration=1.0, save_at=(), first_step=first or None, **given,
        )  # fmt: skip
        assert (outcomes.nfev[i], outcomes.steps[i]) == (run.nfev, run.steps)
        assert np.array_equal(outcomes.y_end[i], run.y_end)
    assert len(set(outcomes.nfev.tolist())) > 1


def test_neighbours_order_and_threads_make_no_difference_to_a_bit():
    y, order = states(203, 2), np.random.default_rng(1).permutation(203)
    one, two = (many(problems.pendulum, y, save_at=T, threads=threads) for threads in (1, 2))
    mixed = many(problems.pendulum, y[order], save_at=T, threads=2)
    for name in ("y_end", "samples", "nfev", "pivot", "end_time"):
        assert np.array_equal(getattr(one, name), getattr(two, name))
        assert np.array_equal(getattr(one, name)[order], getattr(mixed, name))


def test_an_interruption_keeps_what_is_done():
    def interrupt(ended, members):
        if ended:
            raise KeyboardInterrupt

    y = states(4000, 2)
    options = {"max_step": 1e-3, "threads": 1}
    outcomes = many(problems.pendulum, y, progress=interrupt, **options)
    done = outcomes.status == Status.FINISHED
    assert 0 < done.sum() < len(y)
    assert set(outcomes.status[~done].tolist()) == {Status.CANCELLED}
    whole = many(problems.pendulum, y[done][:50], **options)
    assert np.array_equal(outcomes.y_end[done][:50], whole.y_end)
    assert (outcomes.end_time[~done] < 1.0).all()


def test_progress_is_told():
    told = []
    many(problems.pendulum, states(50, 2), progress=lambda *counts: told.append(counts))
    assert told[-1] == (50, 50)
    assert [ended for ended, _ in told] == sorted(ended for ended, _ in told)


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"duration": -1.0}, "duration of a run must be positive"),
        ({"y": np.zeros(2)}, "a row for each member"),
        ({"inputs": np.zeros((4, 1))}, "a row for each of the 3 members"),
        ({"inputs": [as_signal([1.0])] * 2}, "2 signals for 3 members"),
        ({"inputs": Sampled([0.0, 0.5], [[1.0], [2.0]])}, "samples for the whole run"),
        ({"p": np.ones((2, 1))}, "the parameters have the shape"),
        ({"save_at": [0.5, 0.2]}, "must increase"),
        ({"save_at": [2.0]}, "within the run"),
        ({"max_steps": 0}, "max_steps must be at least 1"),
        ({"rtol": 0.0}, "must be positive"),
    ],
)
def test_bad_input_is_refused_in_one_sentence(changes, sentence):
    given = {"y": np.zeros((3, 2)), "inputs": np.zeros((3, 1)), "p": [2.0]} | changes
    with pytest.raises(LinkworkError, match=sentence):
        many(problems.point_mass, **given)
