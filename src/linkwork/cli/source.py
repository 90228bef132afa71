"""Which robot a command is about."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Source:
    """Say which robot is meant: its name or file, and joint coordinates in place of those of its
    reference, as text."""

    name: str
    reference: str | None = None
