"""Optimal design: lengths, offsets and masses chosen by gradient, with the loops closed at every
pose that counts."""

from linkwork.design._optimise import OptimalDesign, optimise
from linkwork.design.judging import Frequency, Isotropy, Measure, PeakForce

__all__ = ["Frequency", "Isotropy", "Measure", "OptimalDesign", "PeakForce", "optimise"]
