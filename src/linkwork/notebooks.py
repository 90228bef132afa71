"""Notebooks: objects that show themselves in them, with a picture and the facts."""


class Portrayed:
    """Let notebooks show an object as `linkwork.views.notebook` draws it."""

    def _repr_html_(self) -> str | None:
        """Return the object as HTML; None where it cannot be drawn, so that its text is shown."""
        from linkwork.views.notebook import html

        return html(self)
