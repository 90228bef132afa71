"""What is no XML by the letter, and what the readers of MuJoCo and of ROS (TinyXML) take all the
same: files from hands and from old exporters.

Bytes that are no UTF-8 (Windows' letters in names and comments), empty lines before the
declaration, words before the first element, two hyphens in a comment, <! ...> that is none, a lone
& in a name, attributes without a space between them, characters that print nothing. The text stays
in its lines; entities and document types stay what they are.
"""

from __future__ import annotations

import re

DECLARATION = re.compile(r"\s*<\?xml\b[^>]*\?>")
ENCODING = re.compile(rb"""<\?xml\b[^>]*\bencoding\s*=\s*["']([^"']+)["']""")
LONE = re.compile(r"&(?![#\w]+;)")
TOUCHING = re.compile(r"""(=\s*(?:"[^"<]*"|'[^'<]*'))(?=[\w:])""")
UNPRINTED = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f]")
ODD = re.compile(r"<!(?!--|DOCTYPE|ENTITY|\[CDATA\[)[^>]*>")
LETTERS = ("utf-8-sig", "cp1252", "latin-1")
WIDE = (b"\xff\xfe", b"\xfe\xff")  # how UTF-16 begins


def mended(data: bytes) -> bytes | None:
    """Return well-formed XML in UTF-8 of what others read as XML, line by line; None where the
    encoding is one of its own."""
    named = ENCODING.match(data.removeprefix(b"\xef\xbb\xbf").lstrip())
    own = named and named[1].lower() not in (b"utf-8", b"utf8", b"ascii", b"us-ascii")
    if own or data[:2] in WIDE:
        return None
    text = _decoded(data)
    if before := DECLARATION.match(text):
        text = _lines(before[0]) + text[before.end() :]
    start = max(text.find("<"), 0)
    text = _lines(text[:start]) + text[start:]
    text = ODD.sub(lambda odd: _lines(odd[0]), _without_comments(text))
    return TOUCHING.sub(r"\1 ", UNPRINTED.sub(" ", LONE.sub("&amp;", text))).encode()


def _decoded(data: bytes) -> str:
    """Return the text of bytes, in the first encoding that has them all."""
    for letters in LETTERS[:-1]:
        try:
            return data.decode(letters)
        except UnicodeDecodeError:
            continue
    return data.decode(LETTERS[-1])


def _without_comments(text: str) -> str:
    """Return a text without its comments, which may have any hyphens inside."""
    parts, at = [], 0
    while (start := text.find("<!--", at)) >= 0 and (end := text.find("-->", start + 4)) >= 0:
        parts += [text[at:start], _lines(text[start:end])]
        at = end + 3
    return "".join([*parts, text[at:]])


def _lines(text: str) -> str:
    """Return the line ends of what is taken out."""
    return "\n" * text.count("\n")
