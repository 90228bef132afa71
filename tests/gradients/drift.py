"""How small deviations move on by themselves, written once more by derivatives in tangent
coordinates."""

import casadi as ca

from linkwork.equations import Equations, functions
from linkwork.equations.algebra import SX
from linkwork.equations.linear import reading, shifted
from linkwork.gradients.tangent import Shift, Tangent


def drift(equations: Equations) -> ca.Function:
    """Return (q, v) -> Gamma (n x n), Gamma_p (n x np) and the weakest relative pivot.

    A small deviation dq along the independent rates moves by  dq' = Gamma dq + Gamma_p dp + dv,
    where Gamma is zero but for the angular velocities of free turns (`equations.linear`).
    """
    tangent, tree = Tangent(equations), equations.tree
    n, count = equations.mobility, equations.p.numel()
    read, still, own = reading(equations), SX(n, n), SX.eye(count)
    moving = tree.derivatives(tangent.w)
    along = Shift(SX.eye(n), still, SX(count, n)), Shift(SX(n, count), SX(n, count), own)
    N = tree.derivative_map
    steps = [ca.mtimes(N, tangent.steps(step)[0][: equations.nv, :]) for step in along]
    by = [
        tangent.forward(moving, step) - shifted(shift, tree.q, moving)
        for step, shift in zip(along, steps, strict=True)
    ]
    found = tangent.at_rates([ca.mtimes(read, part) for part in by])
    outputs = {"Gamma": found[0], "Gamma_p": found[1], "pivot": equations.elimination.pivot}
    return functions.function("drift", equations, outputs, v=equations.v)
