"""Stage 5, use: `Robot` joins description, derivation, compilation and simulation."""

from typing import TYPE_CHECKING, Any

from linkwork.robot.assembly import UnreachableError
from linkwork.robot.checks import SingularError
from linkwork.robot.facade import Robot
from linkwork.robot.reactions import Reactions
from linkwork.robot.state import Motion, State

if TYPE_CHECKING:
    from linkwork.robot.ensemble import Ensemble

__all__ = ["Ensemble", "Motion", "Reactions", "Robot", "SingularError", "State", "UnreachableError"]


def __getattr__(name: str) -> Any:
    """Import what runs need not know of when it is first asked for."""
    if name != "Ensemble":
        raise AttributeError(name)
    from linkwork.robot.ensemble import Ensemble

    return Ensemble
