"""Stage 2, derive: mechanism -> topology -> tree -> closure rows -> chart -> equations of motion
(CasADi expressions)."""

from linkwork.equations import functions
from linkwork.equations.chart_choice import chart_in, charts_at
from linkwork.equations.derivation import derive
from linkwork.equations.equations import Equations

__all__ = ["Equations", "chart_in", "charts_at", "derive", "functions"]
