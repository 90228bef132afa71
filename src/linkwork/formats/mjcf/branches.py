"""Which joints change the length of a transmission, and whether they stand on one branch of the
tree: MuJoCo leaves out of its inertia matrix what an inertia along it couples else."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from itertools import pairwise

from linkwork.mechanism import Cable, Combination, PulleyBlock


def on_one_branch(
    line: Combination | Cable, owners: Mapping[str, str], chain: Callable[[str], Iterable[str]]
) -> bool:
    """Tell whether all joints that change a length move one another's bodies: none stands beside
    another one in the tree.

    Args:
        line: what has the length.
        owners: the bodies that joints carry, by the joints' coordinates.
        chain: returns the bodies that joints carry from a body on down to ground.
    """
    if isinstance(line, Combination):
        moved = {owners[label] for label, ratio in line.ratios.items() if ratio and label in owners}
    else:
        moved = movers(line, chain)
    return not moved or moved <= max(({*chain(body)} for body in moved), key=len)


def movers(cable: Cable, chain: Callable[[str], Iterable[str]]) -> set[str]:
    """Return the bodies whose joints change the length of a cable; chain: as of on_one_branch."""
    ways = [None if isinstance(p, PulleyBlock) else {*chain(p.body)} for p in cable.path]
    pairs = [(a, b) for a, b in pairwise(ways) if a is not None and b is not None]
    return set().union(*(a ^ b for a, b in pairs))
