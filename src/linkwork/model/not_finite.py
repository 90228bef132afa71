"""Undefined: say why accelerations or forces are not finite where the rates determine the
motion."""

from __future__ import annotations

import casadi as ca
import numpy as np

from linkwork.equations import effects
from linkwork.equations.algebra import SX
from linkwork.equations.bearings import jamming
from linkwork.errors import LinkworkError
from linkwork.model.charts import CompiledChart

MEETING = (
    1e-9  # distance of a spring's ends, over the mechanism's own length, that tells no direction
)
PART = 0.1  # of a motion, over its greatest one, from which a rate is named


def meeting(chart: CompiledChart, q: np.ndarray) -> list[str]:
    """Return the springs between points that need a direction and whose ends meet at q (nq)."""
    mechanism, tree = chart.equations.mechanism, chart.equations.tree
    pulls = zip(mechanism.springs, effects.pulls(mechanism, tree), strict=True)
    lengths = {name: pull.length for name, pull in pulls if pull.needs_direction}
    values = tree.evaluated("lengths", [ca.vertcat(SX(0, 1), *lengths.values())], chart.p)(q)[0]
    return [
        name
        for name, value in zip(lengths, np.array(values).ravel(), strict=True)
        if value <= MEETING * tree.length
    ]


def massless(chart: CompiledChart, q: np.ndarray) -> bool:
    """Tell whether the generalised inertia is singular at q (nq): at rest and without forces
    nothing else is undefined."""
    actuators = chart.equations.mechanism.actuators
    *_, acceleration, _ = chart.kernel("motion")(
        q, np.zeros(len(chart.independent)), np.zeros(len(actuators))
    )
    return not np.isfinite(acceleration).all()


def motion_of_no_mass(chart: CompiledChart, q: np.ndarray) -> str:
    """Return the rates that take part in the motion of least inertia at q (nq): the least
    eigenvector of M in units of each rate in which its own inertia is 1."""
    equations = chart.equations
    [values] = equations.tree.evaluated("inertia", [equations.inertia[0]], chart.p)(q)
    M = np.array(values)
    own = np.sqrt(np.where(np.diag(M) > 0, np.diag(M), 1.0))
    if not np.isfinite(M).all():
        return ""
    parts = np.abs(np.linalg.eigh(M / own / own[:, None])[1][:, 0])
    moving = np.flatnonzero(parts > PART * parts.max())
    return ", ".join(chart.independent[k] for k in moving)


def refusal(chart: CompiledChart, q: np.ndarray) -> LinkworkError:
    """Return the refusal of what is not finite at one of the configurations q (..., nq), for finite
    rates and forces."""
    configurations = q.reshape(-1, q.shape[-1])
    for one in configurations:
        if springs := meeting(chart, one):
            return LinkworkError(
                f"the ends of the spring {', '.join(map(repr, springs))} meet here, where its "
                "rest length and damping have no direction to act in; move the pose or its "
                "points apart, or give neither rest length nor damping"
            )
        if massless(chart, one):
            named = motion_of_no_mass(chart, one)
            return LinkworkError(
                "the generalised inertia is singular: some motion moves no mass, or so little that "
                f"rounding hides it{named and f' (that of {named})'}; give the moving bodies mass "
                "or inertia"
            )
        if jammed := jamming(chart.equations, one, chart.p):
            return LinkworkError(
                f"the friction of the bearings of {', '.join(jammed)} grows as fast with what they "
                "carry as that does with the friction, so that there may be no motion or several "
                "(Painleve); give smaller coefficients, smaller radii or longer spans"
            )
    return LinkworkError(
        "the numbers here leave the range of doubles; give smaller rates, accelerations and "
        "forces, or check their units"
    )


def in_motion(chart: CompiledChart, q: np.ndarray) -> str:
    """Return what is undefined at q (nq) of a run; nothing where neither a spring, the inertia nor
    the friction of bearings is."""
    if springs := meeting(chart, q):
        return f"the force of the spring {', '.join(map(repr, springs))}, whose ends meet,"
    if massless(chart, q):
        return (
            "the acceleration, for the generalised inertia is singular (some motion moves no mass),"
        )
    if jammed := jamming(chart.equations, q, chart.p):
        return (
            f"the acceleration, for the friction of the bearings of {', '.join(jammed)} leaves no "
            "motion or several (Painleve),"
        )
    return ""
