"""A robot's functions by name, for the arrays of any framework."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any

from linkwork.autodiff.array_function import ArrayFunction
from linkwork.autodiff.offered import functions_of
from linkwork.autodiff.results import arguments, results
from linkwork.checks import shown
from linkwork.errors import LinkworkError
from linkwork.model.state import State
from linkwork.robot import Robot

Array = Any


class ArrayModel:
    """Hold a robot's functions of arrays in one choice of independent rates.

        dv = model.forward_dynamics(q, v, u)
        q, v = model.step(q, v, u, 1e-3)

    q (..., nq) are the coordinates of the tree, v (..., n) the independent rates, u the actuators'
    forces, as of `State.q`, `State.rates` and `robot.actuators`; leading dimensions are
    broadcast. Robots with free numbers take them as a last argument p (..., np), their own if left
    out. Beside the methods below there are all functions of `robot.functions()` that are
    expressions (reactions solve equations and are none), by name: inverse_dynamics(q, v, dv),
    mass_matrix(q), tool_pose(q), energy(q, v) ... ; what has one result returns it, others return a
    named tuple.

    All are differentiable twice with respect to all arguments. Derivatives by q are those of the
    expressions in all nq coordinates; along a motion of closed loops,

        dq = coordinate_rates(q, d)          d: a small step (n) of the independent coordinates,

    they are those of the mechanism. `closed` makes q from what is independent, so that gradients
    through it are those by the independent coordinates.

    Attributes:
        name: of the robot; independent: names of v; p: values of the free numbers
        q, v: of the state that the chart is from, or of home
        arrays: (name, unit) of each number of q, v, u ...; functions: names of all functions
        notes: sentences on what acts otherwise than in a run
    """

    def __init__(self, robot: Robot, chart: State | Sequence[str] | None, singular: str):
        if singular not in ("raise", "nan"):
            raise LinkworkError(f'singular is {shown(singular)}; give "raise" or "nan"')
        self._made_of, self._raises = (robot, chart, singular), singular == "raise"
        self._offered = functions_of(robot, chart)
        self.name, self.independent = robot.mechanism.name, self._offered.equations.independent
        self.notes: tuple[str, ...] = self._offered.functions.notes
        state = chart if isinstance(chart, State) else robot.in_chart(robot.home, self.independent)
        self.p: Array = self._doubles(robot.p)
        self.q: Array = self._doubles(state.q)
        self.v: Array = self._doubles(state.rates)
        self._doors: dict[str, Callable[..., Any]] = {}

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), self._made_of

    def __repr__(self) -> str:
        rates = ", ".join(self.independent)
        return f"{type(self).__name__}({self.name!r}, independent rates {rates})"

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
            LinkworkError: arrays of other sizes, or of no numbers. Rates that do not determine the
                motion are told as `model` says (`singular`).
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
            LinkworkError: a chart in which a free turn is independent in part. Loops that do not
                close near q are told as `model` says (`singular`).
        """
        nq = self._offered.equations.nq
        return self._closing(
            *self._together(self._sized(q, "q", nq, "closed"), *self._free(p, "closed"))
        )

    def step(
        self, q: Array, v: Array, u: Array, h: Array, p: Array | None = None
    ) -> tuple[Array, Array]:
        """Return (q, v) after one step of length h [s] (...) under constant forces u: the classical
        fourth-order Runge-Kutta method, and the loops closed by two of Newton's steps, as
        `robot.simulate(method="rk4", step=h)` does as long as it stays in one chart.

        Raises:
            LinkworkError: robots with friction that sticks by bristles, which has states of its
                own; arrays that do not fit. Where the rates cease to determine the motion on the
                way, or the step is so long that loops stay open, is told as `model` says
                (`singular`).
        """
        return self._stepping(
            *self._together(*self._state(q, v, u, "step"), *self._rest(h, p, "step"))
        )

    def rollout(
        self, q: Array, v: Array, u: Array, h: Array, p: Array | None = None
    ) -> tuple[Array, Array]:
        """Return the states (K + 1, ..., nq) and (K + 1, ..., n) of K steps, the first one
        included.

        Args:
            q, v: the first state; u: forces (K, ..., actuators) of each step; h: their length [s].
            p: free numbers.

        Raises:
            LinkworkError: as `step`.
        """
        q, v, u = self._state(q, v, u, "rollout")
        if u.ndim < 2:
            raise LinkworkError(
                f"u of rollout has the shape {tuple(u.shape)}; give a row of forces for each step"
            )
        rest = self._rest(h, p, "rollout")
        q, v, *_ = self._together(q, v, *([u[0]] if len(u) else []), *rest)
        return self._rolled(q, v, u, rest)

    # What a framework does

    @staticmethod
    def _doubles(value: Any) -> Array | None:
        """Return an array of doubles, None for what holds no real numbers."""
        raise NotImplementedError

    @staticmethod
    def _broadcast(arrays: Sequence[Array]) -> list[Array] | None:
        """Return arrays (..., sizes) with equal leading dimensions, None where these do not fit."""
        raise NotImplementedError

    def _operator(self, of: ArrayFunction) -> Callable[..., Array]:
        """Return a function of arrays (..., sizes) with equal leading dimensions -> (..., m)."""
        raise NotImplementedError

    @cached_property
    def _closing(self) -> Callable[..., Array]:
        """q[, p] -> q with its loops closed."""
        raise NotImplementedError

    @cached_property
    def _stepping(self) -> Callable[..., tuple[Array, Array]]:
        """q, v, u, h[, p] -> q, v after a step of length h (..., 1)."""
        raise NotImplementedError

    def _rolled(self, q: Array, v: Array, u: Array, rest: list[Array]) -> tuple[Array, Array]:
        """Return the states of a rollout; rest: what follows u among the arguments of a step."""
        raise NotImplementedError

    # What is given

    def _state(self, q: Array, v: Array, u: Array, what: str) -> list[Array]:
        given = zip((q, v, u), self._offered.motion.inputs, strict=False)
        return [self._sized(value, *each, what) for value, each in given]

    def _rest(self, h: Array, p: Array | None, what: str) -> list[Array]:
        return [self._numbers(h, "h", what)[..., None], *self._free(p, what)]

    def _free(self, p: Array | None, what: str) -> list[Array]:
        """Return the free numbers, in a list that is empty where there are none."""
        (count,) = self.p.shape
        if not count:
            if p is not None:
                raise LinkworkError(f"{what} takes no p: no number of {self.name} is free")
            return []
        return [self.p if p is None else self._sized(p, "p", count, what)]

    def _numbers(self, value: Any, name: str, what: str) -> Array:
        array = self._doubles(value)
        if array is None:
            raise LinkworkError(
                f"{name} of {what} is {shown(value)}; give an array of real numbers"
            )
        return array

    def _sized(self, value: Any, name: str, size: int, what: str) -> Array:
        """Return an array of doubles (..., size); refuse another size."""
        array = self._numbers(value, name, what)
        if tuple(array.shape[-1:]) != (size,):
            raise LinkworkError(
                f"{name} of {what} has the shape {tuple(array.shape)}; its last dimension holds "
                f"{size} numbers"
            )
        return array

    def _together(self, *arrays: Array) -> list[Array]:
        """Return arrays with equal leading dimensions."""
        found = self._broadcast(arrays)
        if found is None:
            shapes = " and ".join(str(tuple(array.shape)) for array in arrays)
            raise LinkworkError(f"arrays of the shapes {shapes} do not fit together")
        return found

    def _door(self, name: str) -> Callable[..., Any]:
        """Return the function of a name, which takes and gives arrays in their shapes."""
        if name not in self._doors:
            of = self._offered[name]
            f, told = self._operator(of), results(name, of)

            def door(*given: Array, **named: Array) -> Any:
                own, p = arguments(name, of, given, named)
                sizes = [each for each in of.inputs if each[0] != "p"]
                arrays = [
                    self._sized(value, *each, name) for value, each in zip(own, sizes, strict=True)
                ]
                return told(f(*self._together(*arrays, *self._free(p, name))))

            door.__name__ = name
            self._doors[name] = door
        return self._doors[name]
