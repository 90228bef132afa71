"""A report on a narrow screen, in a real browser: nothing lies beyond it that cannot be scrolled
to, and what is written about a picture or table is seen whole."""

import pytest

from linkwork.views import write_report

from tests.viewer.browser import launch

sync = pytest.importorskip("playwright.sync_api")

BEYOND = """() => [...document.querySelectorAll('body *')].filter((element) => {
  if (element.getBoundingClientRect().right <= innerWidth + 1) return false;
  for (let at = element.parentElement; at; at = at.parentElement)
    if (['auto', 'scroll'].includes(getComputedStyle(at).overflowX)) return false;
  return true;
}).map((element) => element.outerHTML.slice(0, 80))"""
WRITTEN = """() => [...document.querySelectorAll('caption span, figcaption')].map(
  (element) => element.getBoundingClientRect().right)"""


@pytest.mark.long
def test_a_report_at_390_px_loses_nothing(robot, run, tmp_path):
    path = write_report(robot, run, tmp_path / "run.html")
    with sync.sync_playwright() as playwright:
        browser = launch(playwright)
        page = browser.new_page(viewport={"width": 390, "height": 844})
        page.goto(path.as_uri())
        assert page.evaluate("document.documentElement.scrollWidth") == 390
        assert page.evaluate(BEYOND) == []
        ends = page.evaluate(WRITTEN)
        browser.close()
    assert len(ends) > 10 and max(ends) <= 390
