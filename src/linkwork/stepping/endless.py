"""Passages without an end: charts are changed as in a run, but nobody knows how long it will be."""

from __future__ import annotations

from dataclasses import dataclass

from linkwork.model.charts import CompiledChart
from linkwork.runs.passage import Passage
from linkwork.simulation import Method, Signal
from linkwork.simulation.events import Watch
from linkwork.simulation.integration import Problem


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

    def problem(self, chart: CompiledChart, method: Method, inputs: Signal) -> Problem:
        """Return what is stepped in a chart, compiled before the first step: all take as long."""
        made = super().problem(chart, method, inputs)
        chart.settle(0)
        return made
