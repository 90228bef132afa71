"""Robot: the one object a user holds. It joins description, derivation, compilation and
simulation."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from linkwork.model import checks, evaluation, posing
from linkwork.model.assembly import OPEN_LOOPS
from linkwork.model.state import Motion, State
from linkwork.notebooks import Portrayed
from linkwork.paths import Path
from linkwork.robot.dynamics import Dynamics
from linkwork.robot.kinematics import Kinematics
from linkwork.runs.settings import settings_of

if TYPE_CHECKING:
    from linkwork.control import Drive, Event, Observation, Wrench
    from linkwork.export import CasadiFunctions
    from linkwork.formats.references import Reference
    from linkwork.runs.ensemble import Ensemble
    from linkwork.runs.running import Forces
    from linkwork.simulation import MethodName, Run, Sampled, Signal


class Robot(Dynamics, Portrayed):
    """Derive, compile and evaluate the exact equations of motion of a mechanism in independent
    rates v.

        M(q) v' + C(q, v) v + G(q) = S' u + f,    q' = L(q) v            (paper, Eqs. (7), (9)-(12))

    Everything is in SI units and radians. The independent rates, and so the order of M and of
    accelerations, are those named by `independent`: the actuated ones in the order of `actuators`
    (S = 1) where these determine the motion; else as many of them as are independent, and others. f
    are the forces of springs and friction. Joint coordinates are in the order of `coordinates`,
    their rates in that of `rates`. Methods take one state or a stack of states with leading
    dimensions, and return arrays with the same leading dimensions. Kernels are compiled when they
    are first needed and kept in the user's cache folder.

    Args:
        mechanism: the description, from `linkwork.robots` or code; the name of a robot of the
            catalogue ("prr3"); or the path of a file, as for `from_file`.
        independent: rates that should be the independent ones, by name, as far as they determine
            the motion.
        free: numbers of the description that stay free, by path (see `free`).

    Attributes:
        mechanism, equations: the description, and what is derived from it
        coordinates, rates: labels of all joints; independent: those of v
        joints, bodies, actuators: names; planar: whether it moves in a plane
        home: the closed reference configuration, at rest; unit: of a coordinate or rate, by label
        parameters: values of the free numbers, by path; p: the same as an array, the kernels' last
            input
        mobility: number n of independent rates; gruebler: what Gruebler's formula gives for it
        redundant: closure rows that depend on the others, by joint and direction; they are left out
            and watched
        spins: freedoms that turn a member about its own axis and move nothing else, undriven, by
            name; left open by kinematics
        idle: those of them that no friction, spring, rotor or limit acts on; left to themselves by
            inverse dynamics
        notes: sentences on what was decided about the reference that the description does not say

    Raises:
        LinkworkError: a name of no robot, with the nearest one; a file that is refused.
        MechanismError: a description that cannot be assembled or has no motion, in one sentence.

    Warns:
        ModelWarning: what makes the robot move otherwise than its file says; loops that rounded
            numbers of the description leave open.
    """

    @classmethod
    def from_file(
        cls,
        path: str | FilePath,
        reference: Reference | None = None,
        floating: bool = False,
        packages: Iterable[str | FilePath] | str | FilePath = (),
        merging: bool = True,
        includes: Iterable[str | FilePath] | str | FilePath = (),
    ) -> Robot:
        """Read a mechanism file (YAML) or a model file (MJCF, URDF, SDF) and derive its equations.

        Args:
            path, reference, floating, packages, merging, includes: as `linkwork.formats.load` takes
                them.

        Warns:
            ModelWarning: what makes the robot move otherwise than the file says.
        """
        from linkwork.formats import models

        reading = models.Reading.asked(floating, packages, merging, includes)
        mechanism = models.read(path, reading).mechanism
        models.warn(mechanism, stacklevel=3)
        return cls(models.referred(mechanism, reference))

    def __reduce__(self) -> tuple[Any, ...]:
        from linkwork.model import pickled

        return pickled.again, (type(self), pickled.made_of(self))

    @property
    def drives(self) -> dict[str, Drive]:
        """The drives that the description gives for actuators, by name: `simulate(state, commands,
        drives=robot.drives, duration=...)` runs with them.

        Raises:
            MechanismError: a type or a number that no drive of `linkwork.control` has.
        """
        from linkwork.control.described_drives import drives_of

        return drives_of(self.mechanism)

    def __dir__(self) -> list[str]:
        """Return the names that are for users, and none that modules of the library ask for."""
        own = (name for part in (Robot, Dynamics, Kinematics) for name in vars(part))
        return sorted({*HELD, *(name for name in own if name[0] != "_" and name not in FORMER)})

    def free(self, *paths: str) -> Robot:
        """Return the robot with some numbers of its description free: `with_parameters` then
        changes them in no time.

        Args:
            paths: of numbers, "body, joint, spring or tool" then fields as in a mechanism file:
                "platform.mass", "link_1.com.x", "link_1.inertia.zz", "pivot_1.frames.0.position.y",
                "pivot_1.friction.viscous", "ball.spring.turn.stiffness", "rod_1.length",
                "gravity.z" ... (`linkwork.mechanism.numbers`).

        Returns:
            A robot whose `parameters` hold the values; numbers that are free already stay so.

        Raises:
            MechanismError: a path that leads to no number, or to one that cannot be free
                (directions, limits).
        """
        return Robot(self.mechanism, self.independent, (*self.parameters, *paths))

    def with_parameters(self, values: Mapping[str, float]) -> Robot:
        """Return the robot with other values of free numbers; nothing is derived or compiled anew.

        States belong to the robot that makes them: where a length changes, the loops close
        elsewhere.

        Args:
            values: by path as in `parameters`; what is left out keeps its value.

        Raises:
            LinkworkError: numbers that are not free, or that no description may hold; lengths with
                which the loops do not close near the reference configuration.
        """
        from linkwork.model.parameters import with_parameters

        return with_parameters(self, values)

    # States

    def state(
        self,
        positions: ArrayLike | Mapping[str, ArrayLike],
        rates: ArrayLike | Mapping[str, ArrayLike] | None = None,
        *,
        tolerance: float = OPEN_LOOPS,
        threads: int | None = 1,
    ) -> State:
        """Make a state from the coordinates of all joints.

        Args:
            positions: q of all joints (..., m) [m, rad] in the order of `coordinates`, or by name.
            rates: v (..., n) [m/s, rad/s] in the order of `independent`, or by name: some of the
                independent ones, the others zero, or n of any joints; zero if left out.
            tolerance: largest gap of a loop, over the mechanism's own length, or rad; what is open
                by less is closed exactly by moving the dependent joints.
            threads: over which large stacks are dealt; None: all processors.

        Raises:
            LinkworkError: wrong shapes or names, numbers that are not finite, loops that are open.
        """
        return posing.state(self, positions, rates, tolerance, threads)

    def assemble(
        self,
        joints: Mapping[str, ArrayLike] | None = None,
        *,
        tool: ArrayLike | Mapping[str, ArrayLike] | None = None,
        rates: ArrayLike | Mapping[str, ArrayLike] | None = None,
        guess: State | None = None,
        branch: Literal["guess", "any"] = "guess",
    ) -> State:
        """Close the loops at given joint coordinates (direct kinematics) or at a tool pose
        (inverse kinematics).

        Args:
            joints: some joint coordinates by name [m, rad]; values (...) of as many as the mobility
                give a stack of states.
            tool: coordinates of the tool [m, rad]: those of its `task` (..., k); or a pose, (...,
                2 or 3) in the plane: x, y[, angle]; (..., 3 or 6) in space: x, y, z[, rotation
                vector]; or any of them by name. Leading dimensions give a stack of states, each
                from the same guess.
            rates: v (n) in the order of `independent`, or by name: some of the independent ones,
                the others zero, or n of any joints; zero if left out.
            guess: a state on the wanted branch (working mode, assembly mode); `home` if left out.
            branch: the tool is led on the "guess"'s working mode, straight where that is possible
                (Chablat & Wenger 1998: no determinant of the inverse problem changes its sign);
                "any": on whichever leads there. Where members spin, or freedoms are left open, no
                signs tell modes apart.

        Raises:
            UnreachableError: what is asked is out of reach, not reachable from this guess, or only
                on another branch.
        """
        return posing.assemble(self, joints, tool, rates, guess, branch)

    def follow(
        self,
        path: Path,
        duration: float,
        *,
        samples: int = 101,
        guess: State | None = None,
        what: Sequence[str] | None = None,
    ) -> Motion:
        """Lead the tool along a path: positions, rates and accelerations of all joints.

        Args:
            path: a tool path (`linkwork.paths`), of as many coordinates as the mobility.
            duration: T [s].
            samples: number of equally spaced times from 0 to T.
            guess: a state on the wanted branch, near the first pose; `home` if left out.
            what: names of the path's coordinates; those of the `task` if left out.

        Returns:
            A `Motion`; `task_values` and `tool_pose` of its states tell how the other coordinates
            of the pose move along.

        Raises:
            UnreachableError: with the time and pose at which the path leaves the workspace.
            LinkworkError: a leg-singular pose on the path, or samples between which the joints
                change their branch.
        """
        return posing.follow(self, path, duration, samples, guess, what)

    # Charts

    def in_chart(self, state: State, independent: Sequence[str]) -> State:
        """Return the same state with other independent rates, read off the rates of all joints.

        Args:
            independent: n rates of the tree's joints by name (`equations.tree.rates`); M,
                accelerations and all else that a state gives are then in these.

        Raises:
            LinkworkError: names that are no rates of the tree; rates, new or given, that do not
                determine the motion there.
        """
        return evaluation.in_chart(self, state, checks.names(independent, "independent"))

    # Exports

    def functions(self, chart: State | Sequence[str] | None = None) -> CasadiFunctions:
        """Return the equations of motion as CasADi functions with named arguments, by name, for
        optimal control and all else that CasADi does: `linkwork.export.casadi`.

        Args:
            chart: names of the independent rates, or a state whose independent rates are taken
                (`in_chart`); those at home if left out.

        Raises:
            LinkworkError: rates that there are not, or that do not determine the motion there.
        """
        from linkwork.export import casadi

        return casadi(self, chart)

    def latex(self, *, symbols: Literal["free", "all"] = "free") -> str:
        """Return the equations of motion in closed form as a LaTeX document: those of
        `linkwork.export.sympy`.

        Args:
            symbols: "free": free numbers are symbols; "all": lengths, masses, inertias and gravity
                are, too.

        Raises:
            LinkworkError: SymPy is not installed; a mechanism without short closed forms.
        """
        from linkwork.export import latex

        return latex(self, symbols=symbols)

    # Simulation

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
                where the run is stiff, as where dry friction brings bodies to rest.
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
                where there is one; the run's `singular_times` tell when.

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
        inputs continue.

        Args:
            run: of this robot.
            duration: how long to go on [s].
            forces, options: as for `simulate`; a run does not hold controllers, drives and
                wrenches: give them again, a sampled controller with the delay that it had.
                    Parameters of the robot keep the values that they had in the
                run, unless `parameters` gives others.

        Raises:
            LinkworkError: as `simulate`; options that it has not; what does not fit the run.
        """
        from linkwork.runs import running

        checks.known(options, OPTIONS, "option of a run")
        acting = {name: options.pop(name) for name in ACTING & options.keys()}
        return running.resume(
            self, run, forces, running.Settings(duration=duration, **options), **acting
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

    def observe(self, state: State) -> Observation:
        """Return a state as controllers see it: state["joint"], rates, poses of tool and bodies, as
        numbers."""
        from linkwork.model.observing import observed

        return observed(self, state)


HELD = (
    *(
        "mechanism",
        "equations",
        "parameters",
        "p",
        "planar",
        "mobility",
        "gruebler",
        "home",
        "unit",
    ),
    *("coordinates", "rates", "independent", "joints", "bodies", "actuators"),
    *("redundant", "spins", "idle", "notes"),
)  # what a robot holds for its users, beside what it does
FORMER = ("linearised",)  # names that warn
OPTIONS = tuple(inspect.signature(Robot.simulate).parameters)[
    3:
]  # of a run, without self, state and forces
ACTING = {
    "drives",
    "wrenches",
    "parameters",
}  # those of them that say what acts, not how it is computed
