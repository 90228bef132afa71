"""Springs and dampers of MJCF joints by a time constant T and a damping ratio z (`springdamper`),
of the inertia at qpos0 as MuJoCo's compiler has it.

    k = m / (T z)^2,    d = 2 m / T,    1/m: the mean of the diagonal of M^-1 over the joint's rates

M has the armatures of joints, of tendons and of actuators; of those along tendons only what stands
in MuJoCo's inertia matrix (`inertia.with_lines`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from linkwork.formats.mjcf.cable_paths import cable_path
from linkwork.formats.mjcf.document import Document
from linkwork.formats.mjcf.inertia import along, first_rates, inertia, mobility, with_lines
from linkwork.formats.mjcf.loops import LoopReader
from linkwork.formats.mjcf.reflected import Added, Reflected, with_reflected
from linkwork.formats.mjcf.tree import ModelBody, ModelTree, Piece
from linkwork.formats.notes import Notes
from linkwork.formats.xml import Element
from linkwork.mechanism import GROUND, Cable

ALIGNED = 1e-14  # components of an axis that MuJoCo takes for none [1]


def with_spring_dampers(
    document: Document, tree: ModelTree, added: Reflected, notes: Notes
) -> ModelTree:
    """Return the tree with the springs and dampers of joints that give T and z instead.

    added: what actuators add, which the tree has not yet.
    """
    if not any(_wanted(piece) for _, piece in tree.pieces()):
        return tree
    M, places = inertia(with_reflected(tree, added.joints))
    inert = _inert(document, added)
    loops = LoopReader(document, tree, tree, notes)
    rows = [(mass, _row(tendon, document, tree, loops, places)) for tendon, mass in inert]
    M = with_lines(M, tree, rows)
    simple = _sliders(tree, inert)
    units, made, number = np.eye(len(M)), {}, 0
    for name, node in tree.nodes.items():
        pieces = []
        for piece in node.pieces:
            if _wanted(piece):
                freed = [mobility(M, units[k]) for k in places[number]]
                mass = float(1 / np.mean(freed))
                pieces.append(_sprung(document, piece, simple.get(name, mass)))
            else:
                pieces.append(piece)
            number += 1
        made[name] = replace(node, pieces=tuple(pieces))
    return replace(tree, nodes=made)


def _inert(document: Document, added: Reflected) -> list[tuple[Element, float]]:
    """Return the tendons along which something is inert, with that."""
    found = []
    for raw in document.each("tendon"):
        tendon = document.resolved(raw, "tendon")
        own = added.tendons.get(tendon.attributes.get("name", ""), Added()).inertia
        if armature := own + tendon.number("armature", 0.0):
            found.append((tendon, armature))
    return found


def _row(
    tendon: Element,
    document: Document,
    tree: ModelTree,
    loops: LoopReader,
    places: Sequence[range],
) -> np.ndarray:
    """Return J (nv) of l' = J w of a tendon at qpos0; places: of each joint's rates."""
    if tendon.tag == "spatial":
        path, _ = cable_path(tendon, document, loops)
        return along(tendon.make(Cable, path=path), tree)
    at, J = first_rates(tree, places), np.zeros(sum(map(len, places)))
    for part in tendon.each("joint"):
        if part.attributes.get("joint") in at:  # else it is refused where the tendon is read
            J[at[part.text("joint")]] += part.number("coef")
    return J


def _sprung(document: Document, piece: Piece, mass: float) -> Piece:
    """Return a joint with the spring and damper of its T and z, but for what is switched off."""
    T, z = _time_and_ratio(piece)
    spring = {"stiffness": mass / (T * z) ** 2, "rest": piece.springref}
    friction = {"viscous": 2 * mass / T}
    return replace(
        piece,
        spring=piece.spring.model_copy(update={} if "spring" in document.off else spring),
        friction=piece.friction.model_copy(update={} if "damper" in document.off else friction),
    )


def _sliders(tree: ModelTree, inert: list[tuple[Element, float]]) -> dict[str, float]:
    """Return the masses of simple bodies that only slide, by name: MuJoCo takes these for any of
    their rates, armatures apart.

    Simple are leaves in the world, or on what is fixed there, that slide along their principal axes
    from their mass centre, and that no inert tendon names.
    """
    named = {(p.tag, p.attributes.get(p.tag)) for tendon, _ in inert for p in tendon.children}
    apart = {body for name, (body, _) in tree.sites.items() if ("site", name) in named}
    apart |= {body for name, (body, *_) in tree.geoms.items() if ("geom", name) in named}
    apart |= {node.name for node, piece in tree.pieces() if ("joint", piece.name) in named}
    apart |= {node.parent for node in tree.nodes.values()}
    return {
        name: float(node.solid.mass)
        for name, node in tree.nodes.items()
        if name not in apart and _slides_alone(node, tree)
    }


def _slides_alone(node: ModelBody, tree: ModelTree) -> bool:
    parent = tree.nodes.get(node.parent)
    rooted = parent is None or (parent.parent == GROUND and not parent.pieces)
    principal = not np.any(node.solid.centre) and np.array_equal(node.axes, np.eye(3))
    along_axes = all(
        piece.kind == "slide" and not piece.anchor.any() and (abs(piece.axis) > ALIGNED).sum() == 1
        for piece in node.pieces
    )
    return rooted and principal and along_axes and node.element.attributes.get("simple") != "false"


def _wanted(piece: Piece) -> bool:
    return min(_time_and_ratio(piece)) > 0


def _time_and_ratio(piece: Piece) -> tuple[float, float]:
    """Return the time constant [s] and damping ratio that a joint gives, or zeros."""
    T, z = piece.element.numbers("springdamper", (2,), (0.0, 0.0))
    return T, z
