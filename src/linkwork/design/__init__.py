"""Optimal design and motion: lengths, offsets and masses chosen by gradient, with the loops closed
at every pose that counts; the least time or effort from state to state."""

from linkwork.design._optimal_motion import OptimalMotion, optimal_motion
from linkwork.design._optimise import OptimalDesign, optimise
from linkwork.design.judging import Frequency, Isotropy, Measure, PeakForce

__all__ = [
    "Frequency",
    "Isotropy",
    "Measure",
    "OptimalDesign",
    "OptimalMotion",
    "PeakForce",
    "optimal_motion",
    "optimise",
]
