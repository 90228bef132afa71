"""Kernels in these tests are cached in a folder of their own, and are compiled at once."""

import pytest


@pytest.fixture(autouse=True, scope="package")
def own_cache(tmp_path_factory: pytest.TempPathFactory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("LINKWORK_CACHE_DIR", str(tmp_path_factory.mktemp("kernels")))
        yield


@pytest.fixture(autouse=True)
def compiled(code_at_once: None) -> None:
    """What is tested is code."""
