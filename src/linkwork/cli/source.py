"""Which robot a command is about."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from linkwork.formats.reading import Reading


@dataclass(frozen=True)
class Source:
    """Say which robot is meant: its name or file, joint coordinates in place of those of its
    reference, as text, and how its file is read."""

    name: str
    reference: str | None = None
    floating: bool = False
    packages: str | None = None
    merging: bool = True
    includes: str | None = None

    @property
    def reading(self) -> Reading:
        """Return how the file is read."""
        from linkwork.formats.reading import Reading

        return Reading.asked(self.floating, self.packages or (), self.merging, self.includes or ())
