"""SDF, the model format of Gazebo and Drake, read: scopes (what is where) -> links, joints ->
reader."""

from linkwork.formats.sdf.reader import read_sdf as read

__all__ = ["read"]
