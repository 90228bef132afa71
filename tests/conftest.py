"""What holds for all tests."""

import signal


def pytest_configure() -> None:
    """Let Ctrl-C interrupt the processes that tests start, also where this one was started deaf to
    it, as by nohup."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
