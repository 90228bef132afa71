"""What frameworks of automatic differentiation are given: a robot's functions of flat arrays, with
their derivatives of first and second order, each compiled when it is first asked for.

Nothing here asks for JAX or PyTorch.
"""

from linkwork.autodiff.array_function import ArrayFunction
from linkwork.autodiff.array_model import ArrayModel
from linkwork.autodiff.offered import Offered, functions_of

__all__ = ["ArrayFunction", "ArrayModel", "Offered", "functions_of"]
