"""Stiff steps on trial: a run that leaves explicit steps because stability bounds them goes back
where stiff ones are not longer by as much as they are dearer.

So it is where a large mechanism swings as fast as its springs let it: accuracy, too, then asks for
short steps, and each takes the Jacobian by all states and its factors, of hundreds of columns.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from linkwork.simulation import Method, Trajectory

STEPS = 64  # of a trial, in which a step grows to its own size from any first one
DEAR = 4  # states for which one stiff step costs as much as an explicit one
REST = 4  # times what a trial costs, until the next one


class Trial(NamedTuple):
    """Hold how a run stands between the two kinds of steps.

    left: the explicit step that stiff ones are tried in place of [s], 0 where none are
    waits: explicit steps until they may be left again
    """

    left: float = 0.0
    waits: int = 0

    def portion(self, most: int) -> int:
        """Return after how many steps, at most so many, it is to be judged."""
        return min(most, STEPS if self.left else self.waits or most)

    def onward(self, done: Trajectory, explicit: Method) -> dict[str, Any]:
        """Return what of a stand changes at the end of a portion of its steps."""
        dearer = max(1.0, done.y_end.size / DEAR)
        if not done.next_step < dearer * self.left:
            return {"pace": done.pace, "trial": Trial(waits=max(0, self.waits - done.steps))}
        rest = Trial(waits=int(REST * dearer * STEPS))
        return {"method": explicit, "first_step": self.left, "trial": rest}
