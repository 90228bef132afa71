"""Exact derivatives of the equations of motion, through closed loops, compiled.

Values, steps and gradients are written in the tangent coordinates of the independent rates
(`tangent`); the forces that are missing at a motion give the derivatives of direct and inverse
dynamics (`missing_forces`); `compilation` names what is differentiated, in three forms: Jacobian,
derivative along a step (jvp), and gradient (vjp), each a kernel for one state and for many.
"""

from linkwork.gradients.compilation import compiled, expressed
from linkwork.gradients.derivatives import derivative_kernel
from linkwork.gradients.records import (
    ClosureDerivatives,
    Derivatives,
    ForwardDynamicsDerivatives,
    InverseDynamicsDerivatives,
    MassMatrixDerivatives,
    ToolDerivatives,
)

__all__ = [
    "ClosureDerivatives",
    "Derivatives",
    "ForwardDynamicsDerivatives",
    "InverseDynamicsDerivatives",
    "MassMatrixDerivatives",
    "ToolDerivatives",
    "compiled",
    "derivative_kernel",
    "expressed",
]
