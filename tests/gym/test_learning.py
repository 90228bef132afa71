"""The examples that learn do so, shortened."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from tests.processes import finished

FOLDER = Path(__file__).parents[2] / "examples" / "learning"


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "steps", "rows", "least"), [("by_gradients", 1920, 4, 85), ("ppo", 32768, 1, 60)]
)
def test_a_policy_is_worth_more_after_it_has_learned(name, steps, rows, least, tmp_path):
    """A robot that does nothing returns 46."""
    quickly = os.environ | {"JAX_DISABLE_MOST_OPTIMIZATIONS": "1"}  # compiled for a few seconds
    told = finished(FOLDER / f"{name}.py", steps, cwd=tmp_path, env=quickly, check=True).stdout
    assert len(told.splitlines()) == rows
    curve = np.loadtxt(tmp_path / f"learning_{name}.csv", delimiter=",", skiprows=1, ndmin=2)
    assert curve.shape == (rows, 2) and curve[-1, 0] == steps
    assert curve[-1, 1] > least


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.py")), ids=lambda path: path.stem)
def test_an_example_is_readable(path):
    lines = path.read_text(encoding="utf-8").splitlines()
    assert len(lines) <= 170 and max(map(len, lines)) <= 100
