"""What leaves Linkwork and runs anywhere: a robot's equations of motion as C99, and as functions of
CasADi."""

from linkwork.export._c import FUNCTIONS, CExport, c
from linkwork.export._casadi import CasadiFunctions, casadi

__all__ = ["FUNCTIONS", "CExport", "CasadiFunctions", "c", "casadi"]
