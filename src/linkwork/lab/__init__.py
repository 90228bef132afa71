"""The laboratory beside the library: other engines, the paper's own matrices, comparisons, and the
paper's study again.

What stands here checks Linkwork or is compared with it; nothing of it is needed to describe,
derive, compile or run. It asks the library, never the other way round (`tests/test_house.py`); the
command line alone has an entry to it. It is a package of the same distribution and the same name,
so that one version of the library and of its checks is installed, and one search finds both; the
engines themselves are the extra `linkwork[engines]`.

    engines        the same mechanism in Pinocchio, MuJoCo and Exudyn
    textbook       the paper's formulation line by line, in plain NumPy
    comparison     one motion by several ways
    overlays       pictures of a comparison
    precision      work-precision diagrams
    reproduction   the paper's study, as `linkwork reproduce` carries it out
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from linkwork.lab import comparison, engines, overlays, precision, reproduction, textbook

__all__ = ["comparison", "engines", "overlays", "precision", "reproduction", "textbook"]


def __getattr__(name: str) -> Any:
    if name in __all__:
        return import_module(f"{__name__}.{name}")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
