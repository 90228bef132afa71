"""The events within a step: compiled parts of the integrators' loop.

The event functions g are looked at along the step. Where g_i keeps its sign at the ends and in the
middle, and stays away from zero by more than it bends, nothing happens. Else it is evaluated at
LOOKS + 1 places of the dense output, and where it comes nearest to zero between them: each change
of sign between two neighbours is an event.

Roots: Chandrupatla, Advances in Engineering Software 28 (1997) 145-149.
"""

from numba import njit

from linkwork.simulation.compiled import OPTIONS
from linkwork.simulation.native_parts import add_turns, copy, force, interpolate, project
from linkwork.simulation.pointers import call

ROOT = 2.0**-50  # width of the last bracket around an event, relative to the time and to the step
ROOT_CALLS = 100
LOOKS = 8
MOST = 2 * LOOKS  # intervals of a step at most
TRIES = 12  # to find where a function comes nearest to zero
TINY = 8.0  # of the shortest step of a run: a shorter one may be refused once more, and no more
SAME = 1e-6  # distance of places, relative to the bracket, below which another one is tried
NEVER = 2.0  # theta of an event that does not happen within the step


@njit(**OPTIONS)
def state_within(run, theta):
    """Leave the state at t + theta step in the sample, projected; return the residual."""
    interpolate(run, theta)
    return project(run, True, run.room.sample) if run.kernels.closure != 0 else 0.0


@njit(**OPTIONS)
def observe(run, time, state, g):
    """Evaluate the event functions g in a state within the step."""
    x, n, nq = run.room.x, run.room.n, run.room.nq
    copy(state, x, n)
    add_turns(x, run.turns, nq)
    force(run.inputs, time, True, run.piece, x + n)
    call(run.kernels.events, x, g)


@njit(**OPTIONS)
def events_within(run, theta, g):
    """Evaluate g at t + theta step on the dense output."""
    state_within(run, theta)
    observe(run, run.t + theta * run.step, run.room.sample, g)


@njit(**OPTIONS)
def quiet(run):
    """Tell whether no event function comes near zero within the step, from its values g at the
    start to those at the end.

    The state in the middle is that of the cubic through both ends and their slopes, which are at
    hand in every method.
    """
    method, room, scene, step = run.method, run.room, run.scene, run.step
    first, last = room.k, room.k + min(method.solution, method.computed - 1) * room.width
    y, new, sample = room.y, room.new, room.sample
    for m in range(room.n):
        sample[m] = 0.5 * (y[m] + new[m]) + 0.125 * step * (first[m] - last[m])
    observe(run, run.t + 0.5 * step, sample, scene.within)
    g, g_middle, g_new = scene.g, scene.within, scene.g + LOOKS * scene.count
    for i in range(scene.count):
        before, middle, after = g[i], g_middle[i], g_new[i]
        if before == 0 and middle == 0 and after == 0:
            continue
        side = 1.0 if before > 0 else -1.0
        nearest = min(side * before, side * middle, side * after)
        if not nearest > abs(before - 2 * middle + after):
            return False
    return True


@njit(**OPTIONS)
def vertex(a, b, c, g_a, g_b, g_c):
    """Return where the parabola through three values has its vertex; not a number where it has
    none."""
    left, right = (b - a) * (g_b - g_c), (b - c) * (g_b - g_a)
    return b - 0.5 * ((b - a) * left - (b - c) * right) / (left - right)


@njit(**OPTIONS)
def dip(run, i, places, values, g):
    """Follow g_i from three places, where it has one sign, to where it comes nearest to zero
    between them.

    Return a place where its sign is another one, with g there, or 0.
    """
    (a, b, c), (g_a, g_b, g_c) = places, values
    side = 1.0 if g_b > 0 else -1.0
    for _ in range(TRIES):
        place = vertex(a, b, c, g_a, g_b, g_c)
        if not a < place < c:
            break
        if abs(place - b) < SAME * (c - a):
            place = 0.5 * (a + b) if b - a > c - b else 0.5 * (b + c)
        events_within(run, place, g)
        if not side * g[i] > 0:
            return place
        if side * g[i] < side * g_b:
            if place < b:
                c, g_c = b, g_b
            else:
                a, g_a = b, g_b
            b, g_b = place, g[i]
        elif place < b:
            a, g_a = place, g[i]
        else:
            c, g_c = place, g[i]
    return 0.0


@njit(**OPTIONS)
def look(run):
    """Fill the places thetas and the rows g of the table, whose first row is g at the start and
    whose row LOOKS g at the end; return the number of intervals.
    """
    watched, thetas, table = run.scene.count, run.scene.thetas, run.scene.g
    # g at LOOKS + 1 places at equal distances.
    for j in range(LOOKS + 1):
        thetas[j] = j / LOOKS
        if 0 < j < LOOKS:
            events_within(run, thetas[j], table + j * watched)
    # A place more wherever a function changes its sign twice between two of them.
    count = LOOKS
    for i in range(watched):
        j = 1
        while j < count and count < MOST:
            found = near_zero(run, i, j)
            if found > 0:
                insert(run.scene, j if found < thetas[j] else j + 1, count, found)
                count, j = count + 1, j + 1
            j += 1
    return count


@njit(**OPTIONS)
def near_zero(run, i, j):
    """Return a place beside place j where g_i has another sign than at j and on both sides of it,
    with g there in the spare row of the table, or 0.
    """
    watched, thetas = run.scene.count, run.scene.thetas
    places, g = (thetas[j - 1], thetas[j], thetas[j + 1]), run.scene.g + j * watched + i
    values, side = (g[-watched], g[0], g[watched]), 1.0 if g[0] > 0 else -1.0
    nearest = min(side * values[0], side * values[1], side * values[2])
    if 0 < nearest <= abs(values[0] - 2 * values[1] + values[2]):
        return dip(run, i, places, values, run.scene.g + (MOST + 1) * watched)
    return 0.0


@njit(**OPTIONS)
def insert(scene, place, count, theta):
    """Put a theta, and the spare row of the table, at a place among the `count` + 1 that there
    are."""
    watched, thetas, table = scene.count, scene.thetas, scene.g
    for row in range(count, place - 1, -1):
        thetas[row + 1] = thetas[row]
        copy(table + row * watched, table + (row + 1) * watched, watched)
    thetas[place] = theta
    copy(table + (MOST + 1) * watched, table + place * watched, watched)


@njit(**OPTIONS)
def locate(run, i, start, before, end, after):
    """Return the theta at which g_i has just changed its sign from that of `before` at theta =
    start to that of `after` at theta = end.
    """
    g = run.scene.within
    side = 1.0 if before < 0 else -1.0
    tolerance = ROOT * max(1.0, abs(run.t / run.step))
    theta_1, g_1, theta_2, g_2, guess = end, after, start, before, 0.5
    for _ in range(ROOT_CALLS):
        theta = theta_1 + guess * (theta_2 - theta_1)
        events_within(run, theta, g)
        if (side * g[i] >= 0) == (side * g_1 >= 0):
            theta_3, g_3 = theta_1, g_1
        else:
            theta_3, g_3, theta_2, g_2 = theta_2, g_2, theta_1, g_1
        theta_1, g_1 = theta, g[i]
        smallest = tolerance / abs(theta_2 - theta_1)
        if smallest > 0.5:
            break
        fraction, ratio = (theta_1 - theta_2) / (theta_3 - theta_2), (g_1 - g_2) / (g_3 - g_2)
        guess = 0.5
        if (
            ratio**2 < fraction and (1 - ratio) ** 2 < 1 - fraction
        ):  # inverse quadratic interpolation
            guess = g_1 / (g_2 - g_1) * g_3 / (g_2 - g_3) + (theta_3 - theta_1) / (
                theta_2 - theta_1
            ) * g_1 / (g_3 - g_1) * g_2 / (g_3 - g_2)
        guess = min(max(guess, smallest), 1 - smallest)
    return theta_1 if side * g_1 >= 0 else theta_2


@njit(**OPTIONS)
def earliest(crossings, count):
    """Return which of the events comes first."""
    first = 0
    for i in range(1, count):
        if crossings[i] < crossings[first]:
            first = i
    return first
