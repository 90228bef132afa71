"""Stage 4: kernels, a state and forces become arrays over time.

The package knows nothing of robots: it is given the machine addresses of the equations of motion
and of the loop closure.
"""

from linkwork.simulation.eighth_order import dop853
from linkwork.simulation.events import Condition, Control, Events, Occurrences, Pace
from linkwork.simulation.fixed_steps import RK4, FixedStep, SymplecticEuler
from linkwork.simulation.integration import integrate
from linkwork.simulation.methods import FIXED, METHODS, Method, MethodName, integrator
from linkwork.simulation.rosenbrock import RODAS, Rosenbrock
from linkwork.simulation.run import Run, Statistics, Variable
from linkwork.simulation.sharp_smart import SHARP_SMART
from linkwork.simulation.signals import Sampled, Signal, as_signal, clock, stack
from linkwork.simulation.status import Status
from linkwork.simulation.tableaus import BOGACKI_SHAMPINE, DORMAND_PRINCE, Tableau
from linkwork.simulation.trajectory import Trajectory
from linkwork.simulation.turns import Turning

__all__ = [
    "BOGACKI_SHAMPINE",
    "DORMAND_PRINCE",
    "FIXED",
    "METHODS",
    "RK4",
    "RODAS",
    "SHARP_SMART",
    "Condition",
    "Control",
    "Events",
    "FixedStep",
    "Method",
    "MethodName",
    "Occurrences",
    "Pace",
    "Rosenbrock",
    "Run",
    "Sampled",
    "Signal",
    "Statistics",
    "Status",
    "SymplecticEuler",
    "Tableau",
    "Trajectory",
    "Turning",
    "Variable",
    "as_signal",
    "clock",
    "dop853",
    "integrate",
    "integrator",
    "stack",
]
