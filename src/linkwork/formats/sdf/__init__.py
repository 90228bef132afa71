"""SDF, the model format of Gazebo and Drake, read: scopes (what is where) -> links, joints ->
reader; and written (writer)."""

from linkwork.formats.sdf.reader import read_sdf as read
from linkwork.formats.sdf.writer import write_sdf as write

__all__ = ["read", "write"]
