"""Names of the tables of the members in the lanes, and of the rows that tell what becomes of
them."""

from typing import Any, NamedTuple


class Tables(NamedTuple):
    """Where the lanes compute; rows as in `lanes`.

    `y`: states at the starts of the steps; `x`: (y, u, p); `k`: (y', pivot), stage after stage;
    `z`: (q, p); `z_next`: what the closure gives; `sample`: a state within, or the defect;
    `weights`, one for each stage; `scale`: rtol, then atol; `zeros`, as many as a state has;
    `spans`, `wraps`, `turned`, of the angles' whole turns; `kept`: states set aside; `now`,
    `tally`: numbers and counts of the members. A state has n numbers, of which nq are q.
    """

    y: Any
    x: Any
    k: Any
    z: Any
    z_next: Any
    sample: Any
    weights: Any
    scale: Any
    zeros: Any
    spans: Any
    wraps: Any
    turned: Any
    kept: Any
    now: Any
    tally: Any
    n: int
    nq: int


# Rows of `now`; the first NUMBERS are kept of every member.
TIME, STEP_SIZE, PIVOT, CLOSURE_ERROR, REJECTED_PIVOT, REJECTED_RESIDUAL, LOOSE = range(7)
NUMBERS = 7
(
    GROWTH,
    LONGEST,
    IDEAL,
    STEP,
    ARRIVAL,
    TARGET,
    LIVE,
    ERROR,
    RESIDUAL,
    LOWEST,
    ACCEPTS,
    WANTED,
    THETA,
    LEAST,
    PEAKS,
) = range(7, 22)
NOW = 22

# Rows of `tally`; the first COUNTS are kept of every member, too.
STATUS, EVALUATIONS, ACCEPTED, REJECTED, SAVED = range(5)
COUNTS = 5
CAUSE, PIECE, BREAK, BEND, MEMBER, REACHED, AILMENT, STIFFLY = range(5, 13)
TALLY = 13
