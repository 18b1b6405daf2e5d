"""The report as people see it: on a phone, and with eyes that need contrast."""

import pytest

from automos.results.open_run import open_run
from automos.views.report import write_report

pytestmark = pytest.mark.browser

CONTRASTS = """
const channel = (v) => (v /= 255) <= 0.03928 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4;
const luminance = (c) => 0.2126 * channel(c[0]) + 0.7152 * channel(c[1]) + 0.0722 * channel(c[2]);
const parse = (text) => { const n = text.match(/[\\d.]+/g).map(Number); return n.length < 4 ? [...n, 1] : n; };
const behind = (node) => {
  for (let at = node; at; at = at.parentElement) {
    const color = parse(getComputedStyle(at).backgroundColor);
    if (color[3] > 0.9) return color;
  }
  return [255, 255, 255, 1];
};
const found = {};
const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
while (walker.nextNode()) {
  const node = walker.currentNode.parentElement, text = walker.currentNode.textContent.trim();
  if (!text || /^(SCRIPT|STYLE)$/.test(node.tagName) || !node.getClientRects().length) continue;
  const style = getComputedStyle(node);
  const ink = luminance(parse(node.closest("svg") ? style.fill : style.color)), paper = luminance(behind(node));
  found[text.slice(0, 30)] = (Math.max(ink, paper) + 0.05) / (Math.min(ink, paper) + 0.05);
}
return found;
"""


@pytest.fixture
def page(browser, lane_run, tmp_path):
    """Return the browser with a report opened."""
    write_report(open_run(lane_run), tmp_path / "report.html")
    browser.get((tmp_path / "report.html").as_uri())
    assert browser.find_element("tag name", "body").get_attribute("data-ready") == "true"
    return browser


def test_every_text_stands_out_from_what_is_behind_it(page):
    contrasts = page.execute_script(CONTRASTS)
    assert len(contrasts) > 30
    assert {text: round(value, 2) for text, value in contrasts.items() if value < 4.5} == {}


def test_on_a_phone_the_page_is_as_wide_as_the_phone_and_its_tables_scroll(page):
    phone = {"width": 390, "height": 844, "deviceScaleFactor": 1, "mobile": True}
    page.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", phone)
    try:
        assert page.execute_script("return document.documentElement.scrollWidth") <= 390
        inner, outer = page.execute_script(
            "const box = document.querySelector('#tracks .scroll'); return [box.scrollWidth, box.clientWidth]"
        )
        assert inner > outer  # there is more than is seen ...
        scrolled = page.execute_script(
            "const box = document.querySelector('#tracks .scroll'); box.scrollLeft = 80; return box.scrollLeft"
        )
        assert scrolled == 80  # ... and a finger gets to it
    finally:
        page.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
