"""Every hostile case is answered rightly, or refused with a reason that holds."""

from __future__ import annotations

import os

import pytest

import linkwork as lw

from tests.hostile.cases import SAMPLED, Case, cases
from tests.hostile.mechanisms import Subject, subjects
from tests.hostile.starts import NoStart, Start, start
from tests.hostile.tasks import TASKS, Setting, refusal_holds

EVERY = os.environ.get("LINKWORK_HOSTILE") == "all"
CASES = [*cases()] if EVERY else [*cases(SAMPLED, 3)]


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    "case",
    [pytest.param(one, marks=pytest.mark.xdist_group(one.subject)) for one in CASES],
    ids=str,
)
def test_a_hostile_case_is_answered_rightly_or_refused_truly(case: Case, tmp_path):
    subject, begin = subjects()[case.subject], None
    try:
        begin = started(subject, case)
        TASKS[case.task](Setting(subject, begin, case.method, case.seed, tmp_path))
    except lw.LinkworkError as error:
        refusal_holds(subject, begin, error)


def started(subject: Subject, case: Case) -> Start:
    """Return the start of a case, one in motion where the mechanism has none of its kind."""
    try:
        return start(subject, case.start, case.seed)
    except NoStart:
        return start(subject, "moving", case.seed)
