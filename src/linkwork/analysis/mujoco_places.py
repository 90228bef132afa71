"""Where a model of MuJoCo has the joints, the inertia, the tendons and the actuators of a tree."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from linkwork.analysis.tree_map import TreeMap
from linkwork.checks import imported
from linkwork.errors import LinkworkError
from linkwork.formats.mjcf.model_plan import Move


@dataclass(frozen=True, eq=False)
class Places:
    """Hold places in a model's arrays.

    coordinates, dofs: of the tree's coordinates and rates in qpos and qvel
    inertia, pairs: in M, and in M_app as one vector
    tendons: of the motors; slots, own: in ten_J, and in A column by column
    outputs: place of an actuator's output, its tendon and gear
    """

    coordinates: np.ndarray
    dofs: np.ndarray
    inertia: np.ndarray
    pairs: np.ndarray
    tendons: np.ndarray
    slots: np.ndarray
    own: np.ndarray
    outputs: tuple[tuple[int, int, float], ...]


def places_in(model: Any, of: TreeMap) -> Places:
    """Return where a model has a tree.

    Raises:
        LinkworkError: a joint or a tendon is not there, or not as the tree needs it.
    """
    moves = of.tree.moves
    joints = [named(model, "joint", move.name) for move in moves]
    coordinates = spread(model.jnt_qposadr[joints], moves, 7)
    dofs = spread(model.jnt_dofadr[joints], moves, 6)
    rank = {dof: k for k, dof in enumerate(dofs.tolist())}
    inertia = np.array([*entries(model, rank)], int).reshape(-1, 2)
    require_couplings(of, inertia[:, 1])
    tendons = [named(model, "tendon", name) for name in of.motors]
    jacobian = np.array([*slots(model, tendons, rank)], int).reshape(-1, 2)
    outputs = tuple(outputs_on(model, tendons))
    return Places(
        coordinates=coordinates,
        dofs=dofs,
        inertia=inertia[:, 0],
        pairs=inertia[:, 1],
        tendons=np.array(tendons, int),
        slots=jacobian[:, 0],
        own=jacobian[:, 1],
        outputs=outputs,
    )


def loaded() -> Any:
    """Return MuJoCo's module.

    Raises:
        LinkworkError: it is not installed.
    """
    return imported("mujoco", "the callback needs MuJoCo; install it with 'pip install mujoco'")


def named(model: Any, kind: str, name: str) -> int:
    """Return the number of a joint or a tendon."""
    mujoco = loaded()
    found = mujoco.mj_name2id(model, getattr(mujoco.mjtObj, f"mjOBJ_{kind.upper()}"), name)
    if found < 0:
        raise LinkworkError(
            f"the model has no {kind} {name!r}; give a model of the file of write_mjcf"
        )
    return found


def spread(starts: np.ndarray, moves: list[Move], free: int) -> np.ndarray:
    """Return the places of joints from their starts: one each, or as many as a free one has."""
    sizes = [free if move.kind == "free" else 1 for move in moves]
    found = [np.arange(start, start + size) for start, size in zip(starts, sizes, strict=True)]
    return np.concatenate(found).astype(int)


def entries(model: Any, rank: dict[int, int]) -> Iterator[tuple[int, int]]:
    """Yield the places in M of pairs of rates of the tree, each row's inward of it, and those of
    the pairs in M_app."""
    for dof, i in rank.items():
        start = model.M_rowadr[dof]
        for at in range(start, start + model.M_rownnz[dof]):
            j = rank.get(int(model.M_colind[at]))
            if j is not None:
                yield at, j * len(rank) + i


def require_couplings(of: TreeMap, pairs: np.ndarray) -> None:
    """Refuse a model that keeps rates apart that M_app couples."""
    n, held = len(of.tree.names), {*pairs.tolist()}
    for i, j in zip(*of.terms[0].sparsity().get_triplet(), strict=True):
        if not {i * n + j, j * n + i} & held:
            raise LinkworkError(
                f"the model keeps {of.tree.names[i]!r} and {of.tree.names[j]!r} apart, which the "
                "links that are cut away couple; give a model of the file of write_mjcf"
            )


def slots(model: Any, tendons: list[int], rank: dict[int, int]) -> Iterator[tuple[int, int]]:
    """Yield the places in ten_J of the motors' tendons, and in A."""
    for k, tendon in enumerate(tendons):
        start = model.ten_J_rowadr[tendon]
        for at in range(start, start + model.ten_J_rownnz[tendon]):
            j = rank.get(int(model.ten_J_colind[at]))
            if j is None:
                raise LinkworkError(
                    f"the model's tendon {model.tendon(tendon).name!r} is of joints that its motor "
                    "does not move; give a model of the file of write_mjcf"
                )
            yield at, j * len(tendons) + k


def outputs_on(model: Any, tendons: list[int]) -> Iterator[tuple[int, int, float]]:
    """Yield the outputs of actuators on tendons, with the tendon and the gear."""
    of_tendons = loaded().mjtTrn.mjTRN_TENDON
    for k in range(model.nactuator):
        tendon, output = int(model.actuator_trnid[k, 0]), int(model.actuator_outadr[k])
        if model.actuator_trntype[k] == of_tendons and tendon in tendons:
            yield output, tendon, float(model.actuator_gear[output, 0])
