"""Stage 5, use: robots that are stepped on by whoever calls, alone or many at a time."""

from linkwork.stepping.errors import StepError
from linkwork.stepping.stepper import Stepper

__all__ = ["StepError", "Stepper"]
