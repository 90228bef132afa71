"""Ready decision processes, each with the robot of the catalogue that it is for."""

from linkwork.gym.catalogue._balancing import balancing
from linkwork.gym.catalogue._reaching import reaching
from linkwork.gym.catalogue._swinging_up import swinging_up

__all__ = ["balancing", "reaching", "swinging_up"]
