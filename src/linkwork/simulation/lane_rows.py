"""Names of the rows in which the members in the lanes keep what becomes of them."""

# Rows of `now`; the first NUMBERS are kept of every member.
TIME, STEP_SIZE, PIVOT, CLOSURE_ERROR, REJECTED_PIVOT, REJECTED_RESIDUAL = range(6)
NUMBERS = 6
GROWTH, STEP, ARRIVAL, TARGET, LIVE, ERROR, RESIDUAL, LOWEST, ACCEPTS, WANTED, THETA = range(6, 17)
NOW = 17

# Rows of `tally`; the first COUNTS are kept of every member, too.
STATUS, EVALUATIONS, ACCEPTED, REJECTED, SAVED = range(5)
COUNTS = 5
CAUSE, PIECE, BREAK, MEMBER, REACHED, AILMENT = range(5, 11)
TALLY = 11
