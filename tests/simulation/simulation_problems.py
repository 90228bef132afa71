"""Small systems with known motions, as the kernels that the integrator is given."""

import math
from collections.abc import Callable
from functools import cached_property

from numba import cfunc, types

KERNEL = types.void(types.CPointer(types.double), types.CPointer(types.double))
GRAVITY = 9.81


class SmallKernel:
    """A function of numbers in and out, compiled when its address is first asked for."""

    def __init__(self, function: Callable[..., None]):
        self.__wrapped__ = function

    @cached_property
    def _code(self):
        return cfunc(KERNEL)(self.__wrapped__)

    @property
    def address(self) -> int:
        return self._code.address


@SmallKernel
def oscillator(x, out):
    """q'' = -q."""
    out[0], out[1], out[2] = x[1], -x[0], 1.0


@SmallKernel
def decay(x, out):
    """q' = -1e4 q."""
    out[0], out[1] = -1e4 * x[0], 1.0


@SmallKernel
def point_mass(x, out):
    """q'' = u / p."""
    out[0], out[1], out[2] = x[1], x[2] / x[3], 1.0


@SmallKernel
def two_inputs(x, out):
    """Two point masses, q_i'' = u_i."""
    out[0], out[1], out[2], out[3], out[4] = x[2], x[3], x[4], x[5], 1.0


@SmallKernel
def pendulum(x, out):
    """q'' = -g sin q."""
    out[0], out[1], out[2] = x[1], -GRAVITY * math.sin(x[0]), 1.0


@SmallKernel
def arenstorf(x, out):
    """The restricted three-body problem in the rotating frame (Hairer, Norsett & Wanner I, eq.
    (0.1))."""
    mu = 0.012277471
    earth = ((x[0] + mu) ** 2 + x[1] ** 2) ** 1.5
    moon = ((x[0] - 1 + mu) ** 2 + x[1] ** 2) ** 1.5
    out[0], out[1] = x[2], x[3]
    out[2] = x[0] + 2 * x[3] - (1 - mu) * (x[0] + mu) / earth - mu * (x[0] - 1 + mu) / moon
    out[3] = x[1] - 2 * x[2] - (1 - mu) * x[1] / earth - mu * x[1] / moon
    out[4] = 1.0


@SmallKernel
def bead(x, out):
    """A bead on the unit circle x^2 + y^2 = 1, gravity along -y; v = x' is independent, y' = -(x /
    y) v; pivot |y|.

    Orthogonal complement L = (1, -x / y); (L'L) v' = L'(0, -g) - L'L' v, the unit mass divided out.
    """
    position, height, v = x[0], x[1], x[2]
    slope = -position / height
    rise = slope * v
    slope_rate = -(v * height - position * rise) / height**2
    out[0], out[1] = v, rise
    out[2] = (-GRAVITY * slope - slope * slope_rate * v) / (1 + slope**2)
    out[3] = abs(height)


@SmallKernel
def bead_closure(x, out):
    """Newton's step of y on phi = x^2 + y^2 - 1."""
    phi = x[0] ** 2 + x[1] ** 2 - 1
    out[0], out[1], out[2] = x[0], x[1] - phi / (2 * x[1]), abs(phi)


@SmallKernel
def drift(x, out):
    """q' = v, v' = 0, defined up to q = 0.5 only."""
    out[0], out[1], out[2] = x[1], 0.0 if x[0] <= 0.5 else math.nan, 1.0


@SmallKernel
def fading(x, out):
    """q' = v, v' = 0, with the pivot 1 - q."""
    out[0], out[1], out[2] = x[1], 0.0, 1 - x[0]


@SmallKernel
def free(x, out):
    """q' = v, v' = 0 for two coordinates, of which the second rests."""
    out[0], out[1], out[2], out[3] = x[2], 0.0, 0.0, 1.0


@SmallKernel
def half_line(x, out):
    """A closure that exists up to q = 0.5 only."""
    out[0], out[1], out[2] = x[0], x[1], 0.0 if x[0] <= 0.5 else 1.0


@SmallKernel
def explosion(x, out):
    """q' = q^2: q = q_0 / (1 - q_0 t)."""
    out[0], out[1] = x[0] ** 2, 1.0


@SmallKernel
def gap(x, out):
    """A closure that does not exist for 0.40 < q < 0.45."""
    out[0], out[1], out[2] = x[0], x[1], 1.0 if 0.40 < x[0] < 0.45 else 0.0


@SmallKernel
def two_branches(x, out):
    """A closure that leads the second coordinate to 0 up to q = 0.5, and to -1 beyond."""
    branch = 0.0 if x[0] <= 0.5 else -1.0
    out[0], out[1], out[2] = x[0], branch, abs(x[1] - branch)


@SmallKernel
def van_der_pol(x, out):
    """q'' = (1 - q^2) q' mu - q, with mu the parameter."""
    out[0], out[1], out[2] = x[1], x[2] * (1 - x[0] ** 2) * x[1] - x[0], 1.0


@SmallKernel
def van_der_pol_jacobian(x, out):
    out[0], out[1] = 0.0, -2 * x[2] * x[0] * x[1] - 1
    out[2], out[3] = 1.0, x[2] * (1 - x[0] ** 2)


@SmallKernel
def robertson(x, out):
    """Robertson's reaction (Hairer & Wanner II, eq. (IV.1.4))."""
    slow, fast = 0.04 * x[0], 1e4 * x[1] * x[2]
    third = 3e7 * x[1] ** 2
    out[0], out[1], out[2], out[3] = fast - slow, slow - fast - third, third, 1.0


@SmallKernel
def robertson_jacobian(x, out):
    out[0], out[1], out[2] = -0.04, 0.04, 0.0
    out[3], out[4], out[5] = 1e4 * x[2], -1e4 * x[2] - 6e7 * x[1], 6e7 * x[1]
    out[6], out[7], out[8] = 1e4 * x[1], -1e4 * x[1], 0.0


@SmallKernel
def prothero_robinson(x, out):
    """y' = -p (y - sin u) + cos u, whose solution from y = 0 is sin t for u = t."""
    out[0], out[1] = -x[2] * (x[0] - math.sin(x[1])) + math.cos(x[1]), 1.0


@SmallKernel
def prothero_robinson_jacobian(x, out):
    out[0], out[1] = -x[2], x[2] * math.cos(x[1]) - math.sin(x[1])


@SmallKernel
def oscillator_jacobian(x, out):
    out[0], out[1], out[2], out[3] = 0.0, -1.0, 1.0, 0.0


@SmallKernel
def pendulum_jacobian(x, out):
    out[0], out[1], out[2], out[3] = 0.0, -GRAVITY * math.cos(x[0]), 1.0, 0.0


@SmallKernel
def bead_jacobian(x, out):
    """The bead's derivatives: s = -x / y, y' = s v, v' = -s (g + r) / (1 + s^2), r = s' v = -v^2
    (x^2 + y^2) / y^3."""
    position, height, v = x[0], x[1], x[2]
    slope = -position / height
    slope_x, slope_y = -1 / height, position / height**2
    turn = -(v**2) * (height**2 + position**2) / height**3
    turn_x, turn_y = (
        -(v**2) * 2 * position / height**3,
        v**2 * (height**2 + 3 * position**2) / height**4,
    )
    turn_v = -2 * v * (height**2 + position**2) / height**3
    size = 1 + slope**2
    pull = -GRAVITY * slope - slope * turn
    by_slope = (-GRAVITY - turn) / size - 2 * slope * pull / size**2
    out[0], out[1], out[2] = 0.0, slope_x * v, by_slope * slope_x - slope * turn_x / size
    out[3], out[4], out[5] = 0.0, slope_y * v, by_slope * slope_y - slope * turn_y / size
    out[6], out[7], out[8] = 1.0, slope, -slope * turn_v / size


@SmallKernel
def falling(x, out):
    """q'' = -g for a height q."""
    out[0], out[1], out[2] = x[1], -GRAVITY, 1.0


@SmallKernel
def height_and_speed(x, out):
    """Two event functions: q, and v."""
    out[0], out[1] = x[0], x[1]


@SmallKernel
def position_twice(x, out):
    """Two event functions with the same zeros: q, and 3 q."""
    out[0], out[1] = x[0], 3 * x[0]


@SmallKernel
def above_diagonal(x, out):
    """An event function of a bead: height y + 1/2."""
    out[0] = x[1] + 0.5


@SmallKernel
def undefined(x, out):
    """A function that is not defined for q < 0.9."""
    out[0] = math.nan if x[0] < 0.9 else 1.0


@SmallKernel
def servo(x, out):
    """u = -p (q - u_0), with the signal u_0 and the held input u_1 that is set: (q, v, u_0, u_1, p)
    -> u_1."""
    out[0] = -x[4] * (x[0] - x[2]) - 0.5 * x[1]


@SmallKernel
def driven_point(x, out):
    """q'' = u_1, the held input; u_0 is a signal that only the controller reads."""
    out[0], out[1], out[2] = x[1], x[3], 1.0


@SmallKernel
def counter_of_point(x, out):
    """Count the samples in the held input: (q, v, u_0, u_1, p) -> u_1 + 1."""
    out[0] = x[3] + 1


@SmallKernel
def held_rate(x, out):
    """q' = u."""
    out[0], out[1] = x[1], 1.0


@SmallKernel
def count_rate(x, out):
    """Count the samples in the held input: (q, u) -> u + 1."""
    out[0] = x[1] + 1


@SmallKernel
def failing_control(x, out):
    """A controller that fails where q reaches 0.3: (q, u) -> u."""
    out[0] = 1.0 if x[0] < 0.3 else math.nan


@SmallKernel
def cart_pole(x, out):
    """A cart of mass p on a level rail, under a pole of 1 m with 1 kg at its tip: (x, angle from
    the level, x', angle')."""
    sine, cosine, rate = math.sin(x[1]), math.cos(x[1]), x[3]
    push = (cosine * rate**2 - GRAVITY * sine * cosine) / (x[4] + cosine**2)
    out[0], out[1], out[2], out[3], out[4] = x[2], rate, push, sine * push - GRAVITY * cosine, 1.0
