"""What a robot does over time: runs, ensembles of runs, steps."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from linkwork.model import checks
from linkwork.model.state import State
from linkwork.robot.dynamics import Dynamics
from linkwork.runs.settings import settings_of

if TYPE_CHECKING:
    from linkwork.control import Drive, Event, Observation, Wrench
    from linkwork.gradients.losses import LossGradient
    from linkwork.runs.ensemble import Ensemble
    from linkwork.runs.running import Forces
    from linkwork.simulation import MethodName, Run, Sampled, Signal


class Simulated(Dynamics):
    """Simulate the motion of a robot: methods of `Robot`."""

    def simulate(
        self,
        state: State,
        forces: Forces = None,
        *,
        duration: float,
        drives: Mapping[str, Drive] | None = None,
        wrenches: Sequence[Wrench] = (),
        method: MethodName | None = None,
        step: float | None = None,
        events: Sequence[Event | Callable[..., Any] | str] | str = (),
        parameters: Mapping[str, float] | None = None,
        rtol: float = 1e-8,
        atol: float = 1e-10,
        save_at: ArrayLike | None = None,
        samples: int | None = None,
        max_step: float = np.inf,
        max_steps: int = 1_000_000,
        on_singular: Literal["stop", "step_over"] = "stop",
    ) -> Run:
        """Integrate the equations of motion from a state (paper, algorithm of forward dynamics).

        After each step the loops are closed exactly by projection on phi = 0. Where the independent
        rates become a weak choice the run goes on in better ones. Where no rates determine the
        motion (a bifurcation: branches of motion meet) it stops, or steps over to the smooth
        continuation.

        Args:
            state: where to start.
            forces: u of the actuators [N, N m]: zero, constant, by name, or sampled over time
                (`linkwork.Sampled`); a controller (t, state) -> u, which is traced with symbols and
                compiled in (`linkwork.control`); or a `linkwork.control.Sampler`, which calls one
                at a fixed rate. With drives these are their commands.
            duration: T [s].
            drives: of actuators, by name (`linkwork.control.DCMotor` ...); ideal ones where left
                out.
            wrenches: external ones on bodies (`linkwork.control.Wrench`).
            method: "sharp_smart" (7th order), "dormand_prince" (5th), "dop853" (8th, for the
                tightest tolerances), "rodas" (for stiff systems); with a fixed step "rk4",
                "symplectic_euler". If left out: "sharp_smart" for rtol <= 1e-6 without sampled
                forces or controllers, whose kinks "dormand_prince" bears better; and "rodas" from
                where the run is stiff, as where dry friction brings bodies to rest, and where its
                steps pay.
            step: of the methods with a fixed step [s]; they see their inputs at their own times
                only, other methods step over nothing that varies in them.
            events: to watch for (`linkwork.control.Event`); "limits" and "singular": the run ends
                where a joint leaves its range, or where the actuators cease to determine the
                motion. An event happens when its function reaches
                zero: one that is zero at the start happens when it comes back to zero.
            parameters: values of free parameters by name, the robot's and those of controllers and
                drives.
            rtol, atol: relative and absolute tolerance of the local error of coordinates and rates;
                of lengths atol is a part of the mechanism's own length
                (`linkwork.equations.lengths`).
            save_at: times to save [s]; every accepted step if left out (`Run.resampled` gives the
                same run at other times).
            samples: number of equally spaced times to save instead, from start to end.
            max_step: largest step [s].
            max_steps: most steps to take.
            on_singular: "stop" at a bifurcation, or "step_over": go on along the smooth branch,
                where there is one, and no controller is sampled; the run's `singular_times` tell
                when.

        Returns:
            A `Run`: its `status` and `message` say how it ended; `dataset` holds what was computed
                until then.

        Raises:
            LinkworkError: bad input, in one sentence.
        """
        from linkwork.runs.running import simulate

        settings = settings_of(
            duration=duration,
            method=method,
            step=step,
            events=events,
            rtol=rtol,
            atol=atol,
            save_at=save_at,
            samples=samples,
            max_step=max_step,
            max_steps=max_steps,
            on_singular=on_singular,
        )
        return simulate(
            self, state, forces, settings, drives=drives, wrenches=wrenches, parameters=parameters
        )

    def resume(self, run: Run, forces: Forces = None, *, duration: float, **options: Any) -> Run:
        """Go on from the end of a run, also of one that was saved and loaded: time, extra and held
        inputs continue. Chosen steps of a run in one need not end there: both agree to their
        errors, and bit for bit where a step of fixed length ends there.

        Args:
            run: of this robot.
            duration: how long to go on [s].
            forces, options: as for `simulate`; a run does not hold controllers, drives and
                wrenches: give them again, a sampled controller with the delay that it had.
                Parameters of the robot keep the values that they had in the run, unless
                `parameters` gives others.

        Raises:
            LinkworkError: as `simulate`; options that it has not; what does not fit the run.
        """
        from linkwork.runs import resuming

        checks.known(options, OPTIONS, "option of a run")
        acting = {name: options.pop(name) for name in ACTING & options.keys()}
        return resuming.resume(
            self, run, forces, resuming.Settings(duration=duration, **options), **acting
        )

    def ensemble(
        self,
        states: State,
        forces: Forces | Sequence[Sampled | Signal] = None,
        parameters: Mapping[str, ArrayLike] | None = None,
        *,
        duration: float,
        drives: Mapping[str, Drive] | None = None,
        wrenches: Sequence[Wrench] = (),
        method: MethodName | None = None,
        step: float | None = None,
        events: Sequence[Event | Callable[..., Any] | str] | str = (),
        save_at: ArrayLike | None = None,
        samples: int | None = None,
        rtol: float = 1e-8,
        atol: float = 1e-10,
        max_step: float = np.inf,
        max_steps: int = 1_000_000,
        on_singular: Literal["stop", "step_over"] = "stop",
        threads: int | None = None,
        progress: bool | Callable[[int, int], None] = False,
    ) -> Ensemble:
        """Run N members at a time, as `simulate` runs each of them, over all threads.

        By the explicit methods that choose their steps, many members share a vector register, from
        chart to chart, events and contacts included. Other methods, events that read what is given
        over time and a `Sampler` take more time: then members run one by one, and those that a
        Python function controls on one thread, in their order. A method that is left out is chosen
        as for `simulate`, one for all.

        A member that fails keeps its status and the state it reached, and the others go on.
        KeyboardInterrupt ends the runs, and what is done is returned; the status of the others is
        CANCELLED. It is raised where nothing was left to end.

        Args:
            states: where members start, a stack of N states, or one for all.
            forces: for all members as for `simulate`; or of each: numbers (N, nu), (N) by name, or
                N signals.
            parameters: values of free parameters of the robot, controllers and drives by name:
                numbers, or (N) of each.
            duration: T [s].
            save_at: times to save [s], the same for all; only the last states are kept if left out.
            samples: number of equally spaced times to save instead, from start to end.
            threads: all processors if left out.
            progress: show a bar on the terminal, or call a function of (members done, N).
            drives, wrenches, method, step, events, rtol, atol, max_step, max_steps, on_singular: as
            for `simulate`.

        Returns:
            An `Ensemble`: `status` and `final` states of the members, `failed` ones, their `events`
                and their `dataset`.

        Raises:
            LinkworkError: bad input, in one sentence.
        """
        from linkwork.runs.ensemble import ensemble

        settings = settings_of(
            duration=duration,
            method=method,
            step=step,
            events=events,
            rtol=rtol,
            atol=atol,
            save_at=save_at,
            samples=samples,
            max_step=max_step,
            max_steps=max_steps,
            on_singular=on_singular,
            threads=threads,
        )
        return ensemble(
            self,
            states,
            forces,
            settings,
            parameters=parameters,
            drives=drives,
            wrenches=wrenches,
            progress=progress,
        )

    def stepper(self, state: State | Run, dt: float, forces: Forces = None, **options: Any) -> Any:
        """Return what steps the robot on, dt at a time, under forces that are known only then: for
        real time and hardware in the loop.

        Args:
            state: where to start; or a `Run`, of which it goes on as `resume` does.
            dt: length of a step [s].
            forces: as for `simulate`, of many as for `ensemble`; where they are left out, or
                numbers, others may be given to each step.
            options: as `linkwork.stepping.Stepper` takes them, or of many `Steppers`.

        Returns:
            A `linkwork.stepping.Stepper`; of a stack of states `Steppers` of as many robots.

        Raises:
            LinkworkError: bad input, in one sentence.
        """
        from linkwork import stepping

        return stepping.made(self, state, dt, forces, options)

    def gradient(
        self,
        loss: Callable[..., Any] | None,
        state: State,
        forces: Forces = None,
        *,
        duration: float,
        running: Callable[..., Any] | None = None,
        **options: Any,
    ) -> LossGradient:
        """Run from a state, and return a loss with its derivatives by all that determines the run.

            loss(T, state at T) + integral of running(t, state) dt

        The steps are differentiated that the run took, their sizes held, by the adjoint method:
        through changes of the independent rates, events and the calls of sampled controllers.

        Args:
            loss: a function of (t, state), written as a controller is (`linkwork.math`), of the
                end of the run; None: there is none.
            state: where to start.
            forces: as for `simulate`; of a controller the derivatives are those by its parameters.
            duration: T [s].
            running: a function of (t, state) that is integrated over the run.
            options: as for `simulate`.

        Returns:
            A `linkwork.gradients.LossGradient`: its `value`, `run`, and derivatives by name or
                group: "positions" (of the independent coordinates, along their rates; the loops
                stay closed), "rates", "states" (of drives and controllers), "forces" (of constants
                added to them, or to commands), "parameters" (free numbers of the mechanism, with
                the independent coordinates and rates held, and of controllers and drives);
                `samples`, by the values of sampled forces.

        Raises:
            LinkworkError: bad input; a run that stopped before its end, but for an event; what has
                no derivative, in one sentence: Python functions that are called, singular poses
                that are stepped over.
        """
        from linkwork.gradients.losses import loss_gradient

        checks.known(options, OPTIONS, "option of a run")
        return loss_gradient(
            self, loss, state, forces, running=running, options=options | {"duration": duration}
        )

    def observe(self, state: State) -> Observation:
        """Return a state as controllers see it: state["joint"], rates, poses of tool and bodies, as
        numbers."""
        from linkwork.model.observing import observed

        return observed(self, state)


OPTIONS = tuple(inspect.signature(Simulated.simulate).parameters)[3:]
"""Of a run, without self, state and forces."""
ACTING = {"drives", "wrenches", "parameters"}
"""Those of them that say what acts, not how it is computed."""
