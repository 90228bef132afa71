"""What holds for all tests of JAX."""

from collections.abc import Iterator

import jax
import pytest

from tests.catalogue import WHOLE


@pytest.fixture(autouse=True)
def compiled_quickly() -> Iterator[None]:
    """XLA compiles what is evaluated once or twice without most of its optimisations, which take
    longer; `make hostile` and the docs' examples have them."""
    jax.config.update("jax_disable_most_optimizations", not WHOLE)
    yield
    jax.config.update("jax_disable_most_optimizations", False)
