"""The former name of `linkwork.viewer`."""

from linkwork.moved import leading_to

__getattr__ = leading_to(__name__, "linkwork.viewer")
