"""The former name of `linkwork.lab.engines`."""

from linkwork.moved import leading_to

__getattr__ = leading_to(__name__, "linkwork.lab.engines")
