"""What a run left at its end: whether what acts on the robot now can go on with it."""

from __future__ import annotations

from linkwork.errors import LinkworkError
from linkwork.runs.recording import Left
from linkwork.runs.system import System


def require_left(runs: System, left: Left) -> None:
    """Refuse extra states and held inputs that are not those of the drives and controllers that
    act: of another number, or of other names, where the run tells them."""
    own = [extra.name for extra in runs.extras]
    if left.extras.size != len(own):
        raise LinkworkError(
            f"the run ended with {left.extras.size} extra states, but these drives and "
            f"controllers have {len(own)}"
        )
    others = [(told, name) for told, name in zip(left.names, own, strict=False) if told != name]
    if others:
        told, name = others[0]
        raise LinkworkError(
            f"the run ended with the extra state {told!r}, where these drives and controllers have "
            f"{name!r}; go on with those that it ran with"
        )
    held = left.held
    if held is not None and runs.acting and runs.sampler and held.size != runs.acting.held:
        raise LinkworkError(
            f"the run ended with {held.size} held inputs, but this controller holds "
            f"{runs.acting.held}; give it the delay that it ran with"
        )
