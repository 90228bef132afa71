"""Passages without an end: charts are changed as in a run, but nobody knows how long it will be."""

from __future__ import annotations

from dataclasses import dataclass

from linkwork.runs.passage import Passage
from linkwork.simulation.events import Watch


@dataclass
class Endless(Passage):
    """Lead steps of one length from chart to chart, as `Passage` leads a run.

    The length of a step is the settings' duration: while the bound of the pivot is lowered it is
    looked after one step, then after two more, and so on, whether the pivots have recovered.
    """

    @property
    def watch(self) -> Watch | None:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Nothing: no step goes beyond the end of its length."""
        return None

    @property
    def shortest(self) -> float:
        """Duration of the shortest segments."""
        return self.settings.duration
