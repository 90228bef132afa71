"""Independent oracles for tests and benchmarks: Lagrange multipliers in maximal coordinates, and
random mechanisms."""

from tests.oracle.lagrange import LagrangeOracle, OracleError
from tests.oracle.random_mechanisms import open_tree, planar_loops, random_state, spatial_loops

__all__ = [
    "LagrangeOracle",
    "OracleError",
    "open_tree",
    "planar_loops",
    "random_state",
    "spatial_loops",
]
