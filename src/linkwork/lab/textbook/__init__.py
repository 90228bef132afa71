"""The paper's formulation line by line: plain NumPy, slow, readable, and a check of the compiled
one."""

from linkwork.lab.textbook.formulation import Textbook

__all__ = ["Textbook"]
