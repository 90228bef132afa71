"""Step sizes of the integrators' loop.

A step of length h and error e, for which an error of 1 is allowed, would have had that error at
about h* = h / e^p. The next one is a little shorter than h* r where h* falls, r = h* / h*_before,
for it goes on falling (Gustafsson, ACM Trans. Math. Softw. 20 (1994) 496-517), and than
h* / r^(1/2) where it rises, for it may not go on. A motion whose steps fall steeply, or have fallen
far below the longest one lately, comes to a peak, at which the estimates of errors say little: the
dense output is looked at within such steps, too.

Sources: Hairer, Norsett & Wanner, Solving ODE I, sec. II.4 (first step, safety factors).
"""

import math
from typing import NamedTuple

from numba import njit

from linkwork.simulation.compiled import INLINED, OPTIONS
from linkwork.simulation.native_parts import OK, evaluate, force, scaled

SMALLEST_STEP = 16 * 2.0**-52  # relative to the time and to the duration
SAFETY = 0.9
SMALLEST_FACTOR, LARGEST_FACTOR = 0.2, 10.0
DAMPING = 0.85
"""Of the exponent with which the error of a step sets the next one, about: fewer steps fail."""
SMALLEST_ERROR = 1e-10
RETREAT = 0.25  # factor on the step where the equations themselves fail
BOLDNESS = 2.5
"""Of the first step, which the source makes short: a step that fails costs no more than one too
many."""
WARY = 10.0
"""Times which the error of a first step counts: its length is a guess, and the estimate at a length
that is guessed, or found by trying, may be small by accident."""
FARTHEST = 1e4  # first step, in units of the distance at which the second slope was taken
SHORT = 1 / 32  # of the longest step lately, below which steps have fallen
LEAP = 2.0  # from one h* to the next, beyond which a rise counts no more
STEEP = 0.5  # of h*, below which steps fall steeply
FADING = 0.98  # of the longest step from one step to the next


class Rhythm(NamedTuple):
    """Say how steps go on: `step`, the size of the next one; `growth`, the largest factor by which
    the one after it may be longer; `longest`, the longest one lately; `ideal`, h* of the last one,
    no longer than the next one may be, 0 before the first.
    """

    step: float
    growth: float
    longest: float
    ideal: float


@njit(**INLINED)
def shortest_step(start, stop):
    """Return the shortest step of a run between two times."""
    return SMALLEST_STEP * max(stop, stop - start)


@njit(**INLINED)
def sixteenths(exponent):
    """Return how many sixteenths the damped exponent has: their powers are square roots, which
    vectors have, too."""
    return round(16 * DAMPING * exponent)


@njit(**INLINED)
def power(error, count):
    """Return error^(count / 16)."""
    root, result = math.sqrt(math.sqrt(math.sqrt(math.sqrt(error)))), 1.0
    for _ in range(count):
        result *= root
    return result


@njit(**INLINED)
def fallen(step, longest, ideal):
    """Tell whether steps fall steeply, or have fallen far below the longest one lately."""
    return step < SHORT * longest or step < STEEP * ideal


@njit(**INLINED)
def after_success(rhythm, step, error, exponent, max_step):
    """Return how steps go on after one that was accepted; it may have been shorter than it was to
    be."""
    own = error if rhythm.ideal > 0 else error / WARY
    scale = power(max(own, SMALLEST_ERROR), sixteenths(exponent))
    ideal = min(step / scale, max_step, LARGEST_FACTOR * step)
    ratio = ideal / rhythm.ideal if rhythm.ideal > 0 else 1.0
    factor = SAFETY / scale * (ratio if ratio <= 1 else math.sqrt(1 / min(ratio, LEAP)))
    proposal = min(max_step, step * max(SMALLEST_FACTOR, min(rhythm.growth, factor)))
    return Rhythm(
        max(rhythm.step, proposal) if step < rhythm.step else proposal,
        LARGEST_FACTOR,
        max(step, FADING * rhythm.longest),
        ideal,
    )


@njit(**INLINED)
def after_failure(rhythm, step):
    """Return how steps go on, at the length `step`, after one whose error was too large."""
    return Rhythm(step, 1.0, rhythm.longest, rhythm.ideal)


@njit(**INLINED)
def after_retreat(rhythm, step):
    """Return how steps go on after one of the length `step` in which the equations failed, which
    tells of no peak."""
    return Rhythm(RETREAT * step, 1.0, RETREAT * rhythm.longest, RETREAT * rhythm.ideal)


@njit(**OPTIONS)
def first_step(run):
    """Guess a first step from the slope here, k_0, and one a little ahead, k_1."""
    room, longest = run.room, run.target - run.t
    n, y, x, slope, next_slope = room.n, room.y, room.x, room.k, room.k + room.width
    size, steepness = scaled(run, y), scaled(run, slope)
    ahead = min(longest, 1e-6 if size < 1e-5 or steepness < 1e-5 else 0.01 * size / steepness)
    for m in range(n):
        x[m] = y[m] + ahead * slope[m]
    force(run.inputs, run.t + ahead, True, 0, x + n)
    ailment, _ = evaluate(run, 1)
    if ailment != OK:
        return ahead
    for m in range(n):
        next_slope[m] -= slope[m]
    steepest = max(steepness, scaled(run, next_slope) / ahead)
    short, exponent = max(1e-6, 1e-3 * ahead), run.method.exponent
    guess = short if steepest <= 1e-15 else BOLDNESS * (0.01 / steepest) ** exponent
    return min(FARTHEST * ahead, guess)
