"""Equations of motion of a robot at a state, and what is read off them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Literal, overload

import numpy as np
from numpy.typing import ArrayLike

from linkwork import moved
from linkwork.errors import LinkworkError
from linkwork.gradients import derivatives
from linkwork.model import checks, evaluation, linear
from linkwork.model.passing import warn_of_passing
from linkwork.model.state import Motion, State
from linkwork.robot.kinematics import Kinematics

if TYPE_CHECKING:
    from linkwork.gradients.records import (
        ForwardDynamicsDerivatives,
        InverseDynamicsDerivatives,
        MassMatrixDerivatives,
    )
    from linkwork.model.linear_model import LinearModel
    from linkwork.model.reactions import Reactions
    from linkwork.simulation import Sampled

Weights = ArrayLike | Mapping[str, float] | None


class Dynamics(Kinematics):
    """M(q) v' + C(q, v) v + G(q) = S' u + f in a state: solved for v' and for u, term by term,
    linearised, with energies and reactions (paper, Eqs. (9)-(12))."""

    def forward_dynamics(
        self, state: State, forces: ArrayLike | Mapping[str, ArrayLike], *, threads: int | None = 1
    ) -> np.ndarray:
        """Return the accelerations of the independent rates, v' = M^-1 (S' u + f - C v - G)
        (paper, Eq. (9)).

        Args:
            state: configuration and rates.
            forces: u of the actuators (..., actuators) [N, N m], in the order of `actuators`, or by
                name (others zero).
            threads: over which large stacks are dealt; None: all processors.

        Returns:
            v' (..., n) [m/s^2, rad/s^2], in the order of the state's `independent`.

        Raises:
            LinkworkError: wrong shape, numbers that are not finite, a configuration where these
                rates do not determine the motion.
        """
        if (found := self.directly("motion").at(state, forces, threads)) is not None:
            return found
        u = checks.actuator_forces(forces, self.actuators)
        return evaluation.dynamics(self, "motion", state, u, "forces", threads)

    @overload
    def inverse_dynamics(
        self,
        motion: State,
        accelerations: ArrayLike | Mapping[str, ArrayLike],
        *,
        weights: Weights = None,
        threads: int | None = 1,
    ) -> np.ndarray: ...

    @overload
    def inverse_dynamics(
        self,
        motion: Motion,
        accelerations: None = None,
        *,
        weights: Weights = None,
        threads: int | None = 1,
    ) -> Sampled: ...

    def inverse_dynamics(
        self,
        motion: State | Motion,
        accelerations: ArrayLike | Mapping[str, ArrayLike] | None = None,
        *,
        weights: Weights = None,
        threads: int | None = 1,
    ) -> np.ndarray | Sampled:
        """Return the actuator forces that a state and accelerations, or a whole motion, need: S' u
        = M v' + C v + G - f.

        With more actuators than freedoms these are the forces of least  sum weight_i u_i^2
        (`internal_forces` may be added, as `linkwork.analysis.tensions` does so that cables do not
        push); with fewer they are not defined, but for motions of
        elastic joints by `linkwork.motions.flat` or `follow`, which bring the motors' with them.

        Args:
            motion: a state, or a `Motion` (whose own accelerations are then taken).
            accelerations: v' (..., n) [m/s^2, rad/s^2] in the order of the state's `independent`,
                with a state.
            weights: of the actuators (positive), in their order or by name; all 1 if left out.
            threads: over which large stacks are dealt; None: all processors.

        Returns:
            u (..., actuators) [N, N m]; for a motion a `Sampled` signal over its times, to simulate
            with. A `ModelWarning` names the samples between which a motion passes where its
            actuators do not hold it, so that no sample shows how large the forces become.

        Raises:
            LinkworkError: directions that no actuator drives, by name; an actuator-singular
                configuration.
        """
        if isinstance(motion, Motion):
            from linkwork.simulation import Sampled

            forces = motion.forces
            if forces is None:
                state, given = motion.state, motion.accelerations
                forces = evaluation.actuator_forces(self, state, given, weights, threads)
            warn_of_passing(self, motion)
            return Sampled(motion.time, forces)
        if accelerations is None:
            raise LinkworkError("give the accelerations of the independent rates with a state")
        return evaluation.actuator_forces(self, motion, accelerations, weights, threads)

    def actuation(self, state: State) -> np.ndarray:
        """Return S (..., actuators, n): the actuated rates are S v, and forces u of the actuators
        act as S' u on v."""
        return evaluation.actuation_map(self, state)

    def internal_forces(self, state: State) -> np.ndarray:
        """Return an orthonormal basis (actuators, k) of the actuator forces that do not act on the
        motion, S' u = 0.

        There are k = actuators - n of them where the robot has more actuators than freedoms, none
        otherwise.
        """
        return evaluation.internal_forces(self, state)

    def holding_forces(self, state: State) -> np.ndarray:
        """Return the least actuator forces u (actuators) [N, N m] that hold a pose at rest, S' u =
        G - f. In them cables may push: `linkwork.analysis.tensions` keeps them taut.

        Raises:
            LinkworkError: a stack of states; a pose that no forces of the actuators hold.
        """
        return linear.holding_forces(self, state)

    def linearise(
        self,
        state: State,
        forces: ArrayLike | Mapping[str, float] | None = None,
        *,
        outputs: Sequence[str] | None = None,
        inputs: Sequence[str] | None = None,
    ) -> LinearModel:
        """Return the linear model x' = A x + B u, y = C x + D u of small deviations from a state
        and its forces, x = (xi, dv), xi' = dv + Gamma xi: `linkwork.analysis.linearise`.

        Args:
            state: one state; forces: u of the actuators, or by name (others zero); zero if left
                out; outputs, inputs: names of y and u, as there.

        Raises:
            LinkworkError: a stack of states, forces of wrong length, a singular configuration.
        """
        from linkwork.model.linear_model import linearise

        return linearise(self, state, forces, outputs=outputs, inputs=inputs)

    def linearised(self, state: State, forces: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """Return A and B of `linearise`, by its former name.

        state, forces: as there.
        """
        moved.warn("Robot.linearised", "Robot.linearise, whose model holds A and B,")
        model = self.linearise(state, forces)
        return model.A, model.B

    def forward_dynamics_derivatives(
        self, state: State, forces: ArrayLike | Mapping[str, ArrayLike], *, threads: int | None = 1
    ) -> ForwardDynamicsDerivatives:
        """Return v' and its exact derivatives with respect to q, v, u and p, loops closed.

            dv' = by_q dq + by_v dv + by_u du + by_p dp

        Args:
            state, forces, threads: as `forward_dynamics` takes them.

        Returns:
            A record in the tangent coordinates of the state's `independent` rates, p those of
            `parameters` (`linkwork.gradients.records`).

        Raises:
            LinkworkError: as `forward_dynamics`; derivatives that are not finite; free numbers that
                open loops.
        """
        return derivatives.forward_dynamics_derivatives(self, state, forces, threads)

    def inverse_dynamics_derivatives(
        self,
        state: State,
        accelerations: ArrayLike | Mapping[str, ArrayLike],
        *,
        of: Literal["actuators", "rates"] = "actuators",
        weights: Weights = None,
        threads: int | None = 1,
    ) -> InverseDynamicsDerivatives:
        """Return the forces that accelerations v' need, and their exact derivatives with respect to
        q, v, v' and p, loops closed.

        Args:
            state, accelerations, weights, threads: as `inverse_dynamics` takes them.
            of: "actuators": u with S' u = M v' + C v + G - f; "rates": these forces on the
                independent rates, of which the derivative with respect to v' is M.

        Returns:
            A record as that of `forward_dynamics_derivatives`.

        Raises:
            LinkworkError: as `inverse_dynamics`; fewer actuators than freedoms; bearings that rub
                by what they carry; derivatives that are not finite; free numbers that open loops.
        """
        return derivatives.inverse_dynamics_derivatives(
            self, state, accelerations, of, weights, threads
        )

    def mass_matrix_derivatives(
        self, state: State, *, threads: int | None = 1
    ) -> MassMatrixDerivatives:
        """Return M and its exact derivatives with respect to q and p, as
        `forward_dynamics_derivatives`.

        state: one or a stack (...); threads: over which a large stack is dealt, all processors if
        None.
        """
        return derivatives.mass_matrix_derivatives(self, state, threads)

    def mass_matrix(self, state: State) -> np.ndarray:
        """Return the generalised inertia M (..., n, n) in the independent rates
        (paper, Eq. (10))."""
        return evaluation.terms(self, state).M

    def coriolis(self, state: State) -> np.ndarray:
        """Return the Coriolis and centrifugal forces C v (..., n) [N, N m] (paper, Eq. (11))."""
        return evaluation.terms(self, state).Cv

    def gravity(self, state: State) -> np.ndarray:
        """Return the forces G (..., n) [N, N m] that hold the weight (paper, Eq. (12))."""
        return evaluation.terms(self, state).G

    def passive_forces(self, state: State) -> np.ndarray:
        """Return the forces f (..., n) [N, N m] of springs, dampers and friction on the independent
        rates; the friction of bearings, which accelerations are part of, is not among them."""
        return evaluation.terms(self, state).f

    def energy(self, state: State) -> tuple[np.ndarray, np.ndarray]:
        """Return the kinetic energy v' M v / 2 and the potential energy of weight and springs (...)
        [J]."""
        found = evaluation.told(self, "energy", state)
        return found[0], found[1]

    def reactions(
        self,
        state: State,
        forces: ArrayLike | Mapping[str, ArrayLike],
        *,
        frame: str = "ground",
        length: float | None = None,
    ) -> Reactions:
        """Return the wrench [moment; force] that every joint transmits from its first to its second
        body.

        All of it: with the forces of actuator, spring, friction and gears in the joint;
        `constraint` is without them. Where constraints depend on each other the least wrenches are
        given, and `indeterminate` names what is open.

        Args:
            state: configuration and rates; forces: u of the actuators (..., actuators) [N, N m], or
                by name (others zero). The bodies accelerate as `forward_dynamics` tells.
            frame: "ground" (about F1's origin in the ground's axes), "first" (F1's axes) or
                "second" (about F2's origin, F2's axes).
            length: [m] by which moments are divided where the least wrenches are chosen; the
                joints' root mean square distance from their middle at home, by the description's
                own numbers whatever values its free ones have, if left out.

        Raises:
            LinkworkError: as `forward_dynamics`; another frame; a length far from the robot's own.
        """
        from linkwork.model.reactions import reactions

        return reactions(self, state, forces, frame, length)
