"""A robot's functions of JAX arrays, by name."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any

import jax.numpy as jnp

import jax
from linkwork.autodiff import functions_of
from linkwork.autodiff.results import arguments, results
from linkwork.checks import shown
from linkwork.errors import LinkworkError
from linkwork.jax import stepping
from linkwork.jax.calls import Calls
from linkwork.jax.operators import operator
from linkwork.model.state import State
from linkwork.robot import Robot

Array = Any


class JaxModel:
    """Hold a robot's functions of JAX arrays in one choice of independent rates.

        dv = model.forward_dynamics(q, v, u)
        q, v = model.step(q, v, u, 1e-3)

    q (..., nq) are the coordinates of the tree, v (..., n) the independent rates, u the actuators'
    forces, as of `State.q`, `State.rates` and `robot.actuators`; leading dimensions are broadcast.
    Robots with free numbers take them as a last argument p (..., np), their own if left out. Beside
    the methods below there are all functions of `robot.functions()` that need no Newton's method,
    by name: inverse_dynamics(q, v, dv), mass_matrix(q), tool_pose(q), energy(q, v) ...; what has
    one result returns it, others return a named tuple.

    All are differentiable twice with respect to all arguments, in forward and reverse mode.
    Derivatives by q are those of the expressions in all nq coordinates; along a motion of closed
    loops,

        dq = coordinate_rates(q, d)          d: a small step (n) of the independent coordinates,

    they are those of the mechanism. `closed` makes q from what is independent, so that gradients
    through it are those by the independent coordinates.

    Attributes:
        name: of the robot; independent: names of v; p: values of the free numbers
        q, v: of the state that the chart is from, or of home
        arrays: (name, unit) of each number of q, v, u ...; functions: names of all functions
        notes: sentences on what acts otherwise than in a run
    """

    def __init__(self, robot: Robot, chart: State | Sequence[str] | None, raises: bool):
        self._offered = functions_of(robot, chart)
        self.name, self.independent = robot.mechanism.name, self._offered.equations.independent
        self.notes: tuple[str, ...] = self._offered.functions.notes
        self.p = jnp.asarray(robot.p)
        state = chart if isinstance(chart, State) else robot.in_chart(robot.home, self.independent)
        self.q, self.v = jnp.asarray(state.q), jnp.asarray(state.rates)
        self._calls = Calls(self.name, self.independent, raises)
        self._doors: dict[str, Callable[..., Any]] = {}

    def __repr__(self) -> str:
        return f"JaxModel({self.name!r}, independent rates {', '.join(self.independent)})"

    @property
    def functions(self) -> tuple[str, ...]:
        return (*self._offered, "closed", "step", "rollout")

    @property
    def arrays(self) -> dict[str, tuple[tuple[str, str], ...]]:
        return self._offered.functions.arrays

    def __getattr__(self, name: str) -> Callable[..., Any]:
        if name.startswith("_"):
            raise AttributeError(name)
        try:
            return self._door(name)
        except LinkworkError as error:
            raise AttributeError(str(error)) from None

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self._offered]

    def forward_dynamics(self, q: Array, v: Array, u: Array, p: Array | None = None) -> Array:
        """Return v' (..., n) = M^-1 (S' u + f - C v - G) (paper, Eq. (9)).

        Args:
            q, v, u, p: coordinates of the tree (..., nq), independent rates (..., n) [m/s, rad/s],
                actuator forces (..., actuators) [N, N m], free numbers (..., np).

        Raises:
            LinkworkError: arrays of other sizes, or of no numbers. XLA's error where the rates do
                not determine the motion (`singular`).
        """
        return self._door("forward_dynamics")(q, v, u, p)

    def inverse_dynamics(self, q: Array, v: Array, dv: Array, p: Array | None = None) -> Array:
        """Return the actuator forces u (..., actuators) of least sum of squares with S' u = M v' +
        C v + G - f, for accelerations dv (..., n).

        Raises:
            LinkworkError: directions that no actuator drives; as `forward_dynamics`.
        """
        return self._door("inverse_dynamics")(q, v, dv, p)

    def closed(self, q: Array, p: Array | None = None) -> Array:
        """Return q (..., nq) with loops closed by moving the coordinates that are not independent,
        by Newton's method, and with quaternions of length 1.

        Derivatives are those of the closed configuration: dq_dep = -Phi_dep^-1 (Phi_ind dq_ind +
        dphi/dp dp).

        Raises:
            LinkworkError: a chart in which a free turn is independent in part. XLA's error where
                the loops do not close near q.
        """
        nq = self._offered.equations.nq
        return self._closing(*together(sized(q, "q", nq, "closed"), *self._free(p, "closed")))

    def step(
        self, q: Array, v: Array, u: Array, h: Array, p: Array | None = None
    ) -> tuple[Array, Array]:
        """Return (q, v) after one step of length h [s] (...) under constant forces u: the classical
        fourth-order Runge-Kutta method, and the loops closed by two of Newton's steps, as
        `robot.simulate(method="rk4", step=h)` does as long as it stays in one chart.

        Raises:
            LinkworkError: robots with friction that sticks by bristles, which has states of its
                own; arrays that do not fit. XLA's error where the rates cease to determine the
                motion on the way, or the step is so long that loops stay open.
        """
        return self._stepping(*together(*self._state(q, v, u, "step"), *self._rest(h, p, "step")))

    def rollout(
        self, q: Array, v: Array, u: Array, h: Array, p: Array | None = None
    ) -> tuple[Array, Array]:
        """Return the states (K + 1, ..., nq) and (K + 1, ..., n) of K steps, the first one
        included.

        In reverse mode each step is done again on the way back, so that memory holds the states
        alone.

        Args:
            q, v: the first state; u: forces (K, ..., actuators) of each step; h: their length [s].
            p: free numbers.

        Raises:
            LinkworkError: as `step`.
        """
        q, v, u = self._state(q, v, u, "rollout")
        if u.ndim < 2:
            raise LinkworkError(
                f"u of rollout has the shape {u.shape}; give a row of forces for each step"
            )
        rest = self._rest(h, p, "rollout")
        q, v, *_ = together(q, v, u[0], *rest) if len(u) else together(q, v, *rest)

        @jax.checkpoint
        def onward(state: tuple[Array, Array], u: Array) -> Any:
            after = self._stepping(*together(*state, u, *rest))
            return after, after

        _, (later_q, later_v) = jax.lax.scan(onward, (q, v), u)
        return jnp.concatenate([q[None], later_q]), jnp.concatenate([v[None], later_v])

    def _state(self, q: Array, v: Array, u: Array, what: str) -> list[Array]:
        inputs = self._offered.motion.inputs
        return [sized(value, *given, what) for value, given in zip((q, v, u), inputs, strict=False)]

    def _rest(self, h: Array, p: Array | None, what: str) -> list[Array]:
        return [numbers(h, "h", what)[..., None], *self._free(p, what)]

    def _free(self, p: Array | None, what: str) -> list[Array]:
        """Return the free numbers, in a list that is empty where there are none."""
        if not self.p.size:
            if p is not None:
                raise LinkworkError(f"{what} takes no p: no number of {self.name} is free")
            return []
        return [self.p if p is None else sized(p, "p", self.p.size, what)]

    @cached_property
    def _closing(self) -> Callable[..., Any]:
        return stepping.closing(self._offered, self._calls)

    @cached_property
    def _stepping(self) -> Callable[..., Any]:
        return stepping.stepping(self._offered, self._calls)

    def _door(self, name: str) -> Callable[..., Any]:
        """Return the function of a name, which takes and gives arrays in their shapes."""
        if name not in self._doors:
            of = self._offered[name]
            f, told = operator(of, self._calls), results(name, of)

            def door(*given: Array, p: Array | None = None) -> Any:
                own, p = arguments(name, of, given, p)
                sizes = [each for each in of.inputs if each[0] != "p"]
                arrays = [sized(value, *each, name) for value, each in zip(own, sizes, strict=True)]
                return told(f(*together(*arrays, *self._free(p, name))))

            door.__name__ = name
            self._doors[name] = door
        return self._doors[name]


def numbers(value: Any, name: str, what: str) -> Array:
    """Return an array of doubles; refuse what holds no real numbers."""
    try:
        array = jnp.asarray(value)
    except (TypeError, ValueError):
        array = None
    if array is None or not jnp.issubdtype(array.dtype, jnp.number) or jnp.iscomplexobj(array):
        raise LinkworkError(f"{name} of {what} is {shown(value)}; give an array of real numbers")
    return array.astype(jnp.float64)


def sized(value: Any, name: str, size: int, what: str) -> Array:
    """Return an array of doubles (..., size); refuse another size."""
    array = numbers(value, name, what)
    if array.shape[-1:] != (size,):
        raise LinkworkError(
            f"{name} of {what} has the shape {array.shape}; its last dimension holds {size} numbers"
        )
    return array


def together(*arrays: Array) -> list[Array]:
    """Return arrays with equal leading dimensions."""
    try:
        lead = jnp.broadcast_shapes(*(array.shape[:-1] for array in arrays))
    except ValueError:
        shapes = " and ".join(str(array.shape) for array in arrays)
        raise LinkworkError(f"arrays of the shapes {shapes} do not fit together") from None
    return [jnp.broadcast_to(array, (*lead, array.shape[-1])) for array in arrays]
