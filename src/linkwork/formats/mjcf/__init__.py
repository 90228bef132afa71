"""MJCF, the model format of MuJoCo, read and written.

read     document -> tree, geoms -> joints -> loops -> reader;  survey says what is left out,
         flattening has MuJoCo write out what no reader here does
write    plan (how MJCF holds a mechanism) -> writer: bodies, ties, lines, fluid on one sheet;
         differences says what MuJoCo takes otherwise
"""

from linkwork.formats.mjcf.reader import read_mjcf as read
from linkwork.formats.mjcf.writer import write_mjcf as write

__all__ = ["read", "write"]
