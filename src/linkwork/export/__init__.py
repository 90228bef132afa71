"""What leaves Linkwork and runs anywhere: a robot's equations of motion as C99."""

from linkwork.export._c import FUNCTIONS, CExport, c

__all__ = ["FUNCTIONS", "CExport", "c"]
