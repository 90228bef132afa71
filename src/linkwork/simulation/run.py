"""A `Run`: what a user holds after a simulation, with names and units, and its files."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike

from linkwork.checks import MOST, amount, count, file_path, finite, listed, shown, suggestion
from linkwork.errors import LinkworkError
from linkwork.notebooks import Portrayed
from linkwork.simulation.run_files import (
    TIME,
    read_netcdf,
    whole_or_nothing,
    write_csv,
    write_netcdf,
)
from linkwork.simulation.status import Status
from linkwork.simulation.variables import LazyAttribute, Variable, dataset_of

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

    from linkwork.model.state import State

NAME, DESCRIPTION, SINGULAR_TIMES = "mechanism", "description", "singular_times"
FINAL = "final_state"  # attributes of a file that begin so: positions, rates, q, names of rates
SMOOTH = 501  # samples that draw as smooth curves


@dataclass(frozen=True)
class Statistics:
    """Tell what a run took: evaluations of the equations of motion, steps, projections; and how
    well the loops closed.

    `closure_error`: the largest |phi(q)| of all accepted states and saved samples, in the units of
    the closure kernel; `pivot`: the smallest relative pivot met (1: well posed, 0: singular), at
    the time `pivot_time`, s.
    """

    nfev: int
    steps: int
    rejected: int
    projections: int
    closure_error: float
    pivot: float
    pivot_time: float


@dataclass(frozen=True, eq=False)
class Run(Portrayed):
    """Hold the result of a simulation: arrays over named axes, how it ended, and what it took.

    `variables`: quantities by name, for instance "position" over ("time", "joint"); `coords`: the
    axes' labels by axis name, among them "time" in s; `attrs`: facts about the run as a whole;
    `status`, `message`: how it ended; `statistics`: what it took, also reached as `nfev`, `steps`,
    `rejected`, `closure_error`; `error`: what a sampled controller raised, if that ended the run,
    and `transmitted`: what gives the joint reactions (not written to files); `errors`: what gives
    the differences to the run at a tenth of the tolerance, by name (not written to files);
    `described`: what gives the text of the mechanism's file, if the attrs do not hold it as
    "description"; `ended`: what gives the last state; `again`: what runs once more, saved at other
    times (not written to files); `every`: whether every accepted step was saved.

    Sent to another process (`pickle`), a run holds what its file would hold.
    """

    variables: Mapping[str, Variable] = field(repr=False)
    coords: Mapping[str, Variable] = field(repr=False)
    attrs: Mapping[str, Any]
    status: Status
    message: str = LazyAttribute()  # pyright: ignore[reportAssignmentType, reportGeneralTypeIssues]
    statistics: Statistics = LazyAttribute()  # noqa: RUF009  # pyright: ignore
    error: BaseException | None = None
    transmitted: Callable[[str, float | None], Any] | None = field(default=None, repr=False)
    described: Callable[[], str] | None = field(default=None, repr=False)
    errors: Callable[[], Mapping[str, Variable]] | None = field(default=None, repr=False)
    ended: Callable[[], "State"] | None = field(default=None, repr=False)
    again: Callable[[int | np.ndarray | None], Self] | None = field(default=None, repr=False)
    every: bool = field(default=False, repr=False)

    def __getstate__(self) -> dict[str, Any]:
        """Return what a file of the run would hold, and what ended it."""
        told = {DESCRIPTION: self.description} if self.description else {}
        known = {
            "variables": dict(self.variables),
            "coords": dict(self.coords),
            "attrs": dict(self.attrs) | told,
        }
        for name in ("status", "message", "statistics", "error"):
            known[name] = getattr(self, name)
        if self.ended is not None or "final" in vars(self):
            known["final"] = self.final
        return known | {each.name: each.default for each in fields(self) if each.name not in known}

    def __repr__(self) -> str:
        of = f"{self.attrs[NAME]!r}, " if NAME in self.attrs else ""
        end = f" until t = {self.time[-1]:.6g} s" if len(self.time) else ""
        samples = f"{amount(self.steps, 'step')}, {amount(len(self.time), 'sample')}{end}"
        error = f", error={self.error!r}" if self.error is not None else ""
        return f"Run({of}{self.status.name}, {samples}{error})"

    @property
    def success(self) -> bool:
        """Tell whether the run reached its end."""
        return self.status is Status.FINISHED

    @property
    def time(self) -> np.ndarray:
        """Return the saved times (K,) [s]."""
        return self.coords[TIME].values

    def __getitem__(self, quantity: str) -> "xarray.DataArray":
        """Return one quantity by name, such as "joint_position", over its named axes; no other is
        computed for it."""
        if not isinstance(quantity, str) or quantity not in self.variables:
            near = suggestion(quantity, self.variables) if isinstance(quantity, str) else ""
            raise LinkworkError(
                f"the run holds no {shown(quantity)}{near}; it holds {', '.join(self.variables)}"
            )
        variable = self.variables[quantity]
        coords = {axis: self.coords[axis] for axis in variable.dims if axis in self.coords}
        return dataset_of({quantity: variable}, coords, {})[quantity]

    @cached_property
    def final(self) -> "State":
        """Return the last state reached, from which another run may start; in the robot's own
        independent rates where these tell its motion, else in those that the run ended in.

        Raises:
            LinkworkError: a run from a file that does not hold it.
        """
        if self.ended is None:
            raise LinkworkError(
                "the file of this run does not hold its last state; robot.resume(run, ...) goes on "
                "from it"
            )
        return self.ended()

    def resampled(self, samples: int | ArrayLike = SMOOTH) -> Self:
        """Return the same run saved at other times: it is run once more, in the same steps, and
        read off between them.

        Args:
            samples: number of equally spaced times from start to end; or the times [s].

        Raises:
            LinkworkError: a run from a file, or that a Python function controls: neither can be run
                again.
        """
        if self.again is None:
            raise LinkworkError(
                "this run cannot be run again at other times: it was read from a file, or a Python "
                "function controls it; give samples or save_at to robot.simulate"
            )
        if isinstance(samples, list | tuple) or np.ndim(samples):
            return self.again(np.atleast_1d(finite(samples, "the times")))
        if (number := count(samples, "samples", MOST)) < 2:
            raise LinkworkError("samples is 1; give at least 2, the first and the last")
        return self.again(number)

    @cached_property
    def smooth(self) -> Self:
        """Return the run as pictures draw it: where every step was saved, and few were taken,
        resampled between them too."""
        few = self.every and 1 < len(self.time) < SMOOTH
        if not few or self.again is None or self.status is Status.CANCELLED:
            return self
        between = np.linspace(self.time[0], self.time[-1], SMOOTH)
        return self.again(np.union1d(self.time, between))

    @property
    def nfev(self) -> int:
        """Return the number of evaluations of the equations of motion."""
        return self.statistics.nfev

    @property
    def steps(self) -> int:
        """Return the number of accepted steps."""
        return self.statistics.steps

    @property
    def rejected(self) -> int:
        """Return the number of rejected steps."""
        return self.statistics.rejected

    @property
    def closure_error(self) -> float:
        """Return the largest |phi(q)| of all accepted states and saved samples."""
        return self.statistics.closure_error

    @property
    def singular_times(self) -> np.ndarray:
        """Return when singular poses were stepped over (on_singular="step_over") [s]."""
        return np.atleast_1d(np.asarray(self.attrs.get(SINGULAR_TIMES, ()), float))

    @property
    def error_estimate(self) -> float:
        """Return the largest error of coordinates, rates and extra states, relative to atol + rtol
        |y|: estimated.

        It is found by a second run at a tenth of the tolerance (half of the step) when it, or the
        message, is first asked for; a resumed run's counts from where it was resumed. nan where a
        Python function controls the robot, which cannot be called again, and for runs that do not
        tell. `attrs["error_estimate_until"]`: the time that the second run came to.
        """
        return float(self.attrs.get("error_estimate", np.nan))

    @cached_property
    def global_errors(self) -> "xarray.Dataset":
        """Return the errors of joint positions and rates, and drive states, at the saved times, as
        an `xarray.Dataset`.

        They are the differences to the same run at a tenth of the tolerance (half of the step),
        which is run when they are first asked for; nan from where that ended early.

        Raises:
            LinkworkError: a run from a file, or that a Python function controls: neither can be run
                again.
        """
        if self.errors is None:
            raise LinkworkError(
                "this run cannot be run again to find its errors: it was read from a file, or a "
                "Python function controls it"
            )
        found = self.errors()
        axes = {axis for variable in found.values() for axis in variable.dims}
        coords = {
            axis: replace(self.coords[axis], attrs={}) for axis in self.coords if axis in axes
        }
        return dataset_of(found, coords, {})

    @property
    def description(self) -> str:
        """Return the mechanism that ran, as the text of a mechanism file; empty if the run does not
        hold it."""
        return self.described() if self.described else str(self.attrs.get(DESCRIPTION, ""))

    @cached_property
    def dataset(self) -> "xarray.Dataset":
        """Return the run as an `xarray.Dataset`; its attributes hold the status, the message and
        the statistics. Its arrays are the run's own, read-only: write into a deep copy of it."""
        ending = {"status": self.status.name, "message": self.message}
        attrs = dict(self.attrs) | ending | vars(self.statistics)
        return dataset_of(self.variables, self.coords, attrs)

    def reactions(
        self, frame: str = "ground", *, length: float | None = None
    ) -> "xarray.DataArray":
        """Return the wrench that each joint transmits to its second body over time, as
        `linkwork.Robot.reactions` does.

        It is computed when it is asked for, and is no part of `dataset`.

        Args:
            frame: "ground", "first" or "second"; length: [m] by which moments are divided where
                least wrenches are chosen.

        Returns:
            An array over (time, joint, component) [N m, N]; its attribute `indeterminate` names the
            components, by joint, that rigid bodies leave open.

        Raises:
            LinkworkError: another frame; a run from a file, which does not hold its robot.
        """
        import xarray

        if self.transmitted is None:
            raise LinkworkError(
                "a run from a file does not hold its robot; ask robot.reactions(state, forces) "
                "instead"
            )
        found = self.transmitted(frame, length)
        coords = {
            TIME: self.coords[TIME].values,
            "joint": list(found.joints),
            "component": list(found.components),
        }
        open_parts = "; ".join(
            f"{joint}: {', '.join(parts)}" for joint, parts in found.indeterminate.items()
        )
        attrs = {
            "units": "N m, N",
            "frame": frame,
            "indeterminate": open_parts,
            "length": found.length,
        }
        return xarray.DataArray(
            found.wrenches, coords, (TIME, "joint", "component"), "joint_reaction", attrs
        )

    def sensitivity(
        self, quantities: Sequence[str] | str | None = None, to: Sequence[str] | str | None = None
    ) -> "xarray.Dataset":
        """Return how what was recorded changes with the numbers that determine the run.

        Tangents are led along the steps that the run took, their sizes held. Where an event ended
        the run, the last values are those at the event, whose time changes too.

        Args:
            quantities: by name, such as "tool_pose"; all that can be differentiated if left out;
                "event_time", when events happened; "work" and "conditioning" where they are named.
            to: names of numbers, "rates.slide_1", or of groups of them: "positions", "rates",
                "states", "forces", "parameters"; all if left out. They are those of
                `linkwork.Robot.gradient`. Where the forces are `linkwork.Sampled`, "samples", or
                "samples.slide_1.3", are their values [N, N m], row by row from 0.

        Returns:
            A dataset of d quantity / d number, over the quantity's own axes and "number".

        Raises:
            LinkworkError: names that there are not; a run that was read from a file, or with what
                has no derivative; steps that let motions beside the run grow.

        Warns:
            ModelWarning: explicit steps that are long for motions beside the run.
        """
        from linkwork.gradients.sensitivities import sensitivity

        return sensitivity(self, quantities, to)

    def gradient(
        self, weights: Mapping[str, ArrayLike], to: Sequence[str] | str | None = None
    ) -> dict[str, float]:
        """Return the derivatives of  sum of weights times recorded values  by the numbers that
        determine the run: of one number by many, by the adjoint method.

        Args:
            weights: by quantity, an array as it was recorded: the derivatives of a loss with
                respect to what was recorded.
            to: as for `sensitivity`.

        Raises:
            LinkworkError: as `sensitivity`; weights of another shape.
        """
        from linkwork.gradients.sensitivities import pulled_back

        return pulled_back(self, weights, to)

    def plot(self, quantities: Sequence[str] | None = None) -> "Figure":
        """Draw the run's quantities over time (`linkwork.views.plot_run`), in smooth curves: those
        named, or all that vary with time."""
        from linkwork.views.plots import plot_run  # a convenience, which asks a later stage

        return plot_run(self, quantities)

    def save(self, path: str | Path) -> Path:
        """Write the run to a file, whole or not at all, and return its path; the suffix names the
        format.

        .nc: NetCDF (version 3), everything the run holds and its mechanism; `Run.load` reads it.
        .csv: one row for each saved time, one column for each component of what varies with time,
        named quantity.joint; units, constants and the ending stand above in lines that begin with
        #.

        Raises `LinkworkError` for another suffix, or where the file cannot be written.
        """
        path = file_path(path, "the path to save to")
        write = _WRITERS.get(path.suffix.lower())
        if write is None:
            raise LinkworkError(
                f"cannot save a run as {path.name!r}: its suffix must be one of "
                f"{', '.join(_WRITERS)}, not {path.suffix!r}"
            )
        with whole_or_nothing(path) as part:
            write(self, part)
        return path

    @property
    def _told_to_files(self) -> dict[str, Any]:
        """What a file holds beside the dataset: the mechanism, and the last state."""
        told: dict[str, Any] = {DESCRIPTION: self.description} if self.description else {}
        if self.ended is not None or "final" in vars(self):
            last, names = self.final, ", ".join(self.final.independent)
            found = {"positions": last.positions, "rates": last.rates, "q": last.q, "names": names}
            told |= {f"{FINAL}_{name}": value for name, value in found.items()}
        return told

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a run that `save` wrote as .nc; raise `LinkworkError` if the file is missing or
        holds no run.

        path: of the file, which ends in .nc.
        """
        path = file_path(path, "the path of a run")
        variables, coords, attrs = read_netcdf(path)
        try:
            status, message = Status[str(attrs.pop("status"))], str(attrs.pop("message"))
            statistics = Statistics(
                **{
                    field.name: np.asarray(attrs.pop(field.name)).item()
                    for field in fields(Statistics)
                }
            )
        except KeyError as error:
            raise LinkworkError(
                f"cannot read a run from '{path}': its attribute {error} is missing or unknown"
            ) from error
        last = _final_state(attrs, coords)
        ended = None if last is None else lambda: last
        return cls(variables, coords, attrs, status, message, statistics, ended=ended)


def _final_state(attrs: dict[str, Any], coords: Mapping[str, Variable]) -> "State | None":
    """Take the last state out of the attributes of a file, if they hold it."""
    from linkwork.model.state import State  # what a file holds of a robot's state

    if f"{FINAL}_q" not in attrs:
        return None
    positions, rates, q = (
        np.atleast_1d(np.asarray(attrs.pop(f"{FINAL}_{name}"), float))
        for name in ("positions", "rates", "q")
    )
    names = listed(str(attrs.pop(f"{FINAL}_names")), map(str, coords["rate"].values))
    labels = tuple(map(str, coords["coordinate"].values))
    return State.known(positions, rates, q, labels, names)


_WRITERS: dict[str, Callable[[Run, Path], None]] = {
    ".nc": lambda run, path: write_netcdf(path, run.dataset, run._told_to_files),
    ".csv": lambda run, path: write_csv(path, run.message, run.variables, run.coords),
}
