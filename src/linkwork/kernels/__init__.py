"""CasADi functions compiled to straight-line machine code that evaluates several states at a time.

    casadi.Function --trace--> Program --simplify--> Program --emit--> LLVM instructions
    --compile--> machine code

The kernel that `compile_function` returns does it when it is first needed, for one state and for
many at a time apart, and keeps the machine code on disk. Where one state is needed before code is
worth compiling, a tape of the program is interpreted, to the same bits. Nothing here knows of
robots.
"""

from linkwork.kernels.kernel import PAYS, Kernel, compile_function
from linkwork.kernels.program import KernelError

__all__ = ["PAYS", "Kernel", "KernelError", "compile_function"]
