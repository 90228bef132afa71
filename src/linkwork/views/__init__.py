"""Stage 7, see: plots of runs, pictures of mechanisms, comparisons and reports."""

from linkwork.views.drawing import plot_mechanism
from linkwork.views.plots import plot_run

__all__ = ["plot_mechanism", "plot_run"]
