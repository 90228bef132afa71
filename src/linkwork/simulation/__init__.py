"""Stage 4: kernels, a state and forces become arrays over time.

The package knows nothing of robots: it is given the machine addresses of the equations of motion and of the loop closure.
"""

from linkwork.simulation.integrate import Trajectory, integrate
from linkwork.simulation.run import Run, Statistics, Variable
from linkwork.simulation.signals import Sampled, Signal, as_signal, clock, stack
from linkwork.simulation.status import Status
from linkwork.simulation.tableaus import BOGACKI_SHAMPINE, DORMAND_PRINCE, Tableau

__all__ = [
    "BOGACKI_SHAMPINE",
    "DORMAND_PRINCE",
    "Run",
    "Sampled",
    "Signal",
    "Statistics",
    "Status",
    "Tableau",
    "Trajectory",
    "Variable",
    "as_signal",
    "clock",
    "integrate",
    "stack",
]
