"""What ends the steps of a stepper."""

from linkwork.errors import LinkworkError
from linkwork.simulation import Status


class StepError(LinkworkError):
    """Tell why a step could not be taken, when, and what to do; the state before it is kept.

    status: as that of a run; time: [s] up to which the steps came
    """

    def __init__(self, sentence: object = "", status: Status = Status.FINISHED, time: float = 0.0):
        super().__init__(sentence)
        self.status, self.time = status, time
