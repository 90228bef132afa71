"""A chunk is a function of the study and its number, whatever was computed before it in the same
process."""

from __future__ import annotations

import numpy as np
import pytest

import linkwork as lw
from linkwork.sweeps import Study
from linkwork.sweeps import chunk as chunks

FORCES = {f"forces.slide_{i}": {"type": "uniform", "low": -40, "high": 40} for i in (1, 2, 3)}
GIVEN = Study(
    robot=lw.robots.prr3(),
    duration=0.4,
    samples=9,
    start={"tool": (0.5, 0.288, 0.5)},
    vary=FORCES | {"platform.mass": {"type": "uniform", "low": 1, "high": 3}},
    design={"type": "random", "members": 12, "seed": 3},
    outputs={"force": "peak actuator_force", "acceleration": "peak joint_acceleration"},
    trajectories=("joint_position", "energy"),
    on_singular="step_over",
    chunk=4,
)


@pytest.mark.long
def test_members_that_change_charts_do_not_depend_on_others(monkeypatch):
    """As in a sweep that is resumed: the last chunk after others, and as the first of all, bit for
    bit."""
    taken, measured = [], chunks.measured

    def noted(bench, law, ensemble, *rest):
        taken.append({rows.chart.key for rows in ensemble.rows() if len(rows.members)})
        return measured(bench, law, ensemble, *rest)

    monkeypatch.setattr(chunks, "measured", noted)
    chunks._bench.cache_clear()
    *before, after = (chunks.compute(GIVEN, index) for index in range(3))
    chunks._bench.cache_clear()
    alone = chunks.compute(GIVEN, 2)
    *earlier, last, again = taken
    assert last == again and len(last) > 2 and set.union(*earlier) & last
    assert all((part["status"] == 0).any() for part in (*before, after))
    for name, values in alone.items():
        np.testing.assert_array_equal(values, after[name], err_msg=name)
