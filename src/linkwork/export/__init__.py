"""What leaves Linkwork: a robot's equations of motion as C99 that runs anywhere, as FMUs, as
functions of CasADi, and in closed form to be read; a robot as a live model of MuJoCo or
Pinocchio."""

from linkwork.export._c import FUNCTIONS, CExport, c
from linkwork.export._casadi import CasadiFunctions, casadi
from linkwork.export._fmu import FmuExport, fmu
from linkwork.export._mujoco import MujocoModel, mujoco
from linkwork.export._pinocchio import PinocchioModel, pinocchio
from linkwork.export._symbolic import latex, sympy

__all__ = [
    "FUNCTIONS",
    "CExport",
    "CasadiFunctions",
    "FmuExport",
    "MujocoModel",
    "PinocchioModel",
    "c",
    "casadi",
    "fmu",
    "latex",
    "mujoco",
    "pinocchio",
    "sympy",
]
