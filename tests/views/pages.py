"""Read pages as a browser would: what they hold and refer to."""

import re
from html.parser import HTMLParser


class Reader(HTMLParser):
    """Gather what a page holds and refers to; every element that is opened is to be closed."""

    VOID = frozenset({"meta", "br", "link", "img", "hr", "input"})

    def __init__(self, text):
        super().__init__()
        self.references, self.identifiers, self.tags, self.open, self.words = [], [], [], [], []
        self.feed(text)
        self.close()

    def handle_data(self, data):
        if not {"script", "style", "svg"} & set(self.open):
            self.words.append(data)

    @property
    def text(self):
        """Return what is read on the page, in single spaces."""
        return " ".join(" ".join(self.words).split())

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        if tag not in self.VOID:
            self.open.append(tag)
        for name, value in attrs:
            if name in ("src", "href", "xlink:href", "action", "data", "poster", "srcset"):
                self.references.append(value)
            if name == "id":
                self.identifiers.append(value)
            self.references += re.findall(r"url\((.*?)\)", value or "")

    def handle_startendtag(self, tag, attrs):
        self.handle_starttag(tag, attrs)
        self.handle_endtag(tag)

    def handle_endtag(self, tag):
        if tag not in self.VOID:
            assert self.open.pop() == tag
