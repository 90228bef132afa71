"""The precision that JAX computes in."""

from __future__ import annotations

import jax

from linkwork.errors import LinkworkError


def require_doubles() -> None:
    """Refuse single precision."""
    if not jax.config.jax_enable_x64:  # pyright: ignore[reportAttributeAccessIssue]
        raise LinkworkError(
            "JAX computes in single precision, in which loops do not stay closed; call "
            'jax.config.update("jax_enable_x64", True) before anything else'
        )
