"""Stage 5, use: `Robot` joins description, derivation, compilation and simulation."""

from linkwork.robot.assembly import UnreachableError
from linkwork.robot.checks import SingularError
from linkwork.robot.robot import Robot
from linkwork.robot.state import Motion, State

__all__ = ["Motion", "Robot", "SingularError", "State", "UnreachableError"]
