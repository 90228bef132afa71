"""The closed configuration that is nearest to a rough reference, whichever joints the spanning tree
holds.

Joint coordinates that the reference names are x_0, those of a configuration x(q), lengths over the
mechanism's own. With

    r = x(q) - x_0,  angles the short way round, the rotation vector of R R_0' of a free turn
    J w = r'

the configuration looked for is the closed one of least  r . r / 2:  with the multipliers l of the
closure rows

    g(q) = J' r + Phi' l = 0,    phi(q) = 0.

From there the actuated coordinates that the reference names are led to their values; where these
can be met, and not in a singular configuration, they are held and only the others give way: home is
then the nearest of the configurations that have them.

Newton's steps are taken in the basis Z of what Phi leaves free,  Z' (dg/dq N) Z s = -Z' g  at fixed
l, and closed. Where that leaves freedoms undetermined, the coordinates that the reference leaves
out decide them, as they are at zero. A start from which no step leads nearer is kept.
Source: Nocedal & Wright 2006, sec. 18.1 (reduced Hessians).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress

import casadi as ca
import numpy as np

from linkwork.equations.algebra import SX, cross, dense, dot, wrapped
from linkwork.equations.effects import rotation_vector
from linkwork.equations.joint_map import JointMap
from linkwork.equations.joints import pattern
from linkwork.equations.lengths import slides
from linkwork.equations.mobility import free_motions
from linkwork.equations.reference import OPEN, OpenLoopsError, System, close, described, led, unit
from linkwork.equations.tree import Tree
from linkwork.mechanism.joints import SLIDES, TURN

STEPS, HALVINGS = 50, 12
LONGEST = 0.5  # step, in own units
SMALLEST = 1e-11  # step that is none
APART = 1e-5  # of configurations between which g is compared
MOVED = 0.05  # of a coordinate, in own units, that is told
SINGULAR = 1e-3  # strength of what is held, over that where it is not, from which it is held
FLAT = 1e-6  # curvature that determines nothing, over the largest
PULL = 10.0  # on what the reference names, over the gaps of the loops
APPROACHES, ASTRAY = 4, 0.6  # starts of other branches, and how far apart they are, in own units
CLEARLY = 0.99  # of a distance, below which another one is nearer

Reading = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


def nearest(
    system: System,
    joints: JointMap,
    start: np.ndarray,
    closed: np.ndarray,
    p: np.ndarray | None = None,
) -> np.ndarray:
    """Return the closed configuration nearest to the reference, as far as descent from a closed one
    leads.

    Args:
        system: as `reference.close` solves it.
        start: q (nq) of the reference; closed: q that was found from there.
        p: values of the free numbers; the description's if left out.

    Returns:
        q; `closed` itself where the reference is closed, that is, open by rounding only.
    """
    tree, named = joints.tree, given(joints)
    r, periodic = differences(joints)
    rough = np.abs(system(unit(tree, start))[0]).max(initial=0.0) > OPEN
    far = shortest(tree.evaluated("differences", [r], p)(closed)[0], periodic)[named]
    if not rough and np.abs(far).max(initial=0.0) <= OPEN:
        return closed
    read = readings(joints, r, periodic, p)
    q = settled(system, read, tree, closed, (named, ~named))
    driven = of_part(read, named & actuated(joints))
    if np.abs(driven(q)[0]).max(initial=0.0) <= OPEN:
        return q
    try:
        met = close(holding(system, driven, 0.0), tree, q)
    except OpenLoopsError:
        return q
    if not strength(system, driven, met) > SINGULAR * strength(system, driven, q):
        return q
    return settled(system, read, tree, met, (named & actuated(joints), named, ~named))


def nearer_branch(
    system: System, joints: JointMap, start: np.ndarray, q: np.ndarray
) -> np.ndarray | None:
    """Return a closed configuration that is clearly nearer to the reference than a closed q (nq)
    which has moved what the reference names, on another branch of motion; None if none is found.

    Loops that are closed from coordinates at zero, because the reference leaves them out, may be
    closed far from those that it names. Here the coordinates that are left out come first: from a
    few starts (fixed seed) descent leads to least  |phi|² + PULL² r . r,  and is closed from there.
    """
    if not moved(joints, q):
        return None
    (r, periodic), named = differences(joints), given(joints)
    read = readings(joints, r, periodic, None)
    near, driven = of_part(read, named), of_part(read, named & actuated(joints))

    def rank(q: np.ndarray) -> tuple[bool, float]:
        return bool(np.abs(driven(q)[0]).max(initial=0.0) > OPEN), float(np.linalg.norm(near(q)[0]))

    unmet, far = rank(q)
    found = [
        nearest(system, joints, start, closed)
        for closed in approaches(system, near, joints.tree, start)
        if rank(closed)[1] < CLEARLY * far
    ]
    best = min(found, key=rank, default=q)
    return best if rank(best) < (unmet, CLEARLY * far) else None


def approaches(
    system: System, near: Reading, tree: Tree, start: np.ndarray
) -> Iterator[np.ndarray]:
    """Yield closed configurations to which starts lead that keep to what the reference names."""

    def pulled(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        r, J = near(q)
        return PULL * r, PULL * J

    random = np.random.default_rng(1864)
    for spread in (0.0, *[ASTRAY] * (APPROACHES - 1)):
        aside = start + spread * tree.units * random.standard_normal(start.size)
        q, _ = led(holding(system, pulled, 0.0), tree, aside)
        with suppress(OpenLoopsError):
            yield close(system, tree, q)


def settled(
    system: System, read: Reading, tree: Tree, q: np.ndarray, parts: tuple[np.ndarray, ...]
) -> np.ndarray:
    """Return the closed q of least r . r of a part of the coordinates, of the next part as far as
    that leaves freedoms, and so on."""
    for part in parts:
        q, determined = approached(system, of_part(read, part), tree, q)
        if determined:
            break
        own = of_part(read, part)
        system = holding(system, own, own(q)[0])
    return q


def strength(system: System, read: Reading, q: np.ndarray) -> float:
    """Return the least singular value of what is read on the motions that the loops allow: 0 where
    it does not determine as many of them as it could."""
    values = np.linalg.svd(read(q)[1] @ free_motions(dense(ca.DM(system(q)[1]))), compute_uv=False)
    return float(values[-1]) if values.size else 1.0


def actuated(joints: JointMap) -> np.ndarray:
    """Tell of each joint rate whether it is driven, and that of a coordinate."""
    mechanism = joints.mechanism
    driven = {*mechanism.actuators} & {*mechanism.coordinates}
    pairs = mechanism.pairs.items()
    return np.array([label in driven for name, joint in pairs for label in joint.rates(name)], bool)


def moved(joints: JointMap, q: np.ndarray, p: np.ndarray | None = None) -> dict[str, float]:
    """Return the coordinates that the reference names and that a closed q (nq) has farther off than
    rough numbers explain, by name, with what they are there [m, rad]."""
    mechanism, (r, periodic) = joints.mechanism, differences(joints)
    r, positions = joints.tree.evaluated("differences", [r, joints.positions()], p)(q)
    off = shortest(r, periodic)
    values = dict(zip(mechanism.coordinates, np.array(positions).ravel().tolist(), strict=True))
    rates = [label for name, joint in mechanism.pairs.items() for label in joint.rates(name)]
    return {
        label: values[label]
        for label, far in zip(rates, off, strict=True)
        if label in mechanism.reference and label in values and abs(far) > MOVED
    }


def given(joints: JointMap) -> np.ndarray:
    """Tell of each joint rate whether the reference names the coordinate that it moves."""
    reference, told = joints.mechanism.reference, []
    for name, joint in joints.mechanism.pairs.items():
        labels = iter(joint.coordinates(name))
        for freedom in joint.freedoms:
            own = [next(labels) for _ in range(4 if freedom == TURN else 1)]
            told += [any(label in reference for label in own)] * (3 if freedom == TURN else 1)
    return np.array(told, bool)


def differences(joints: JointMap) -> tuple[ca.SX, list[bool]]:
    """Return r, and of each of its numbers whether it is an angle that goes round; derived once."""
    key = f"differences, {tuple(joints.turns.items())}"
    return joints.once(key, lambda: [(key, from_reference(joints))])[key]


def from_reference(joints: JointMap) -> tuple[ca.SX, list[bool]]:
    """Return the same, derived anew."""
    mechanism, tree, values = joints.mechanism, joints.tree, described(joints.mechanism)
    lengths, r, periodic = slides(mechanism), [], []
    for name, joint in mechanism.pairs.items():
        for part in joint.parts(name):
            own = part.coordinates
            if part.name == TURN:
                p = ca.vertcat(*map(joints.position, own))
                r.append(rotation_vector(turn_between(p, [values[label] for label in own])))
                periodic += [False] * 3
            else:
                (label,) = own
                unit = tree.length if lengths[label] else 1.0
                r.append((joints.position(label) - values[label]) / unit)
                periodic.append(part.name not in SLIDES and "screw" not in pattern(joint))
    return ca.vertcat(SX(0, 1), *r), periodic


def readings(joints: JointMap, r: ca.SX, periodic: list[bool], p: np.ndarray | None) -> Reading:
    """Return the function of q that gives r and J, a row for each joint rate."""
    mechanism, tree, lengths = joints.mechanism, joints.tree, slides(joints.mechanism)
    rates = [label for name, joint in mechanism.pairs.items() for label in joint.rates(name)]
    heights = [tree.length if lengths[label] else 1.0 for label in rates]
    J = ca.mtimes(
        ca.mtimes(ca.diag(1 / ca.DM(heights)), joints.rate_rows(rates)),
        ca.diag(ca.DM(tree.rate_units)),
    )
    evaluated = tree.evaluated("readings", [r, J], p)

    def read(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        r, J = evaluated(q)
        return shortest(r, periodic), dense(J)

    return read


def shortest(r: ca.DM, periodic: list[bool]) -> np.ndarray:
    """Return numbers of r, angles the short way round."""
    values = np.array(r).ravel()
    return np.where(periodic, wrapped(values), values)


def turn_between(p: ca.SX, given: list[float]) -> ca.SX:
    """Return the quaternion of R R_0' from those of R and R_0."""
    w, u = given[0], SX(np.array(given[1:]))
    return ca.vertcat(p[0] * w + dot(p[1:], u), w * p[1:] - p[0] * u - cross(p[1:], u))


def of_part(read: Reading, part: np.ndarray) -> Reading:
    """Return the function that reads some of the coordinates."""

    def some(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        r, J = read(q)
        return r[part], J[part]

    return some


def holding(system: System, read: Reading, kept: np.ndarray | float) -> System:
    """Return the system that keeps what is read, too."""

    def held(q: np.ndarray) -> tuple[np.ndarray, ca.DM, ca.DM]:
        phi, Phi, N = system(q)
        r, J = read(q)
        return np.append(phi, r - kept), ca.vertcat(ca.DM(Phi), ca.DM(J)), ca.DM(N)

    return held


def approached(system: System, read: Reading, tree: Tree, q: np.ndarray) -> tuple[np.ndarray, bool]:
    """Return the closed q of least r . r that descent leads to, and whether every freedom is
    determined there."""
    determined = False
    for _ in range(STEPS):
        step, determined = newton_step(system, read, tree, q)
        if np.abs(step).max(initial=0.0) <= SMALLEST or np.abs(read(q)[0]).max(initial=0.0) <= OPEN:
            break
        trial = nearer(system, read, tree, q, step)
        if trial is None:
            break
        q = trial
    return q, determined


def newton_step(
    system: System, read: Reading, tree: Tree, q: np.ndarray
) -> tuple[np.ndarray, bool]:
    """Return a step of q downhill, Newton's near a least distance, and whether every freedom bends
    the distance."""
    _, Phi, N = system(q)
    r, J = read(q)
    Z = free_motions(dense(ca.DM(Phi)))
    if not Z.size:
        return np.zeros(q.size), True
    multipliers = np.linalg.lstsq(dense(ca.DM(Phi)).T, -J.T @ r, rcond=1e-9)[0]
    along = np.array(N @ Z)

    def g(q: np.ndarray) -> np.ndarray:
        (r, J), (_, Phi, _) = read(q), system(q)
        return Z.T @ (J.T @ r + dense(ca.DM(Phi)).T @ multipliers)

    aside = APART * along.T
    H = np.transpose(
        [(g(unit(tree, q + dq)) - g(unit(tree, q - dq))) / (2 * APART) for dq in aside]
    )
    curvatures, V = np.linalg.eigh((H + H.T) / 2)
    bent = np.abs(curvatures) > FLAT * max(np.abs(curvatures).max(), FLAT)
    step = V[:, bent] @ ((V.T @ -g(q))[bent] / np.abs(curvatures[bent]))
    return along @ step * min(1.0, LONGEST / max(np.abs(Z @ step).max(), 1e-300)), bool(bent.all())


def nearer(
    system: System, read: Reading, tree: Tree, q: np.ndarray, step: np.ndarray
) -> np.ndarray | None:
    """Return the closed configuration after a step, or a part of it, that is not farther off; None
    if there is none."""
    far = np.linalg.norm(read(q)[0])
    for part in 0.5 ** np.arange(HALVINGS):
        try:
            trial = close(system, tree, q + part * step)
        except OpenLoopsError:
            continue
        if np.linalg.norm(read(trial)[0]) <= far * (1 + 1e-14):
            return trial
    return None
