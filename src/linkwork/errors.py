"""The one exception, and the one warning, a user of Linkwork has to know."""


class LinkworkError(ValueError):
    """Refuse an input in one sentence: what is wrong, where, and what would be accepted."""

    def __init__(self, sentence: object = ""):
        super().__init__(" ".join(part.strip() for part in str(sentence).splitlines()))


class ModelWarning(UserWarning):
    """Tell how a mechanism moves otherwise than the model file that it was read from says, that its
    home is beside a reference at which branches meet, that joints lead beyond a singular pose, that
    a run begins where a cable leaps, that steps of a stepper are too long where it begins, or that
    a motion passes where its actuators do not hold it, or has few samples for what follows it."""
