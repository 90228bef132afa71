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
SAME = 1e-6  # distance of places, relative to the bracket, below which another one is tried
NEVER = 2.0  # theta of an event that does not happen within the step


@njit(**OPTIONS)
def state_within(kernels, method, limits, room, theta, step):
    """Leave the state at t + theta step in the sample, projected; return the residual and the calls
    made."""
    interpolate(method, theta, step, room)
    if kernels.closure == 0:
        return 0.0, 0
    return project(kernels.closure, limits.closure_tol, True, room.sample, room)


@njit(**OPTIONS)
def events_within(kernels, inputs, method, limits, room, turns, t, step, piece, theta, g):
    """Evaluate g at t + theta step on the dense output; return the calls of the closure kernel."""
    _, calls = state_within(kernels, method, limits, room, theta, step)
    copy(room.sample, room.x, room.n)
    add_turns(room.x, turns, room.nq)
    force(inputs, t + theta * step, True, piece, room.x + room.n)
    call(kernels.events, room.x, g)
    return calls


@njit(**OPTIONS)
def quiet(kernels, inputs, method, room, turns, t, step, piece, watched, g, g_new, g_middle):
    """Tell whether no event function comes near zero within a step from g to g_new.

    The state in the middle is that of the cubic through both ends and their slopes, which are at
    hand in every method.
    """
    last, n = room.k + min(method.solution, method.computed - 1) * room.width, room.n
    for m in range(n):
        room.x[m] = 0.5 * (room.y[m] + room.new[m]) + 0.125 * step * (room.k[m] - last[m])
    add_turns(room.x, turns, room.nq)
    force(inputs, t + 0.5 * step, True, piece, room.x + n)
    call(kernels.events, room.x, g_middle)
    for i in range(watched):
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
def dip(kernels, inputs, method, limits, room, turns, t, step, piece, i, places, values, g):
    """Follow g_i from three places, where it has one sign, to where it comes nearest to zero
    between them.

    Return a place where its sign is another one, with g there, or 0; and the calls of the closure
    kernel.
    """
    (a, b, c), (g_a, g_b, g_c), calls = places, values, 0
    side = 1.0 if g_b > 0 else -1.0
    for _ in range(TRIES):
        place = vertex(a, b, c, g_a, g_b, g_c)
        if not a < place < c:
            break
        if abs(place - b) < SAME * (c - a):
            place = 0.5 * (a + b) if b - a > c - b else 0.5 * (b + c)
        calls += events_within(
            kernels, inputs, method, limits, room, turns, t, step, piece, place, g
        )
        if not side * g[i] > 0:
            return place, calls
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
    return 0.0, calls


@njit(**OPTIONS)
def look(kernels, inputs, method, limits, room, turns, t, step, piece, watched, thetas, table):
    """Fill the places thetas and the rows g of a table, whose first row is g at the start and whose
    row LOOKS g at the end.

    Return the number of intervals, and the calls of the closure kernel.
    """
    calls, count, spare = 0, LOOKS, table + (MOST + 1) * watched
    for j in range(LOOKS + 1):
        thetas[j] = j / LOOKS
        if 0 < j < LOOKS:
            row = table + j * watched
            calls += events_within(
                kernels, inputs, method, limits, room, turns, t, step, piece, thetas[j], row
            )
    for i in range(watched):
        j = 1
        while j < count and count < MOST:
            places, g = (thetas[j - 1], thetas[j], thetas[j + 1]), table + j * watched + i
            values, side = (g[-watched], g[0], g[watched]), 1.0 if g[0] > 0 else -1.0
            nearest = min(side * values[0], side * values[1], side * values[2])
            if 0 < nearest <= abs(values[0] - 2 * values[1] + values[2]):
                found, made = dip(
                    kernels, inputs, method, limits, room, turns, t, step, piece, i, places, values, spare
                )  # fmt: skip
                calls += made
                if found > 0:
                    at = j if found < thetas[j] else j + 1
                    for row in range(count, at - 1, -1):
                        thetas[row + 1] = thetas[row]
                        copy(table + row * watched, table + (row + 1) * watched, watched)
                    thetas[at] = found
                    copy(spare, table + at * watched, watched)
                    count, j = count + 1, j + 1
            j += 1
    return count, calls


@njit(**OPTIONS)
def locate(
    kernels, inputs, method, limits, room, turns, t, step, piece, i, start, before, end, after, g
):
    """Return the theta at which g_i has just changed its sign from that of `before` at theta =
    start to that of `after` at theta = end, and the calls of the closure kernel.
    """
    side = 1.0 if before < 0 else -1.0
    tolerance, calls = ROOT * max(1.0, abs(t / step)), 0
    theta_1, g_1, theta_2, g_2, guess = end, after, start, before, 0.5
    for _ in range(ROOT_CALLS):
        theta = theta_1 + guess * (theta_2 - theta_1)
        calls += events_within(
            kernels, inputs, method, limits, room, turns, t, step, piece, theta, g
        )
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
    return (theta_1 if side * g_1 >= 0 else theta_2), calls


@njit(**OPTIONS)
def earliest(crossings, count):
    """Return which of the events comes first."""
    first = 0
    for i in range(1, count):
        if crossings[i] < crossings[first]:
            first = i
    return first
