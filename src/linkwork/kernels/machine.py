"""The machine that runs a kernel: what its vector registers hold and which instructions it has."""

from dataclasses import dataclass, replace
from functools import cache

import llvmlite
import llvmlite.binding as llvm


@dataclass(frozen=True)
class Machine:
    """A processor, by LLVM's names for its triple, its model and its features
    ("+avx2,-avx512f,...").

    widest: doubles of a vector register that are used at most
    """

    triple: str
    cpu: str
    features: str
    widest: int = 8

    @property
    def lanes(self) -> int:
        """Doubles per vector register: 8 with AVX-512, 4 with AVX2, else 2."""
        return min(self.widest, 8 if self._has("avx512f") else 4 if self._has("avx2") else 2)

    @property
    def for_single_numbers(self) -> "Machine":
        """The same processor, with vectors of 4 doubles at most.

        One product of 8 doubles makes a hundred single ones after it take up to three times as
        long on processors whose two units for products join into one for AVX-512.
        """
        return replace(self, widest=min(self.widest, 4))

    @property
    def has_fma(self) -> bool:
        """Whether it multiplies and adds in one instruction with one rounding."""
        return self._has("fma") or self.triple.startswith(("aarch64", "arm64"))

    @property
    def has_memory_operands(self) -> bool:
        """Whether arithmetic takes an operand from memory, as on x86, so that a constant needs no
        instruction of its own."""
        return self.triple.startswith("x86")

    @property
    def has_broadcast_operands(self) -> bool:
        """Whether that operand may be one number for all lanes, as with AVX-512."""
        return self.has_memory_operands and self._has("avx512f")

    @property
    def attributes(self) -> str:
        """Attributes of every LLVM function.

        LLVM is to use the whole width of AVX-512, not half of it as by default, and to align the
        stack to a vector register before it spills any there: by default it aligns to 16 bytes, and
        longer vectors would cross cache lines.
        """
        wide = (
            ' "prefer-vector-width"="512" "min-legal-vector-width"="512"' if self.lanes == 8 else ""
        )
        aligned = f" alignstack({8 * self.lanes})" if self.lanes > 2 else ""
        return f"nounwind{aligned}{wide}"

    @property
    def identity(self) -> str:
        """All that machine code depends on besides the program."""
        return "\n".join((self.triple, self.cpu, self.features, llvmlite.__version__))

    def _has(self, feature: str) -> bool:
        return f"+{feature}" in self.features.split(",")


@cache
def this_machine() -> Machine:
    """Return the machine this process runs on."""
    try:
        features = llvm.get_host_cpu_features().flatten()
    except RuntimeError:  # LLVM knows no way to ask this processor
        features = ""
    return Machine(llvm.get_process_triple(), llvm.get_host_cpu_name(), features)
