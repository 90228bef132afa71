"""Stage 5, use: `Robot` joins description, derivation, compilation and simulation."""

from typing import TYPE_CHECKING, Any

from linkwork.model.assembly import UnreachableError
from linkwork.model.checks import SingularError
from linkwork.model.reactions import Reactions
from linkwork.model.state import Motion, State
from linkwork.robot.dynamics import Dynamics
from linkwork.robot.facade import Robot
from linkwork.robot.kinematics import Kinematics
from linkwork.robot.simulated import Simulated

if TYPE_CHECKING:
    from linkwork.runs.ensemble import Ensemble

__all__ = [
    "Dynamics",
    "Ensemble",
    "Kinematics",
    "Motion",
    "Reactions",
    "Robot",
    "Simulated",
    "SingularError",
    "State",
    "UnreachableError",
]


def __getattr__(name: str) -> Any:
    """Import what runs need not know of when it is first asked for."""
    if name != "Ensemble":
        raise AttributeError(name)
    from linkwork.runs.ensemble import Ensemble

    return Ensemble
