"""The one exception, and the one warning, a user of Linkwork has to know."""


class LinkworkError(ValueError):
    """Refuse an input in one sentence: what is wrong, where, and what would be accepted."""


class ModelWarning(UserWarning):
    """Tell how a mechanism moves otherwise than the model file that it was read from says."""
