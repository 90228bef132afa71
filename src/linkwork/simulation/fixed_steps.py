"""Methods that take steps of one length, as data: `plan` holds their stages as those of a pair.

Sources: Hairer, Norsett & Wanner, Solving Ordinary Differential Equations I, 2nd ed. (1993), table
II.1.2 (Kutta's method of order 4). Symplectic Euler: Hairer, Lubich & Wanner, Geometric Numerical
Integration, 2nd ed. (2006), sec. I.1.2.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from linkwork.errors import LinkworkError
from linkwork.simulation.tableaus import StepPlan, by_powers, fractions, frozen, hermite


@dataclass(frozen=True)
class FixedStep:
    """Take steps of one length, for real time.

    `step`: s; steps end at its multiples, and also where the forces jump, a sampled controller
    acts, or the run ends. `name`, `order`, `plan`: as of a `Tableau`.  Raises `LinkworkError` for a
    step that is not positive and finite.
    """

    step: float
    name: ClassVar[str]
    order: ClassVar[int]
    plan: ClassVar[StepPlan]
    stiff: ClassVar[bool] = False
    in_lanes: ClassVar[bool] = False
    stability: ClassVar[float] = 0.0

    def __post_init__(self):
        if not 0 < self.step < np.inf:
            raise LinkworkError(
                f"the step of a method of fixed step must be positive and finite, not {self.step} s"
            )


_KUTTA_ROWS = [fractions(row, 5) for row in ("", "1/2", "0 1/2", "0 0 1", "1/6 1/3 1/3 1/6")]
_KUTTA = StepPlan(
    a=frozen(_KUTTA_ROWS),
    c=frozen([sum(row) for row in _KUTTA_ROWS]),
    e=frozen(np.empty((0, 5))),
    dense=by_powers(hermite(_KUTTA_ROWS[-1], fractions("", 5))),
    solution=4,
    computed=4,
    exponent=0.0,
)
_EULER = StepPlan(
    a=frozen([[0, 0], [1, 0]]),
    c=frozen([0, 0]),
    e=frozen(np.empty((0, 2))),
    dense=by_powers([[1], [0]]),
    solution=1,
    computed=2,
    exponent=0.0,
)


class RK4(FixedStep):
    """Take steps of one length by Kutta's method of order 4: four evaluations each.

    Dense output: Hermite's cubic. step: s, as in `FixedStep`.
    """

    name = "Runge-Kutta 4"
    order = 4
    plan = _KUTTA


class SymplecticEuler(FixedStep):
    """Take steps of one length by the semi-implicit Euler method: the rates first, then q with the
    new rates.

        v_1 = v_0 + h v'(q_0, v_0),    q_1 = q_0 + h L(q_0) v_1

    Two evaluations a step, of order 1; its energy does not drift where M is constant. Extra states
    are stepped with the rates. Dense output: straight lines. step: s, as in `FixedStep`.
    """

    name = "symplectic Euler"
    order = 1
    plan = _EULER
