"""Of a test that is marked `sample(n)` all but n cases, evenly taken, are long."""

from types import SimpleNamespace

import pytest

from tests import conftest


@pytest.mark.parametrize(
    ("few", "count", "kept"), [(1, 4, [0]), (2, 5, [0, 2]), (3, 7, [0, 2, 4]), (3, 2, [0, 1])]
)
def test_cases_are_taken_evenly(few, count, kept):
    long = []
    cases = [
        SimpleNamespace(
            nodeid=f"tests/test_of_joints.py::test_rows[{number}-case[0]]",
            get_closest_marker=lambda name: getattr(pytest.mark, name)(few).mark,
            add_marker=lambda mark, number=number: long.append((number, mark.name)),
        )
        for number in range(count)
    ]
    other = SimpleNamespace(
        nodeid="tests/test_of_joints.py::test", get_closest_marker=lambda _: None
    )
    conftest.pytest_collection_modifyitems([*cases, other])
    assert long == [(number, "long") for number in range(count) if number not in kept]
