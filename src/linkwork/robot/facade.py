"""Robot: the one object a user holds. It joins description, derivation, compilation and
simulation."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any, Literal

from numpy.typing import ArrayLike

from linkwork.model import assembling, checks, evaluation, path_following, posing
from linkwork.model.checks import OPEN_LOOPS
from linkwork.model.state import Motion, State
from linkwork.notebooks import Portrayed
from linkwork.paths import Path
from linkwork.robot.dynamics import Dynamics
from linkwork.robot.kinematics import Kinematics
from linkwork.robot.simulated import Simulated

if TYPE_CHECKING:
    from linkwork.control import Drive
    from linkwork.export import CasadiFunctions, MujocoModel, PinocchioModel
    from linkwork.formats.references import Reference


class Robot(Simulated, Portrayed):
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
            numbers of the description leave open; a reference at which branches of motion meet,
            beside which home is.
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
        own = (name for part in (Robot, Simulated, Dynamics, Kinematics) for name in vars(part))
        return sorted({*HELD, *(name for name in own if name[0] != "_" and name not in FORMER)})

    def free(self, *paths: str) -> Robot:
        """Return the robot with some numbers of its description free: `with_parameters` then
        changes them in no time.

        Args:
            paths: of numbers, "body, joint, spring or tool" then fields as in a mechanism file:
                "platform.mass", "link_1.com.x", "link_1.inertia.zz", "pivot_1.frames.0.position.y",
                "pivot_1.friction.viscous", "ball.spring.turn.stiffness", "rod_1.length",
                "gravity.z" ... (`linkwork.mechanism.numbers`); patterns such as "rod_*.length"
                stand for all numbers that they match and that can be free.

        Returns:
            A robot whose `parameters` hold the values; numbers that are free already stay so.

        Raises:
            MechanismError: a path that leads to no number, or to one that cannot be free
                (directions, limits); a pattern that matches none.
        """
        from linkwork.mechanism.number_patterns import freed, together

        names = freed(self.mechanism, (*self.parameters,), paths)
        with together(paths):
            return Robot(self.mechanism, self.independent, names)

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

        Warns:
            ModelWarning: joints that are met beyond a singular pose, maybe on another assembly
                mode.
        """
        return assembling.assemble(self, joints, tool, rates, guess, branch)

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
        return path_following.follow(self, path, duration, samples, guess, what)

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

    def to_mujoco(self) -> MujocoModel:
        """Return a live model of MuJoCo, with its data at a state and its coordinates, rates and
        accelerations by name: `linkwork.export.mujoco`.

        Raises:
            LinkworkError: MuJoCo is not installed, or MJCF cannot hold the robot.
        """
        from linkwork.export import mujoco

        return mujoco(self)

    def to_pinocchio(self) -> PinocchioModel:
        """Return a live model of Pinocchio, a tree with constraints that close the loops, with its
        accelerations by name: `linkwork.export.pinocchio`.

        Raises:
            LinkworkError: Pinocchio is not installed, or cannot hold the robot.
        """
        from linkwork.export import pinocchio

        return pinocchio(self)


# What a robot holds for its users, beside what it does; and names that warn.
HELD = (
    *("mechanism", "equations", "parameters", "p", "planar", "mobility", "gruebler", "home"),
    *("unit", "coordinates", "rates", "independent", "joints", "bodies", "actuators"),
    *("redundant", "spins", "idle", "notes"),
)
FORMER = ("linearised",)
