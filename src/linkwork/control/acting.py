"""What acts on a robot in a run, independent of charts: command, drives, wrenches and events in one
traced function.

    (t, r, h, z, p, quantities) -> command c, force u, z', wrenches, events g, next held inputs

r are commands and references over time, h inputs that a sampled controller holds, z the extra
states of drives and controller, p the parameters of both.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, is_dataclass, replace
from functools import cached_property
from itertools import product
from typing import Any

import casadi as ca
import numpy as np

from linkwork import checks
from linkwork.control.continued import Followed
from linkwork.control.drives import BOUNDED, Drive, Extra, Ideal
from linkwork.control.events import Event
from linkwork.control.observation import OF_CHARTS, Names, Quantity
from linkwork.control.records import ActingPart, described
from linkwork.control.sampler import Sampler
from linkwork.control.timely import Timely, timely
from linkwork.control.tracing import CONTROLLER, Law, Reference, Tracer, column, shown
from linkwork.control.wrenches import Wrench
from linkwork.errors import LinkworkError
from linkwork.kernels import Kernel
from linkwork.simulation import Sampled, Signal, as_signal, clock, stack
from linkwork.simulation.events import Watch

NONE = ca.SX(0, 1)
OUTPUTS = ("command", "force", "extra_rates", "wrenches", "events", "next_held")


@dataclass(frozen=True, eq=False)
class Acting:
    """Hold what acts, traced.

    function: (t, references, held, extras, parameters, *quantities) -> `OUTPUTS`
    quantities: what it reads of the robot; timed: whether it reads the time
    references: signals over time, after the commands where no controller gives these; extras: extra
        states of drives and the controller, then those of the robot's bristles, whose rates the
        equations give
    parameters: values by name
    bounds: kinds of the controller's numbers, by name
    followed: coordinates that have states of their own, behind the extras, which tell their turns
        (`continued`)
    """

    names: Names
    function: ca.Function
    quantities: tuple[Quantity, ...]
    timed: bool
    references: tuple[Reference, ...]
    extras: tuple[Extra, ...]
    parameters: Mapping[str, float]
    drives: tuple[Drive, ...]
    wrenches: tuple[Wrench, ...]
    events: tuple[Event, ...]
    sampler: Sampler | None
    bounds: Mapping[str, Any] = field(default_factory=dict)
    followed: Followed = ()

    @property
    def read(self) -> set[str]:
        """The joint coordinates that are read by what is traced."""
        return {quantity.name for quantity in self.quantities if quantity.kind == "position"}

    @property
    def charted(self) -> bool:
        """Whether what is read depends on the choice of independent rates."""
        return any(quantity.kind in OF_CHARTS for quantity in self.quantities)

    @cached_property
    def held(self) -> int:
        """Number of inputs that are held by a sampled controller."""
        return self.function.numel_in("held")

    def require(self, values: Mapping[str, np.ndarray]) -> None:
        """Refuse values of parameters by name, one or one for each member, that the controller or
        drive which they belong to may not have together."""
        for name, given in values.items():
            check = BOUNDED.get(self.bounds.get(name.partition(".")[0]), checks.number)
            for value in (given.min(), given.max()) if given.size else ():
                check(float(value), f"the controller's {name}")
        for actuator, drive in zip(self.names.actuators, self.drives, strict=True):
            named = {number: f"{actuator}.{number}" for number in drive.numbers}
            own = {number: values[name] for number, name in named.items() if name in values}
            if own and all(given.size for given in own.values()):
                with checks.at(f"the drive of {actuator!r}: "):
                    require_together(drive, own)

    @cached_property
    def bounded(self) -> tuple[tuple[str, Drive], ...]:
        """The drives that cannot start everywhere, with their actuators."""
        driven = zip(self.names.actuators, self.drives, strict=True)
        return tuple(
            (name, drive)
            for name, drive in driven
            if type(drive).require_start is not Drive.require_start
        )

    @cached_property
    def key(self) -> str:
        """What tells kernels of different systems apart."""
        places = [(wrench.body, tuple(wrench.point), wrench.frame) for wrench in self.wrenches]
        return hashlib.sha256(
            f"{self.function.serialize()}{self.quantities}{places}{self.followed}".encode()
        ).hexdigest()

    @cached_property
    def timely(self) -> Timely | None:
        """What depends on time alone in forces, wrenches and event functions, if anything does."""
        if not self.timed:
            return None
        symbols, outputs = self._outputs
        acting = ca.vertcat(
            *(outputs[name] for name in ("command", "force", "extra_rates", "wrenches"))
        )
        return timely(symbols["t"], symbols["parameters"], acting, outputs["events"])

    @cached_property
    def read_by_events(self) -> list[int]:
        """The columns of the integrator's inputs that event functions read, but for the time."""
        symbols, outputs = self._outputs
        found = {symbol.element_hash() for symbol in ca.symvar(outputs["events"])}
        references = ca.vertsplit(symbols["references"]) if symbols["references"].numel() else []
        return [
            int(self.timed) + i
            for i, symbol in enumerate(references)
            if symbol.element_hash() in found
        ]

    @cached_property
    def _outputs(self) -> tuple[dict[str, ca.SX], dict[str, ca.SX]]:
        """Symbols of the function's inputs, and its outputs in them, by name."""
        names = self.function.name_in()
        symbols = {name: ca.SX.sym(name, self.function.sparsity_in(name)) for name in names}
        return symbols, dict(zip(OUTPUTS, self.function.call([*symbols.values()]), strict=True))

    @property
    def events_over_time(self) -> bool:
        """Whether event functions read more of the time than the time itself."""
        return bool(self.read_by_events) or bool(self.timely and self.timely.events)

    def watch(
        self,
        inputs: Signal,
        kernel: Kernel | None,
        parameters: np.ndarray,
        span: tuple[float, float],
    ) -> Watch | None:
        """Return what no step may pass over within a span [s] beside the integrator's inputs, if
        there is anything.

        kernel: of what is `timely`.
        """
        scanned, strict = (
            self.timely.scanned(kernel, parameters, span) if self.timely and kernel else (None, 0)
        )
        columns = self.read_by_events if len(inputs.coefficients) > 1 else []
        if scanned is None and not columns:
            return None
        read = Signal(
            inputs.knots, np.ascontiguousarray(inputs.coefficients[:, :, columns]), inputs.breaks
        )
        return Watch(stack(inputs, *([scanned] if scanned else []), read), strict + len(columns))

    def inputs(self, commands: Signal | None) -> Signal:
        """Return the integrator's inputs over time: t where it is read, commands that no controller
        gives, references."""
        signals = [*([clock()] if self.timed else []), *([] if commands is None else [commands])]
        signals += [reference.signal for reference in self.references]
        return (
            signals[0]
            if len(signals) == 1
            else stack(*signals)
            if signals
            else as_signal(np.zeros(0))
        )


@dataclass(frozen=True)
class Command:
    """Hold the commands of the actuators, the rates of the controller's states, and inputs: those
    that are given over time, those that are held, now and next.
    """

    values: ca.SX
    rates: ca.SX = NONE
    given: ca.SX = NONE
    held: ca.SX = NONE
    next_held: ca.SX = NONE


def act(
    names: Names,
    law: Law | Sampler | None,
    drives: Mapping[str, Drive],
    wrenches: Sequence[Wrench],
    events: Sequence[Event],
    span: tuple[float, float],
) -> Acting:
    """Trace what acts on a robot.

    Args:
        names: the robot's.
        law: a controller, a function of (t, state) or one that is sampled; without one the commands
            are inputs over time.
        drives: by actuator; ideal where left out.
        wrenches, events: on bodies; to watch for.
        span: times of the run, at which traced functions are checked [s].

    Raises:
        LinkworkError: what does not fit, or cannot be traced, in one sentence.
    """
    # What acts is there to act on.
    require_law(names, law)
    require_drives(names, drives)
    require_bodies(names, wrenches)
    # One symbolic trace: extra states of drives first, then those of the controller, and bristles.
    of_drives = [
        x._replace(name=f"{name}.{x.name}") for name, drive in drives.items() for x in drive.extras
    ]
    own = states_of(law, names.actuators)
    extras = (*of_drives, *own, *bristles(names))
    tracer = Tracer(replace(names, extras=tuple(extra.name for extra in extras)))
    command = commanded(tracer, law, [extra.name for extra in own])
    force, rates = driven(tracer, command.values, drives)
    parts = [
        part(tracer, wrench, values)
        for wrench in wrenches
        for values in (wrench.moment, wrench.force)
    ]
    zeros = [watched(tracer, event) for event in events]
    # What was traced says the same as the functions themselves over the run's times.
    tracer.check(span)
    outputs = (
        command.values,
        force,
        ca.vertcat(rates, command.rates),
        ca.vertcat(NONE, *parts),
        ca.vertcat(NONE, *zeros),
        command.next_held,
    )
    # All of it as one function of time, state and parameters.
    sampler = law if isinstance(law, Sampler) else None
    function, quantities, timed = closed(tracer, command, outputs)
    return Acting(
        names=tracer.names,
        function=function,
        quantities=quantities,
        timed=timed or sampler is not None,
        references=tuple(tracer.references),
        extras=extras,
        parameters={name: value for name, (value, _) in tracer.parameters.items()},
        drives=tuple(drives.get(name, Ideal()) for name in names.actuators),
        wrenches=tuple(wrenches),
        events=tuple(events),
        sampler=sampler,
        bounds=bounds_of(law.function if isinstance(law, Sampler) else law),
    )


def bounds_of(law: Law | None) -> dict[str, Any]:
    """Return the kinds of a controller's described numbers by name, as `Positive`."""
    own = isinstance(law, ActingPart) and is_dataclass(law)
    return {name: of.kind for name, of in described(type(law)).items()} if own else {}


def require_together(drive: Drive, numbers: Mapping[str, np.ndarray]) -> None:
    """Refuse numbers of a drive by name, one or one for each member, that it may not have.

    What it may have is convex: the corners of the box about all members stand for them.
    """
    ends = [sorted({float(given.min()), float(given.max())}) for given in numbers.values()]
    try:
        for corner in product(*ends):
            replace(drive, **dict(zip(numbers, corner, strict=True)))
    except LinkworkError:
        if len(numbers) == 1:
            raise
        table = np.stack(np.broadcast_arrays(*map(np.atleast_1d, numbers.values())), axis=1)
        for row in np.unique(table, axis=0).tolist():
            replace(drive, **dict(zip(numbers, row, strict=True)))


def bristles(names: Names) -> tuple[Extra, ...]:
    """Return the states of the robot's bristles, which are straight at the start."""
    return tuple(Extra(name, of.unit, 0.0) for of in names.strains for name in of.names)


def require_law(names: Names, law: Law | Sampler | None) -> None:
    """Refuse a class in the place of a controller made by it, and a sampler of what the robot
    lacks."""
    if isinstance(law, type):
        raise LinkworkError(
            f"{CONTROLLER} is the class {law.__name__}; make one of it, {law.__name__}(...)"
        )
    if isinstance(law, Sampler):
        require_law(names, law.function)
        law.require(names)


def require_drives(names: Names, drives: Mapping[str, Drive]) -> None:
    """Refuse drives of what is no actuated coordinate, and what is no drive."""
    able = [actuator for actuator in names.actuators if actuator in names.measured]
    for name, drive in drives.items():
        checks.known([name], able, "actuator", " for a drive")
        if not isinstance(drive, Drive):
            raise LinkworkError(
                f"the drive of {name!r} is {drive!r}; give one of linkwork.control, such as "
                "DCMotor(...)"
            )


def require_bodies(names: Names, wrenches: Sequence[Wrench]) -> None:
    """Refuse wrenches on bodies that do not exist."""
    checks.known((wrench.body for wrench in wrenches), names.bodies, "body", " for a wrench")


def states_of(law: Law | Sampler | None, actuators: tuple[str, ...]) -> list[Extra]:
    """Return the states of a controller: its `extras`, or what `extras` gives for the actuators
    that it drives."""
    extras: Any = getattr(law, "extras", ())
    own: Any = extras(actuators) if callable(extras) else extras
    return [Extra(*extra) for extra in own]


def commanded(tracer: Tracer, law: Law | Sampler | None, states: Sequence[str]) -> Command:
    """Return commands that are given over time, those of a controller with the states named, or of
    a sampled one."""
    actuators, what = tracer.names.actuators, CONTROLLER
    if law is None:
        given = ca.SX.sym("command", len(actuators))
        return Command(given, given=given)
    if isinstance(law, Sampler):
        held = ca.SX.sym("held", len(actuators) * (law.late + 1))
        now = ca.vertcat(NONE, *ca.vertsplit(held)[: len(actuators)])
        later = ca.vertsplit(held)[len(actuators) :]
        if not law.compiled:
            return Command(now, held=held)
        newest = tracer.trace(law.law, lambda result: column(result, actuators, what), what)
        return Command(now, held=held, next_held=ca.vertcat(*later, newest))
    if not states:
        return Command(tracer.trace(law, lambda result: column(result, actuators, what), what))

    def both(result: Any) -> ca.SX:
        if not (isinstance(result, tuple) and len(result) == 2):
            raise LinkworkError(
                f"{what} returns {shown(result)}; give the forces, and the rates of "
                f"{', '.join(states)}"
            )
        return ca.vertcat(
            column(result[0], actuators, what), column(result[1], states, f"{CONTROLLER}'s states")
        )

    values = tracer.trace(law, both, what)
    return Command(values[: len(actuators)], values[len(actuators) :])


def driven(tracer: Tracer, command: ca.SX, drives: Mapping[str, Drive]) -> tuple[ca.SX, ca.SX]:
    """Return the actuators' forces and the rates of the drives' extra states."""
    forces, rates = list(ca.vertsplit(command)), []
    for name, drive in drives.items():
        numbers = {
            field: tracer.parameter(f"{name}.{field}", value)
            for field, value in drive.numbers.items()
        }
        symbolic = type(drive)(**{**vars(drive), **numbers})
        z = [tracer.state.extra(f"{name}.{extra.name}") for extra in drive.extras]
        i = tracer.names.actuators.index(name)
        forces[i], change = symbolic.equations(
            command[i], tracer.state[name], tracer.state.rate(name), z
        )
        rates += change
    return ca.vertcat(NONE, *forces), ca.vertcat(NONE, *rates)


def part(tracer: Tracer, wrench: Wrench, values: Any) -> ca.SX:
    """Return three components of a wrench: constant, over time, or traced."""
    axes, what = ("x", "y", "z"), f"the wrench on {wrench.body!r}"
    if not isinstance(values, Sampled | Signal):
        if callable(values):
            return tracer.trace(values, lambda result: column(result, axes, what), what)
        if not np.any(values):
            return column(values, axes, what)
    return column(tracer.reference(as_signal(values), what), axes, what)


def watched(tracer: Tracer, event: Event) -> ca.SX:
    """Return the number whose zeros are an event."""
    what = event.what
    return tracer.trace(event.function, lambda value: column(value, ("value",), what), what)


def closed(
    tracer: Tracer, command: Command, outputs: tuple[ca.SX, ...]
) -> tuple[ca.Function, tuple[Quantity, ...], bool]:
    """Return the function of the outputs, the quantities that they depend on, and whether they
    depend on time."""
    found = {symbol.element_hash() for symbol in ca.symvar(ca.veccat(*outputs))}

    def used(symbols: ca.SX) -> bool:
        return any(symbol.element_hash() in found for symbol in ca.vertsplit(symbols))

    quantities = {key: symbols for key, symbols in tracer.quantities.items() if used(symbols)}
    inputs = {
        "t": tracer.t,
        "references": ca.vertcat(
            command.given, *(reference.symbols for reference in tracer.references)
        ),
        "held": command.held,
        "extras": ca.vertcat(NONE, *tracer.extras.values()),
        "parameters": ca.vertcat(NONE, *(symbol for _, symbol in tracer.parameters.values())),
    }
    symbols = [*inputs.values(), *quantities.values()]
    labels = [*inputs, *(f"q{i}" for i in range(len(quantities)))]
    dense = [ca.densify(output) for output in outputs]
    return (
        ca.Function("acting", symbols, dense, labels, list(OUTPUTS)),
        tuple(quantities),
        used(tracer.t),
    )
