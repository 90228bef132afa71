"""Singular values of stacks in compiled code: against LAPACK, and against exact ones of graded
matrices."""

import numpy as np
import pytest

from linkwork.analysis.singular_values import singular_values


@pytest.mark.parametrize("shape", [(1, 1), (2, 2), (3, 3), (6, 6), (8, 3)])
def test_they_are_lapack_s(shape):
    A = np.random.default_rng(7).standard_normal((4, 50, *shape))
    np.testing.assert_allclose(
        singular_values(A), np.linalg.svd(A, compute_uv=False), rtol=1e-12, atol=1e-14
    )


def test_tiny_ones_are_accurate_to_their_own_size():
    """Columns of very different length, D with orthogonal Q: sigma(Q D) = D, which A' A loses."""
    Q, _ = np.linalg.qr(np.random.default_rng(1).standard_normal((4, 4)))
    D = np.array([1.0, 1e-5, 1e-10, 1e-15])
    np.testing.assert_allclose(singular_values(Q * D), D, rtol=1e-10)


def test_singular_zero_and_equal_ones():
    np.testing.assert_allclose(singular_values(np.zeros((3, 3))), 0)
    np.testing.assert_allclose(singular_values(np.ones((2, 2))), [2, 0], atol=1e-15)
    np.testing.assert_allclose(singular_values(3 * np.eye(5)), 3)
    assert singular_values(np.empty((0, 3, 3))).shape == (0, 3)


def test_the_matrices_are_left_alone():
    A = np.random.default_rng(2).standard_normal((10, 3, 3))
    before = A.copy()
    singular_values(A)
    np.testing.assert_array_equal(A, before)
