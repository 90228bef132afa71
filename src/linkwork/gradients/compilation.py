"""The derivatives by name, compiled in a chart when they are first asked for.

what: forward_dynamics   v' (n) for u                         given: u
      inverse_dynamics   M v' + C v + G - f (n)               given: v'
      mass_matrix        M (n n, column by column)
      actuation          S (actuators n, column by column)
      closure            q, w (nq + nv) of the tree
      joints             coordinates, rates (m + mr) of all joints
      tool               pose (13), twist (6); derived: twist [omega; v] of the pose (6), twist (6)

Friction of bearings that depends on what they carry, which Newton's method finds, is differentiated
as it stands.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Literal

import casadi as ca

from linkwork import checks
from linkwork.equations import Equations, bearings, body_motion, functions
from linkwork.equations.algebra import SX
from linkwork.equations.functions import forces_needed
from linkwork.errors import LinkworkError
from linkwork.gradients import differentiable
from linkwork.gradients.differentiable import Differentiable, Throughout
from linkwork.gradients.missing_forces import ForwardDynamics, NeededForces
from linkwork.gradients.tangent import Shift, Tangent
from linkwork.kernels import Kernel, compile_function
from linkwork.mechanism.bearing import bearings as of_joints
from linkwork.model.charts import CompiledChart
from linkwork.model.derivations import kept

Form = Literal["jacobian", "jvp", "vjp"]
FEW, MANY = 2, 16  # rows of a Jacobian for which vectors pay
LONG = 5000  # instructions of a Jacobian from which on they do


def forward_dynamics(equations: Equations) -> Differentiable:
    """Return v' (n) under forces u."""
    if not of_joints(equations.mechanism.joints):
        return ForwardDynamics(equations)
    u = SX.sym("u", len(equations.mechanism.actuators))
    value = bearings.accelerations(equations, ca.mtimes(equations.actuation.T, u), u)
    return Throughout(Tangent(equations), value, u)


def inverse_dynamics(equations: Equations) -> Differentiable:
    """Return the forces M v' + C v + G - f (n) on the independent rates; bearings carry what they
    do without actuators."""
    if not of_joints(equations.mechanism.joints):
        return NeededForces(equations)
    dv, u = SX.sym("dv", equations.mobility), SX.zeros(len(equations.mechanism.actuators))
    return Throughout(Tangent(equations), forces_needed(equations, dv, u), dv)


def mass_matrix(equations: Equations) -> Differentiable:
    """Return M (n n), column by column."""
    return Throughout(Tangent(equations), ca.vec(equations.inertia[0]))


def actuation(equations: Equations) -> Differentiable:
    """Return S (actuators n), column by column."""
    return Throughout(Tangent(equations), ca.vec(equations.actuation))


def closure(equations: Equations) -> Differentiable:
    """Return the coordinates and rates (nq + nv) of the tree."""
    tangent = Tangent(equations)
    return Throughout(tangent, ca.vertcat(equations.tree.q, tangent.w))


def joints(equations: Equations) -> Differentiable:
    """Return the coordinates and rates (m + mr) of all joints."""
    tangent, own = Tangent(equations), equations.joints
    rates = ca.mtimes(own.rate_rows(), tangent.w)
    return Throughout(tangent, ca.vertcat(own.positions(), rates))


def tool(equations: Equations) -> Differentiable:
    """Return the first tool's pose (13) and twist (6); derivatives of the pose are twists."""
    tangent, own = Tangent(equations), equations.mechanism.first_tool
    pose = body_motion.tool_pose(equations.tree, own)
    J, _ = body_motion.tool_twist(equations.tree, own, SX.zeros(equations.nv))
    value = ca.vertcat(*pose, ca.mtimes(J, tangent.w))
    R = ca.reshape(pose.orientation, 3, 3).T
    turning = [vee(ca.reshape(unit, 3, 3).T, R) for unit in ca.horzsplit(SX.eye(9))]
    left = ca.diagcat(
        ca.vertcat(
            ca.horzcat(SX(3, 3), ca.horzcat(*turning), SX(3, 1)), ca.horzcat(SX.eye(3), SX(3, 10))
        ),
        SX.eye(6),
    )
    return Throughout(tangent, value, left=left)


def vee(dR: ca.SX, R: ca.SX) -> ca.SX:
    """Return omega (3) of a change dR = [omega x] R of a rotation matrix."""
    turn = ca.mtimes(dR, R.T)
    return ca.vertcat(turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]) / 2


def opening(equations: Equations) -> ca.Function:
    """Return q -> by how much free numbers open the rows that the chart leaves out (rows x np),
    where the others are closed, how far they move any row by themselves (np), both in own units,
    and the weakest relative pivot."""
    tangent, rows = Tangent(equations), equations.rows
    phi, kept = rows.phi / rows.units, set(equations.chart.rows)
    left = [index for index in range(len(rows.names)) if index not in kept]
    n, count = equations.mobility, equations.p.numel()
    step = Shift(SX(n, count), SX(n, count), SX.eye(count))
    alone = ca.densify(ca.fabs(ca.jacobian(phi, equations.p)))
    outputs = {
        "opened": tangent.forward(phi[left], step),
        "size": ca.vertcat(SX(0, 1), *map(ca.mmax, ca.horzsplit(alone))),
        "pivot": equations.elimination.pivot,
    }
    return functions.function("opening", equations, outputs)


DIFFERENTIABLE: dict[str, Callable[[Equations], Differentiable]] = {
    "forward_dynamics": forward_dynamics,
    "inverse_dynamics": inverse_dynamics,
    "mass_matrix": mass_matrix,
    "actuation": actuation,
    "closure": closure,
    "joints": joints,
    "tool": tool,
}


def require(what: object, form: object) -> None:
    """Refuse what is not differentiated, and another form."""
    checks.known((what,), tuple(DIFFERENTIABLE), "derivative")
    checks.known((form,), ("jacobian", "jvp", "vjp"), "form")


def expressed(equations: Equations, what: str, form: Form) -> ca.Function:
    """Return a derivative as a CasADi function, by what is differentiated and the form.

    equations: whose rates count; what: a name of `DIFFERENTIABLE`; form: "jacobian", "jvp" or
    "vjp".
    """
    require(what, form)
    if not isinstance(equations, Equations):
        raise LinkworkError(f"the equations are {checks.shown(equations)}; give robot.equations")
    make = getattr(differentiable, form)
    return make(f"{what}_{form}", DIFFERENTIABLE[what](equations))


def compiled(chart: CompiledChart, what: str, form: Form) -> Kernel:
    """Return the kernel of a derivative in a chart; its last input is p, the chart's if left
    out.

    chart: whose rates count; what: a name of `DIFFERENTIABLE`; form: "jacobian", "jvp" or "vjp".
    """
    require(what, form)
    if not isinstance(chart, CompiledChart):
        raise LinkworkError(f"the chart is {checks.shown(chart)}; give robot.chart")
    name = f"{what}_{form}"
    if form != "jacobian":
        return stored(chart, name, lambda equations: expressed(equations, what, form))

    def made(equations: Equations) -> Kernel:
        f = derived(chart, name, lambda: expressed(equations, what, form))
        gradient = partial(
            derived, chart, f"{what}_vjp", partial(expressed, equations, what, "vjp")
        )
        return compile_function(f, gradient if by_rows(equations, f) else None)

    return chart.compiled(f"gradients: {name}", made).given(chart.p)


def by_rows(equations: Equations, jacobian: ca.Function) -> bool:
    """Tell whether the Jacobian at one state is quicker row by row in the lanes of vectors: where
    it is long, and its rows are neither few nor many."""
    n = equations.mobility
    rows = jacobian.numel_out("by_q") // n
    return FEW < rows <= MANY and jacobian.n_instructions() > LONG


def compiled_opening(chart: CompiledChart) -> Kernel:
    """Return the kernel of `opening` in a chart, as `compiled` does."""
    return stored(chart, "opening", opening)


def stored(chart: CompiledChart, name: str, make: Callable[[Equations], ca.Function]) -> Kernel:
    """Return the kernel of a function of a chart's equations, which is made once on a machine."""

    def found(equations: Equations) -> ca.Function:
        return derived(chart, name, lambda: make(equations))

    return chart.compiled(f"gradients: {name}", found).given(chart.p)


def derived(chart: CompiledChart, name: str, make: Callable[[], ca.Function]) -> ca.Function:
    """Return a function of a chart's equations, from the folder of the kernels if it was made
    before."""
    key = chart.equations.key
    return kept(make, f"gradients of {name}", key, repr(chart.key)) if key else make()
