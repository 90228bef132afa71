"""What MuJoCo does with the sum of all actuators at a joint or tendon, which a mechanism does not:
bounds (actuatorfrcrange), and weights that count as an actuator's (actuatorgravcomp)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass

from linkwork.formats.mjcf.branches import movers
from linkwork.formats.mjcf.document import ACTUATORS, Document, flag
from linkwork.formats.mjcf.tree import ModelBody, ModelTree, Piece
from linkwork.formats.notes import Notes
from linkwork.formats.xml import Element
from linkwork.mechanism import Cable, Displacement, SliderCrank, Thrust, Transmission

SUM = (
    "says actuatorfrcrange, which is left out: it bounds the sum of several actuators, or what a "
    "tendon does"
)
CLIPPED = (
    "says actuatorgravcomp: what carries its weight acts in full here, and MuJoCo bounds it by "
    "actuatorfrcrange"
)
UNCARRIED = (
    "says actuatorgravcomp: what carries its weight acts here, and not in MuJoCo, where no "
    "actuator acts"
)


@dataclass(frozen=True)
class Pulls:
    """Tell how many actuators act on a joint.

    users, direct: on it by name, all and those that name it; pullers: on tendons
    """

    document: Document
    tree: ModelTree
    users: Counter[str]
    direct: Counter[str | None]
    pullers: Counter[str | None]

    def tell(
        self, pulled: Iterable[Transmission], tendons: Iterable[Element], notes: Notes
    ) -> None:
        """Note what is left out of sums; pulled: what actuators act along beside rates; tendons:
        all of them."""
        through = {body for line in pulled for body in self._moved(line)}
        for node, piece in self.tree.pieces():
            name = piece.name or ""
            alone = self.users[name] == self.direct[name] == 1 and node.name not in through
            used = self.users[name] or node.name in through
            if used and not alone and self._bounded(piece.element):
                notes.on(piece.element, SUM, alters=True)
            self._tell_of_weight(node, piece, notes)
        for element in tendons:
            count = self.pullers[element.attributes.get("name", "")]
            if count > 1 and self._bounded(element):
                notes.on(element, SUM, alters=True)

    def _moved(self, line: Transmission) -> set[str]:
        """Return the bodies on whose joints a transmission between bodies acts."""
        match line:
            case Cable():
                return movers(line, self._chain)
            case Thrust():
                return {*self._chain(line.body)}
            case SliderCrank():
                return {*self._chain(line.pin.body)} ^ {*self._chain(line.body)}
            case Displacement():
                return {*self._chain(line.body)} ^ {*self._chain(line.base)}
        return set()

    def _chain(self, body: str) -> list[str]:
        return [node.name for node in self.tree.chain(body) if node.pieces]

    def _bounded(self, element: Element) -> bool:
        return self.document.is_limited(element, "actuatorfrcrange", "actuatorfrclimited")

    def _tell_of_weight(self, node: ModelBody, piece: Piece, notes: Notes) -> None:
        if not flag(piece.element, "actuatorgravcomp", False) or not self._carries(node):
            return
        if not any(self.document.each("actuator", *ACTUATORS)) or "actuation" in self.document.off:
            notes.on(piece.element, UNCARRIED, alters=True)
        elif self._bounded(piece.element):
            notes.on(piece.element, CLIPPED, alters=True)

    def _carries(self, node: ModelBody) -> bool:
        """Tell whether a weight on a body, or on what hangs on it, is carried."""
        return any(
            other.element.number("gravcomp", 0.0)
            for other in self.tree.nodes.values()
            if any(each.name == node.name for each in self.tree.chain(other.name))
        )
