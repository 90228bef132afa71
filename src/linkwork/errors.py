"""The one exception a user of Linkwork has to know."""


class LinkworkError(ValueError):
    """Refuse an input in one sentence: what is wrong, where, and what would be accepted."""
