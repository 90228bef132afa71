"""Powers: what actuators, friction, dampers, contacts and a fluid bring into the mechanism, force
times rate.

actuator  u w        friction and damper in a joint  f(w) . w <= 0    damper between points  -d l'^2
fluid     n . omega + f . v of what it acts on, where wind may bring energy in
"""

from __future__ import annotations

import casadi as ca

from linkwork.equations import effects, fluid
from linkwork.equations.algebra import SX, present
from linkwork.equations.equations import Equations
from linkwork.equations.functions import function
from linkwork.equations.rubbing import rubbing


def power_terms(equations: Equations, borne: ca.SX | None = None) -> dict[str, ca.SX]:
    """Return the actuated rates S v, the power of friction in each joint rate (m), of the damper of
    each spring between points and of what resists each transmission, of what dissipates in each
    place of contact and of fluid [W], and the weakest relative pivot.

    borne: the friction of bearings (K)
    """
    mechanism, tree, w = equations.mechanism, equations.tree, equations.rates
    friction = SX.zeros(len(mechanism.rates))
    lines = dict.fromkeys(mechanism.transmissions, SX(0))
    for freedom in equations.freedoms:
        own = ca.mtimes(freedom.J, w)
        power = freedom.drag(own) * own
        if freedom.rates[0] in lines:
            lines[freedom.rates[0]] = power
        else:
            friction[[mechanism.rates.index(label) for label in freedom.rates]] = power
    if borne is not None:
        for own, force in zip(rubbing(equations.joints), ca.vertsplit(borne), strict=True):
            friction[mechanism.rates.index(own.rate)] += force * ca.mtimes(own.J, w)
    dampers = []
    for pull in effects.pulls(mechanism, tree):
        damped = present(pull.spring.damping)
        stretching = ca.jtimes(pull.length, tree.q, tree.derivatives(w)) if damped else SX(0)
        dampers.append(-pull.spring.damping * stretching**2)
    return {
        "actuated": ca.mtimes(equations.actuation, equations.v),
        "friction": friction,
        "dampers": ca.vertcat(SX(0, 1), *dampers, *lines.values()),
        "contacts": ca.vertcat(SX(0, 1), *(of.power for of in equations.touching)),
        "drags": ca.vertcat(SX(0, 1), *(of.power for of in fluid.resisting(mechanism, tree, w))),
        "pivot": equations.elimination.pivot,
    }


def powers(equations: Equations) -> ca.Function:
    """Return (q, v) -> what `power_terms` gives."""
    return function("powers", equations, power_terms(equations), v=equations.v)


def contact_terms(equations: Equations) -> dict[str, ca.SX]:
    """Return the force on the second body (3) [N] in the ground's axes and the gap [m] of each
    place where bodies may touch."""
    places = equations.touching
    return {
        "forces": ca.vertcat(SX(0, 1), *(place.pressed + place.rubbed for place in places)),
        "gaps": ca.vertcat(SX(0, 1), *(place.touch.meeting.gap for place in places)),
    }


def contacts(equations: Equations) -> ca.Function:
    """Return (q, v) -> what `contact_terms` gives."""
    return function("contacts", equations, contact_terms(equations), v=equations.v)
