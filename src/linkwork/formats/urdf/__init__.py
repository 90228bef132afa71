"""URDF, the model format of ROS, read: model, shapes -> reader;  sidecars hold the loops that URDF
has no place for; and written with them (writer)."""

from linkwork.formats.urdf.reader import read_urdf as read
from linkwork.formats.urdf.writer import write_urdf as write

__all__ = ["read", "write"]
