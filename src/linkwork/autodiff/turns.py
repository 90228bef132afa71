"""Free turns, whose quaternions are no independent coordinates one by one."""

from __future__ import annotations

from linkwork.autodiff.offered import Offered
from linkwork.errors import LinkworkError


def require_whole_turns(offered: Offered) -> None:
    """Refuse charts in which a free turn is independent in part: what is held of it is no
    coordinate."""
    equations = offered.equations
    independent, rates = {*equations.chart.independent}, equations.tree.rates
    for _, turn in equations.tree.quaternions:
        if 0 < len(independent & {*turn}) < len(turn):
            names = ", ".join(rates[k] for k in turn)
            raise LinkworkError(
                f"closed is not defined in the rates {', '.join(equations.independent)}, which "
                f"hold some of {names}, the rates of one free turn, and not the others; choose a "
                "chart with all or none of them"
            )
