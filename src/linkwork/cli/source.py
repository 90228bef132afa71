"""Which robot a command is about."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from linkwork.cli.options import PLAIN, ReadingOptions

if TYPE_CHECKING:
    from linkwork.formats.reading import Reading


@dataclass(frozen=True)
class Source:
    """Say which robot is meant: its name or file, and how that is read."""

    name: str
    how: ReadingOptions = PLAIN

    @property
    def reading(self) -> Reading:
        """Return how the file is read."""
        from linkwork.formats.reading import Reading

        how = self.how
        return Reading.asked(how.floating, how.packages or (), how.merging, how.includes or ())
