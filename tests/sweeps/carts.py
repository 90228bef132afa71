"""Studies of a cart on a rail, whose motion is known in closed form, and of the 3-PRR robot."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import xarray

import linkwork as lw
from linkwork.sweeps import Study
from linkwork.sweeps.chunk import compute

CART = lw.Mechanism(
    name="cart",
    gravity=(0, 0, 0),
    bodies={"cart": {"mass": 2.0}},
    joints={"rail": {"type": "prismatic", "connects": ("ground", "cart"), "axis": (1, 0, 0)}},
    actuators=("rail",),
    tools={"hook": {"body": "cart"}},
)
CASES = {
    "robot": CART,
    "duration": 0.5,
    "forces": {"rail": 3.0},
    "vary": {"cart.mass": {"type": "uniform", "low": 1.0, "high": 3.0}},
    "design": {"type": "random", "members": 40, "seed": 5},
    "outputs": {"end": "final joint_position.rail"},
    "chunk": 10,
}
FILE = """\
study: 1
name: carts
robot: cart.yaml
duration: 0.5
forces: {rail: 3}
design: {type: sobol, members: 1024, seed: 2}
vary:
  cart.mass: {type: uniform, low: 1, high: 3}
  start.rates.rail: {type: uniform, low: 0, high: 0.1}
outputs:
  end: final joint_position.rail
chunk: 16
"""


def study(**changes) -> Study:
    return Study(**CASES | changes)


def file(folder: Path, text: str = FILE) -> Path:
    """Write a study and its robot into a folder."""
    CART.save(folder / "cart.yaml")
    path = folder / "carts.yaml"
    path.write_text(text)
    return path


def whole(given: Study) -> dict[str, np.ndarray]:
    """Compute a study; return the arrays of all its members by name."""
    parts = [compute(given, index) for index in range(given.chunks)]
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def results(folder: Path) -> xarray.Dataset:
    return xarray.open_zarr(folder / "results.zarr").load()


def count(folder: Path) -> int:
    """Return how many chunks are finished, quickly: each has a file that is written last."""
    written = (folder / "results.zarr" / "checksum" / "c").glob("*")
    return sum(path.name.isdigit() for path in written)


def finished(folder: Path) -> np.ndarray:
    """Return which chunks are finished, while others are being written."""
    import zarr

    try:
        return zarr.open_array(folder / "results.zarr" / "checksum", mode="r")[:] != 0
    except (FileNotFoundError, ValueError):
        return np.zeros(0, bool)
