"""Every hostile case is answered rightly, or refused with a reason that holds."""

from __future__ import annotations

import os

import pytest

import linkwork as lw

from tests.hostile.cases import SAMPLED, Case, cases
from tests.hostile.mechanisms import subjects
from tests.hostile.starts import NoStart, start
from tests.hostile.tasks import TASKS, Setting, refusal_holds

EVERY = os.environ.get("LINKWORK_HOSTILE") == "all"
CASES = [*cases()] if EVERY else [*cases(SAMPLED, 6)]


@pytest.mark.parametrize(
    "case", [pytest.param(one, marks=pytest.mark.xdist_group(one.subject)) for one in CASES], ids=str
)
def test_a_hostile_case_is_answered_rightly_or_refused_truly(case: Case, tmp_path):
    subject, begin = subjects()[case.subject], None
    try:
        begin = start(subject, case.start, case.seed)
        TASKS[case.task](Setting(subject, begin, case.method, case.seed, tmp_path))
    except NoStart as reason:
        pytest.skip(f"{case}: {reason}")
    except lw.LinkworkError as error:
        refusal_holds(subject, begin, error)
