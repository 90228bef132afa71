"""Bodies that move freely and carry no other, whose frames MuJoCo puts into the principal axes at
their mass centres where `align` or `alignfree` says so.

All that their joint holds and acts on, coordinates, armature, damping, anchors, is then told of
that frame.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from linkwork.formats import poses
from linkwork.formats.mjcf.document import Document
from linkwork.formats.mjcf.tree import ModelBody, ModelTree
from linkwork.solids.solid import Solid


def aligned(document: Document, tree: ModelTree) -> ModelTree:
    """Return a tree whose bodies stand in the frames that MuJoCo gives them."""
    parents = {node.parent for node in tree.nodes.values()}
    turned = {
        name: poses.pose(node.solid.centre, node.axes)
        for name, node in tree.nodes.items()
        if name not in parents and _asked(document, node)
    }
    if not turned:
        return tree
    back = {name: poses.inverse(X) for name, X in turned.items()}
    return replace(
        tree,
        nodes={
            name: _seen(node, turned[name]) if name in turned else node
            for name, node in tree.nodes.items()
        },
        sites={
            site: (body, back.get(body, np.eye(4)) @ X) for site, (body, X) in tree.sites.items()
        },
        geoms={
            geom: (body, back.get(body, np.eye(4)) @ X, element)
            for geom, (body, X, element) in tree.geoms.items()
        },
    )


def _asked(document: Document, node: ModelBody) -> bool:
    if [piece.kind for piece in node.pieces] != ["free"]:
        return False
    element = node.pieces[0].element
    said = element.choice("align", ("true", "false", "auto"), "auto")
    return document.compiler_of(element).align_free if said == "auto" else said == "true"


def _seen(node: ModelBody, X: np.ndarray) -> ModelBody:
    """Return a body in another frame, X_body_frame, in its principal axes."""
    back = poses.inverse(X)
    moments = np.diag(np.diag(X[:3, :3].T @ node.solid.inertia @ X[:3, :3]))
    return replace(
        node,
        pose=node.pose @ X,
        solid=Solid(node.solid.mass, np.zeros(3), moments),
        shapes=poses.carried(node.shapes, back),
        geoms=tuple((geom, back @ around) for geom, around in node.geoms),
        own_axes=np.eye(3),
    )
