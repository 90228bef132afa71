"""One small comparison that the tests of the laboratory share."""

import pytest

from linkwork.lab import engines, reproduction
from linkwork.lab.comparison import compare

from tests.catalogue import built
from tests.views.conftest import arm

__all__ = ["arm"]


@pytest.fixture(scope="session")
def robot():
    return built("prr3")


@pytest.fixture(scope="session")
def comparison(robot):
    """Return the paper's study with 501 samples of force and engine steps of 1 ms, by all engines
    that are installed."""
    asked = [name for name in reproduction.ORDER if name in engines.available()]
    return compare(robot, reproduction.prescribed_motion(robot, samples=1001), asked, step=1e-3)
