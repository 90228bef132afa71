"""The tree's inertia, its inertia forces and its weight, in closed form.

    H_jk = sum over bodies of m v_j . v_k + omega_j . I omega_k
    h_i  = sum_jk (dH_ij/dq_k - dH_jk/dq_i / 2) q_j' q_k'         (Christoffel's symbols)
    w_i  = dV/dq_i,   V = -sum m g . c

H is K' Mtot K of the paper's Eq. (10), -w its K' w_g of Eq. (12), and h what K' (Mtot K' + Omega
Mtot K) q' of Eq. (11) leaves of it for q' that is any.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction

from linkwork.equations import Equations
from linkwork.errors import LinkworkError
from linkwork.export.symbolic.chain import Chain
from linkwork.export.symbolic.trig import ZERO, Trig, applied, dot, symbol
from linkwork.mechanism import Mechanism
from linkwork.mechanism.bearing import require_no_bearings

Entries = Mapping[tuple[str, str], Trig]


def derivative(x: Trig, label: str) -> Trig:
    """Return dx/dq of a coordinate."""
    return x.by_symbol(f"q:{label}") + x.by_angle(label)


def rate(label: str) -> Trig:
    return symbol(f"w:{label}")


def inertia(chain: Chain, labels: Sequence[str]) -> dict[tuple[str, str], Trig]:
    """Return the elements of H that are not zero, both triangles."""
    H: dict[tuple[str, str], Trig] = {}
    for body in chain.mechanism.bodies:
        m, tensor = chain.dimensions.mass(body), chain.inertia(body)
        columns = chain.mass_centre(body).columns
        turned = {label: applied(tensor, omega) for label, (omega, _) in columns.items()}
        for j, (omega, v) in columns.items():
            for k, (_, other) in columns.items():
                if labels.index(j) <= labels.index(k):
                    added = m * dot(v, other) + dot(omega, turned[k])
                    H[j, k] = H.get((j, k), ZERO) + added
    for name, joint in chain.mechanism.pairs.items():
        for part in joint.parts(name):
            if part.effects.rotor and part.coordinates[0] in labels:
                label = part.coordinates[0]
                where = ("joints", name, "rotor_inertia")
                where = where if len(joint.freedoms) == 1 else (*where, part.name)
                J = chain.dimensions.number(where, part.effects.rotor)
                H[label, label] = H.get((label, label), ZERO) + J
    both = H | {(k, j): value for (j, k), value in H.items()}
    return {place: value for place, value in both.items() if value}


def inertia_forces(H: Entries, labels: Sequence[str]) -> dict[str, Trig]:
    """Return h that is not zero."""
    found = {}
    for i in labels:
        total = ZERO
        for (j, k), value in H.items():
            if i == j:
                for other in labels:
                    if slope := derivative(value, other):
                        total += slope * rate(k) * rate(other)
            if slope := derivative(value, i):
                total -= slope * rate(j) * rate(k) * Fraction(1, 2)
        if total:
            found[i] = total
    return found


def weights(chain: Chain, labels: Sequence[str]) -> dict[str, Trig]:
    """Return the weight's generalised forces that are not zero."""
    V, g = ZERO, chain.dimensions.gravity
    for body in chain.mechanism.bodies:
        V -= chain.dimensions.mass(body) * dot(g, chain.mass_centre(body).p)
    found = {label: derivative(V, label) for label in labels}
    return {label: value for label, value in found.items() if value}


def refuse_others(equations: Equations) -> None:
    """Refuse what acts in M, C v and G beside bodies and rotors."""
    require_no_bearings(
        equations.mechanism.joints,
        "closed forms leave out",
        "print the robot without it",
    )
    mechanism: Mechanism = equations.mechanism
    for name in ("transmissions", "lifts", "drags"):
        if getattr(mechanism, name):
            raise LinkworkError(
                f"{mechanism.name} has {name}, which the printed equations do not hold; take them "
                "out of the description"
            )
