"""URDF, the model format of ROS, read: model, shapes -> reader;  sidecars hold the loops that URDF
has no place for."""

from linkwork.formats.urdf.reader import read_urdf as read

__all__ = ["read"]
