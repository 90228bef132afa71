"""What leaves Linkwork and runs anywhere: a robot's equations of motion as C99, as FMUs, and as
functions of CasADi."""

from linkwork.export._c import FUNCTIONS, CExport, c
from linkwork.export._casadi import CasadiFunctions, casadi
from linkwork.export._fmu import FmuExport, fmu

__all__ = ["FUNCTIONS", "CExport", "CasadiFunctions", "FmuExport", "c", "casadi", "fmu"]
