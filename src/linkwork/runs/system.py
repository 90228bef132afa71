"""Systems: what is integrated in a run. A robot under plain forces, or joined with controllers,
drives and wrenches.

The state is y = (q, v, z) in a chart of the robot; z, the extra states of drives and controllers,
is the same in all charts.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from linkwork.checks import amount, by_name, several
from linkwork.control.acting import Acting
from linkwork.control.continued import Followed
from linkwork.control.drives import Drive, Extra
from linkwork.control.events import Event
from linkwork.control.joined import DIRECTION, Joined
from linkwork.control.kept_traces import acting_once
from linkwork.control.sampler import Sampler
from linkwork.control.wrenches import Wrench
from linkwork.errors import LinkworkError
from linkwork.kernels import Kernel
from linkwork.kernels.bound import BoundFunction
from linkwork.model import checks
from linkwork.model.charts import BUILDING, CompiledChart
from linkwork.runs.sampled_calls import Callback
from linkwork.simulation import Condition, Control, Events, Sampled, Signal, as_signal
from linkwork.simulation.admission import require_cover
from linkwork.simulation.events import Watch

if TYPE_CHECKING:
    from linkwork.model.model import Model
    from linkwork.model.state import State

Forces = ArrayLike | Mapping[str, float] | Sampled | Signal | Sampler | Callable[..., Any] | None
FREED = " (robot.free makes one of a number of the robot)"
FREE = 1e300  # absolute tolerance of numbers that may err
GIVEN = Sampled, Signal  # forces that are given over time
NONE = np.empty(0)  # further states


@dataclass(frozen=True, eq=False)
class System:
    """Give the kernels of a run in any chart.

    inputs: u over time, of the integrator; acting: what acts, None for plain forces
    parameters: values of the parameters of controllers and drives, in the order of
        `acting.parameters`
    faults: what a sampled function raised
    samples: of forces or commands, where these are given by samples
    """

    inputs: Signal
    acting: Acting | None = None
    parameters: np.ndarray = field(default_factory=lambda: np.empty(0))
    faults: list[BaseException] = field(default_factory=list)
    samples: Sampled | None = None

    @cached_property
    def extras(self) -> tuple[Extra, ...]:
        """The extra states of drives and controllers."""
        return self.acting.extras if self.acting else ()

    @cached_property
    def states(self) -> tuple[Extra, ...]:
        """All states z beside the robot's: the extra ones, then those that tell the turns of joints
        that are read."""
        followed = [name for names in self.acting.followed for name in names] if self.acting else ()
        return (*self.extras, *(Extra(name, "rad", 0.0) for name in followed))

    @cached_property
    def initial(self) -> np.ndarray:
        """The extra states with which drives and controllers begin (nz)."""
        return np.array([extra.initial for extra in self.extras], float) if self.extras else NONE

    @property
    def events(self) -> tuple[Event, ...]:
        """The events to watch for."""
        return self.acting.events if self.acting else ()

    @cached_property
    def sampler(self) -> Sampler | None:
        """The sampled controller, if there is one."""
        return self.acting.sampler if self.acting else None

    def start(
        self, robot: Model, positions: np.ndarray, q: np.ndarray, extras: ArrayLike | None = None
    ) -> np.ndarray:
        """Return z (..., nz) where runs start.

        Args:
            positions: of all joints (..., m), of which the turns count; q: (..., nq).
            extras: the extra states there; their own if left out.
        """
        own = self.initial if extras is None else np.asarray(extras, float)
        if self.acting is None or not self.acting.followed:
            return own
        read = robot.kernel("positions")(q)[0]
        seen = robot.labels.nearest(read, np.broadcast_to(positions, read.shape))
        places = [robot.coordinates.index(state.name) for state in self.states[len(self.extras) :]]
        return np.concatenate(
            [np.broadcast_to(own, (*seen.shape[:-1], own.size)), seen[..., places]], axis=-1
        )

    def tolerances(self, chart: CompiledChart, rtol: float, atol: float, size: int) -> np.ndarray:
        """Return rtol and atol (2, size) of the numbers of a state (q, v, z) of some size.

        States that tell turns do not count, nor in the root mean square of errors: steps are those
        without them.
        """
        followed, table = len(self.states) - len(self.extras), chart.tolerances(rtol, atol, size)
        if followed:
            table = np.sqrt((size - followed) / size) * table
            table[1, -followed:] = FREE
        return table

    def p(self, chart: CompiledChart) -> np.ndarray:
        """Return the parameters of the mechanism, then those of controllers and drives."""
        return np.concatenate((chart.p, self.parameters)) if self.parameters.size else chart.p

    def kernel(self, chart: CompiledChart, name: str) -> Kernel:
        """Return a kernel of `Joined` in a chart: motion, derivative, events, held ..."""
        if self.acting is None:
            return chart.kernel(name)
        return chart.compiled(
            f"{self.acting.key} {name}", lambda _: getattr(self.joined(chart), name)()
        )

    def single(self, chart: CompiledChart, name: str) -> Kernel | BoundFunction:
        """Return what evaluates one state: motion, events or held of `Joined`; the kernel, or a
        table in charts of which these are told by tables."""
        if self.acting is None:
            return chart.single(name)
        return self.by_table(chart, name) if self.told(chart) else self.kernel(chart, name)

    def by_table(self, chart: CompiledChart, name: str, wide: bool = False) -> BoundFunction:
        """Return what evaluates one state, or states side by side, by a table, however often the
        chart was used."""
        if self.acting is None:
            return chart.by_table(name, None, wide)
        entry, asked = ("motion", "balance") if name == "motion" else ("seen", name)
        return chart.by_table(entry, self.kernel(chart.free, asked), wide)

    def side_by_side(self, chart: CompiledChart, name: str, states: int) -> int:
        """Return the address of what evaluates states side by side, motion or events: a kernel, or
        a table in charts of which these are told by tables when so many states are evaluated."""
        if self.told(chart, states):
            return self.by_table(chart, name, wide=True).address
        return self.kernel(chart, name).wide_address

    def told(self, chart: CompiledChart, states: int = 1) -> bool:
        """Whether a table tells the chart when so many states are evaluated one by one."""
        return chart.told(states) and not (self.acting and self.acting.charted)

    def motion(self, chart: CompiledChart) -> int:
        """Return the address of void(const double *in, double *out): y' and the pivot."""
        return self.single(chart, "motion").early_address

    def slopes(self, chart: CompiledChart) -> BoundFunction:
        """Return df/dy and df/dr by a table, from derivatives that all charts share."""
        balance, slopes = (self.kernel(chart.free, name) for name in ("balance", "slopes"))
        return chart.slopes_by_table(balance, slopes)

    def jacobian(self, chart: CompiledChart) -> int:
        """Return the address of void(const double *in, double *out): df/dy and df/dr by columns."""
        if chart.sloped and not (self.acting and self.acting.charted):
            return self.slopes(chart).address
        kernel = self.kernel(chart, "derivative")
        directed, _ = kernel.inputs[-1]
        return kernel.columns_address if directed == DIRECTION else kernel.address

    def control(self, chart: CompiledChart, before: Control | None = None) -> Control | None:
        """Return the sampled controller in a chart, if there is one.

        before: the same in another chart: what it holds and its next sample are taken over
        """
        if self.acting is None or self.sampler is None:
            return None
        if self.sampler.compiled:
            address = self.single(chart, "held").early_address
        else:
            address = self._callback(chart).address
        if before is not None:
            return replace(before, address=address)
        return Control(address, self.sampler.period, np.zeros(self.acting.held))

    def conditions(self, chart: CompiledChart, watching: bool = True) -> Events | None:
        """Return the events in a chart, if there are any; watching: whether those count at which no
        step ends, too."""
        if not any(watching or event.cuts for event in self.events):
            return None
        conditions = tuple(
            Condition(e.terminal and watching, e.direction, e.cuts, e.borne, e.meets)
            for e in self.events
        )
        return Events(self.single(chart, "events").early_address, conditions)

    def watch(self, chart: CompiledChart, span: tuple[float, float]) -> Watch | None:
        """Return what no step may pass over within a span [s] beside the inputs, if there is
        anything; any chart will do."""
        if self.acting is None:
            return None
        timely, kernel = self.acting.timely, None
        if timely is not None:
            kernel = chart.compiled(f"{self.acting.key} timely", lambda _: timely.function)
        return self.acting.watch(self.inputs, kernel, self.parameters, span)

    @cached_property
    def joined(self) -> Callable[[CompiledChart], Joined]:
        """Join a chart's equations with what acts."""
        acting = self.acting
        assert acting is not None
        return lru_cache(maxsize=None)(lambda chart: Joined.of(chart.equations, acting))

    @cached_property
    def _callback(self) -> Callable[[CompiledChart], Callback]:
        acting, signals = self.acting, self.inputs.coefficients.shape[2]
        assert acting is not None
        held = self.states, len(self.extras), signals, self.parameters, self.faults
        return lru_cache(maxsize=None)(lambda chart: Callback(chart, acting, *held))


def system(
    robot: Model,
    forces: Forces,
    drives: Mapping[str, Drive] | None,
    wrenches: Sequence[Wrench],
    events: Sequence[Event],
    parameters: Mapping[str, float],
    span: tuple[float, float],
    joined: bool = False,
    state: State | None = None,
) -> System:
    """Make the system of a run; refuse what does not fit.

    Args:
        robot: the robot.
        forces: zero, constant, by name, over time, or a controller.
        drives: by actuator; wrenches on bodies; events to watch for.
        parameters: values of parameters of controllers and drives, by name.
        span: start and end of the run [s].
        joined: whether kernels of `Joined` are needed for plain forces, too.
        state: one or many, from which runs start; home if left out.
    """
    # Forces over time alone need no kernels of their own.
    drives = {} if drives is None else by_name(drives, "drives", "{'slide_1': Lag(0.01)}")
    if not isinstance(wrenches, tuple) or wrenches:
        wrenches = several(wrenches, Wrench, "wrenches")
    acts = isinstance(forces, Sampler) or (callable(forces) and not isinstance(forces, GIVEN))
    joined = joined or robot.rubs
    if not (acts or drives or wrenches or events or joined or robot.names.strains):
        if parameters:
            checks.known(parameters, (), "parameter", FREED)
        return plain(robot, forces)
    # What acts, traced once, with the coordinates whose whole turns it reads as extra states.
    given: Any = forces if acts else None
    commands = None if acts else plain(robot, forces)
    names = robot.names
    with BUILDING:
        acting = acting_once(names, given, drives, wrenches, tuple(events), span)
    followed = followed_by(robot, acting, state)
    acting = replace(acting, followed=followed) if followed else acting
    for signal, _, what in acting.references:
        require_cover(f"{what} reads a signal", signal, *span)
    # Its parameters: none is called as one of the mechanism, and all may have their values.
    for name in acting.parameters:
        if name in robot.parameters:
            raise LinkworkError(
                f"the parameter {name!r} of what acts has the name of a free number of the "
                "mechanism, so that neither can be told from the other; give it another name"
            )
    checks.known(parameters, tuple(acting.parameters), "parameter", FREED)
    values = {**acting.parameters} | {
        name: checks.number(value, name) for name, value in parameters.items()
    }
    acting.require({name: np.array(values[name]) for name in parameters})
    numbers = np.array([float(value) for value in values.values()])
    if commands is None:
        return System(acting.inputs(None), acting, numbers)
    return System(acting.inputs(commands.inputs), acting, numbers, samples=commands.samples)


def followed_by(robot: Model, acting: Acting, state: State | None) -> Followed:
    """Return the coordinates whose turns runs follow for what acts: of those that it reads, those
    that jump or begin turned.

    What a Python function reads is not known beforehand.
    """
    labels, names = robot.labels, robot.coordinates
    if not labels.may_wind:
        return ()
    every = acting.sampler is not None and not acting.sampler.compiled
    read = {
        name
        for i, name in enumerate(names)
        if (labels.wound[i] or labels.signed[i]) and (every or name in acting.read)
    }
    if not read:
        return ()
    begun = np.zeros(len(names))
    if state is not None:
        begun = np.abs(robot.windings(state)).reshape(-1, len(names)).max(axis=0)
    jumps = [
        labels.wound[i] and (begun[i] or name in labels.jumping) for i, name in enumerate(names)
    ]
    angles = [(name,) for name, jump in zip(names, jumps, strict=True) if jump and name in read]
    quaternions = [tuple(names[i] for i in places) for places in labels.quaternions]
    return (*angles, *(own for own in quaternions if read & set(own)))


def with_jacobian(robot: Model, runs: System) -> System:
    """Return a system whose kernels are those of `Joined`, of which one is the Jacobian; inputs and
    parameters are the same."""
    return runs if runs.acting else replace(runs, acting=robot.once(alone))


def alone(robot: Model) -> Acting:
    """Return the acting of nothing on a robot, at whatever times."""
    with BUILDING:
        return acting_once(robot.names, None, {}, (), (), (0.0, 0.0))


def require_starts(runs: System, state: State, parameters: np.ndarray) -> None:
    """Refuse states (...) in which a drive cannot start; parameters: of what acts, alike or of
    each (N, np)."""
    acting = runs.acting
    if acting is None or not acting.bounded:
        return
    values = dict(zip(acting.parameters, parameters.T, strict=True))
    for name, drive in acting.bounded:
        if name in state.coordinates:
            own = [values[f"{name}.{number}"] for number in drive.numbers]
            table = np.stack(np.broadcast_arrays(state[name], *own)).reshape(len(own) + 1, -1)
            with checks.at(f"the drive of {name!r}: "):
                for x, *numbers in np.unique(table, axis=1).T.tolist():
                    made = replace(drive, **dict(zip(drive.numbers, numbers, strict=True)))
                    made.require_start(x)


def plain(robot: Model, forces: Any) -> System:
    """Return the system under actuator forces: zero, constant, by name, or sampled."""
    n = len(robot.actuators)
    if not isinstance(forces, GIVEN):
        u = np.zeros(n) if forces is None else checks.actuator_forces(forces, robot.actuators)
        if u.ndim > 1:
            checks.finite(u, "forces")
            raise LinkworkError(
                f"forces has shape {u.shape}; give {amount(n, 'number')}: "
                f"{', '.join(robot.actuators)}, or linkwork.Sampled ones"
            )
        return steady(u.tobytes())
    signal = as_signal(forces)
    checks.in_order(forces, robot.actuators, "the forces")
    if signal.coefficients.shape[2] != n:
        raise LinkworkError(
            f"the forces have {signal.coefficients.shape[2]} columns; give {n}: "
            f"{', '.join(robot.actuators)}"
        )
    return System(signal, samples=forces if isinstance(forces, Sampled) else None)


@lru_cache(maxsize=256)
def steady(forces: bytes) -> System:
    """Return the system under constant forces, told by their bytes."""
    return System(as_signal(checks.finite(np.frombuffer(forces), "forces")))
