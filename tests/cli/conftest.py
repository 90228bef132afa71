"""What is announced on stderr once per machine happens before the commands are called."""

import pytest

from tests.catalogue import built


@pytest.fixture(scope="session")
def compiled():
    """Compile what is compiled once per machine."""
    robot = built("prr3")
    robot.simulate(robot.home, duration=0.01)
