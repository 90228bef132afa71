"""Stage 5, use: `Robot` joins description, derivation, compilation and simulation."""

from linkwork.robot.assembly import UnreachableError
from linkwork.robot.checks import SingularError
from linkwork.robot.ensemble import Ensemble
from linkwork.robot.facade import Robot
from linkwork.robot.reactions import Reactions
from linkwork.robot.state import Motion, State

__all__ = ["Ensemble", "Motion", "Reactions", "Robot", "SingularError", "State", "UnreachableError"]
