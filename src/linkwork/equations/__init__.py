"""Stage 2, derive: mechanism -> topology -> tree -> closure rows -> chart -> equations of motion (CasADi expressions)."""

from linkwork.equations import functions
from linkwork.equations.derive import chart_at, derive
from linkwork.equations.equations import Equations

__all__ = ["Equations", "chart_at", "derive", "functions"]
