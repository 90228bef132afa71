"""Moments of members that are gathered chunk by chunk are those of all of them at once."""

import numpy as np
import pytest

from linkwork.sweeps.report import MemberMoments


@pytest.mark.parametrize("nothing", [(), (0,), (17,), (39,), (3, 22)])
@pytest.mark.parametrize("chunk", [1, 7, 20])
def test_chunks_come_to_what_all_members_come_to(chunk, nothing):
    """Also where an output of some members is no number: its least and largest are none, either,
    whichever chunk they are in."""
    table, members = np.random.default_rng(8).normal(size=(40, 3)), 5 + np.arange(40)
    table[[*nothing], 1] = np.nan
    parts = [slice(first, first + chunk) for first in range(0, 40, chunk)]
    found, *others = (MemberMoments.of(table[part], members[part]) for part in parts)
    for other in others:
        found = found + other
    whole = MemberMoments.of(table, members)
    for name in ("least", "largest", "at"):
        np.testing.assert_array_equal(getattr(found, name), getattr(whole, name))
    for name in ("count", "mean", "product"):
        np.testing.assert_allclose(getattr(found, name), getattr(whole, name), atol=1e-12)
