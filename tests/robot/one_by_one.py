"""What an ensemble is compared with: the same runs one by one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

import linkwork as lw
from linkwork.runs.ensemble import Ensemble


def random(*shape: int, seed: int = 3) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=shape)


def require_equal(members: Ensemble, runs: Sequence[lw.Run]) -> None:
    """Require that every member came to what its own run came to."""
    assert len(members) == len(runs)
    for i, run in enumerate(runs):
        assert members.status[i] == run.status, members.message(i)
        assert members.message(i) == run.message
        assert members.end_time[i] == pytest.approx(run.attrs["final_time"], rel=1e-12)
        np.testing.assert_allclose(members.final.q[i], run.attrs["final_q"], rtol=1e-12, atol=1e-13)
        for name in ("nfev", "steps", "rejected"):
            assert getattr(members, name)[i] == getattr(run, name)
        for name in ("joint_position", "joint_rate", "tool_pose", "drive_state"):
            if name in run.variables:
                given, reached = run[name].values, members.dataset[name].values[i]
                np.testing.assert_allclose(reached[: len(given)], given, rtol=1e-11, atol=1e-12)
                assert np.isnan(reached[len(given) :]).all()
        if "event" in run.coords:
            names, times = zip(*members.events(i), strict=True) if members.events(i) else ((), ())
            assert list(names) == run.coords["event"].values.tolist()
            np.testing.assert_allclose(times, run.coords["event_time"].values, rtol=1e-12)
