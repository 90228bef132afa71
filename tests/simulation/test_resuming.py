"""A run that stopped and is continued is the run that did not stop, bit for bit."""

import math

import numpy as np
import pytest
from simulation_problems import bead, bead_closure, bead_jacobian, driven_point, servo

from linkwork.simulation import (
    DORMAND_PRINCE,
    RK4,
    RODAS,
    Control,
    Status,
    SymplecticEuler,
    dop853,
    integrate,
)

METHODS = pytest.mark.parametrize(
    "method",
    [DORMAND_PRINCE, dop853(), RODAS, RK4(0.01), SymplecticEuler(0.001)],
    ids=lambda method: method.name,
)


def swing(method, q, v, **options):
    return integrate(
        bead.address, bead_closure.address, q, v, [], method=method, jacobian=bead_jacobian.address,
        **{"duration": 3.0, "save_at": [3.0]} | options,
    )  # fmt: skip


@METHODS
@pytest.mark.parametrize("stops", [1, 7])
def test_stopped_by_max_steps_and_continued(method, stops):
    start = [math.sin(1.2), -math.cos(1.2)]
    whole = swing(method, start, [0.0])
    part = swing(method, start, [0.0], max_steps=stops)
    assert part.status is Status.TOO_MANY_STEPS
    rest = swing(
        method,
        part.q_end,
        part.v_end,
        start=part.end_time,
        duration=3.0 - part.end_time,
        first_step=part.pace,
    )
    assert (
        rest.success
        and part.steps + rest.steps == whole.steps
        and part.rejected + rest.rejected == whole.rejected
    )
    np.testing.assert_array_equal(rest.q_end, whole.q_end)
    np.testing.assert_array_equal(rest.v_end, whole.v_end)
    assert rest.pace == whole.pace


@pytest.mark.parametrize("method", [DORMAND_PRINCE, RK4(0.01)], ids=lambda method: method.name)
def test_a_sampled_controller_goes_on_with_what_it_holds(method):
    def position(q, v, control, **options):
        return integrate(
            driven_point.address, 0, q, v, [1.0], [4.0], method=method, control=control, **options
        )

    control = Control(servo.address, 0.05, np.zeros(1))
    whole = position([0.0], [0.0], control, duration=2.0)
    part = position([0.0], [0.0], control, duration=2.0, max_steps=9)
    rest = position(
        part.q_end,
        part.v_end,
        part.control,
        start=part.end_time,
        duration=2.0 - part.end_time,
        first_step=part.pace,
    )
    assert rest.control is not None and whole.control is not None
    np.testing.assert_array_equal([rest.q_end, rest.v_end], [whole.q_end, whole.v_end])
    assert (rest.control.held, rest.control.next_sample) == (
        whole.control.held,
        whole.control.next_sample,
    )
