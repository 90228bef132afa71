"""Evaluate the derived functions by CasADi itself, without compiling them."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike


def values(function: ca.Function, *arguments: ArrayLike) -> dict[str, np.ndarray]:
    """Return a function's outputs by name: columns as vectors, matrices as they are; p may be left
    out where none is free."""
    given = (*arguments, *[[]] * (function.n_in() - len(arguments)))
    outputs = function.call([ca.DM(np.asarray(argument, float)) for argument in given])
    arrays = (np.array(output) for output in outputs)
    return {
        name: array[:, 0] if array.shape[1] == 1 else array
        for name, array in zip(function.name_out(), arrays, strict=True)
    }


def close(found: ArrayLike, expected: ArrayLike, tolerance: float) -> None:
    """Assert that arrays agree to a tolerance, relative to the largest number expected where that
    is above 1."""
    found, expected = np.asarray(found, float), np.asarray(expected, float)
    assert found.shape == expected.shape
    scale = max(1.0, float(np.abs(expected).max(initial=0.0)))
    worst = float(np.abs(found - expected).max(initial=0.0)) / scale
    assert worst < tolerance, f"{worst:.3g} is not below {tolerance:.3g}"
