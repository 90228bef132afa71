"""Stage 7, use from a terminal: the command `linkwork`."""

from linkwork.cli.commands import app, main

__all__ = ["app", "main"]
