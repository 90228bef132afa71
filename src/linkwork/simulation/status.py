"""Every way in which a run can end, each with a sentence for the user."""

from enum import IntEnum


class Status(IntEnum):
    """Name how a run ended.

    The numbers are part of the compiled loop (`native`), which is cached on disk: add new ones,
    never renumber.
    """

    FINISHED = 0
    SINGULAR = 1
    CLOSURE_LOST = 2
    STEP_UNDERFLOW = 3
    TOO_MANY_STEPS = 4
    NON_FINITE = 5
    EVENT = 6
    CALLBACK_FAILED = 7
    CANCELLED = 8
    STIFF = 9

    def sentence(self, **facts: float | str) -> str:
        """Return this ending as one sentence; `facts` are what its template names (times in s)."""
        return _SENTENCES[self].format(**DEFAULTS | facts)


DEFAULTS = {
    "fault_source": "what the equations of motion return",
    "remedy": 'or take method="rodas" where a spring, damper, dry friction (at rates below its '
    "coulomb_rate), drive or"
    " controller is stiff",
}
_SENTENCES = {
    Status.FINISHED: "The run reached its end at t = {time:.9g} s.",
    Status.SINGULAR: (
        "The run stopped at t = {time:.9g} s: from here the chosen independent rates do not "
        "determine the others (smallest relative pivot {rejected_pivot:.2g}, bound "
        "{pivot_bound:.2g}); the pose is singular, or needs other independent coordinates."
    ),
    Status.CLOSURE_LOST: (
        "The run stopped at t = {time:.9g} s: the loops do not close any more (residual "
        "{rejected_residual:.2g} after Newton's method, wanted {closure_tol:.2g}), however small "
        "the step; the mechanism cannot be assembled beyond this pose, or closure_tol lies below "
        "rounding."
    ),
    Status.STEP_UNDERFLOW: (
        "The run stopped at t = {time:.9g} s: the error stays above the tolerance however small "
        "the step (next would be {step:.2g} s); the motion breaks off here, or rtol and atol lie "
        "below rounding."
    ),
    Status.TOO_MANY_STEPS: (
        "The run stopped at t = {time:.9g} s: it used up max_steps = {max_steps:d} steps (step "
        "size now {step:.2g} s); allow more, loosen rtol and atol, {remedy}."
    ),
    Status.NON_FINITE: (
        "The run stopped at t = {time:.9g} s: {fault_source} is infinite or undefined from here "
        "on, "
        "however small the step (next would be {step:.2g} s)."
    ),
    Status.EVENT: "The run was ended by event {event:d} (counted from 0) at t = {time:.9g} s.",
    Status.CALLBACK_FAILED: (
        "The run stopped at t = {time:.9g} s: a function that it calls raised {error}."
    ),
    Status.CANCELLED: "The run was cancelled at t = {time:.9g} s.",
    Status.STIFF: (
        "The run was left at t = {time:.9g} s: it is stiff there, stability bounds the steps "
        "({step:.2g} s) of an explicit method, not the tolerance."
    ),
}
