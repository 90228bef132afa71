"""Small systems with known motions, as the kernels that the integrator is given."""

import math

from numba import cfunc, types

KERNEL = types.void(types.CPointer(types.double), types.CPointer(types.double))
GRAVITY = 9.81


@cfunc(KERNEL)
def oscillator(x, out):
    """q'' = -q."""
    out[0], out[1], out[2] = x[1], -x[0], 1.0


@cfunc(KERNEL)
def point_mass(x, out):
    """q'' = u / p."""
    out[0], out[1], out[2] = x[1], x[2] / x[3], 1.0


@cfunc(KERNEL)
def two_inputs(x, out):
    """Two point masses, q_i'' = u_i."""
    out[0], out[1], out[2], out[3], out[4] = x[2], x[3], x[4], x[5], 1.0


@cfunc(KERNEL)
def pendulum(x, out):
    """q'' = -g sin q."""
    out[0], out[1], out[2] = x[1], -GRAVITY * math.sin(x[0]), 1.0


@cfunc(KERNEL)
def arenstorf(x, out):
    """The restricted three-body problem in the rotating frame (Hairer, Norsett & Wanner I, eq. (0.1))."""
    mu = 0.012277471
    earth = ((x[0] + mu) ** 2 + x[1] ** 2) ** 1.5
    moon = ((x[0] - 1 + mu) ** 2 + x[1] ** 2) ** 1.5
    out[0], out[1] = x[2], x[3]
    out[2] = x[0] + 2 * x[3] - (1 - mu) * (x[0] + mu) / earth - mu * (x[0] - 1 + mu) / moon
    out[3] = x[1] - 2 * x[2] - (1 - mu) * x[1] / earth - mu * x[1] / moon
    out[4] = 1.0


@cfunc(KERNEL)
def bead(x, out):
    """A bead on the unit circle x^2 + y^2 = 1, gravity along -y; v = x' is independent, y' = -(x / y) v; pivot |y|.

    Orthogonal complement L = (1, -x / y); (L'L) v' = L'(0, -g) - L'L' v, the unit mass divided out.
    """
    position, height, v = x[0], x[1], x[2]
    slope = -position / height
    rise = slope * v
    slope_rate = -(v * height - position * rise) / height**2
    out[0], out[1] = v, rise
    out[2] = (-GRAVITY * slope - slope * slope_rate * v) / (1 + slope**2)
    out[3] = abs(height)


@cfunc(KERNEL)
def bead_closure(x, out):
    """Newton's step of y on phi = x^2 + y^2 - 1."""
    phi = x[0] ** 2 + x[1] ** 2 - 1
    out[0], out[1], out[2] = x[0], x[1] - phi / (2 * x[1]), abs(phi)


@cfunc(KERNEL)
def drift(x, out):
    """q' = v, v' = 0, defined up to q = 0.5 only."""
    out[0], out[1], out[2] = x[1], 0.0 if x[0] <= 0.5 else math.nan, 1.0


@cfunc(KERNEL)
def fading(x, out):
    """q' = v, v' = 0, with the pivot 1 - q."""
    out[0], out[1], out[2] = x[1], 0.0, 1 - x[0]


@cfunc(KERNEL)
def free(x, out):
    """q' = v, v' = 0 for two coordinates, of which the second rests."""
    out[0], out[1], out[2], out[3] = x[2], 0.0, 0.0, 1.0


@cfunc(KERNEL)
def half_line(x, out):
    """A closure that exists up to q = 0.5 only."""
    out[0], out[1], out[2] = x[0], x[1], 0.0 if x[0] <= 0.5 else 1.0


@cfunc(KERNEL)
def explosion(x, out):
    """q' = q^2: q = q_0 / (1 - q_0 t)."""
    out[0], out[1] = x[0] ** 2, 1.0


@cfunc(KERNEL)
def gap(x, out):
    """A closure that does not exist for 0.40 < q < 0.45."""
    out[0], out[1], out[2] = x[0], x[1], 1.0 if 0.40 < x[0] < 0.45 else 0.0


@cfunc(KERNEL)
def two_branches(x, out):
    """A closure that leads the second coordinate to 0 up to q = 0.5, and to -1 beyond."""
    branch = 0.0 if x[0] <= 0.5 else -1.0
    out[0], out[1], out[2] = x[0], branch, abs(x[1] - branch)
