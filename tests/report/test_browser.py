"""The page in a browser: filter, search and links to rows, and that it fits narrow screens.

Chromium runs without a display; a script in a copy of the page acts and writes what it sees.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from html import unescape

import pytest

from tiltsim.report.making import Made
from tiltsim.report.pages import page

NAMES = ("chromium", "chromium-browser", "google-chrome")
CHROMIUM = next(filter(None, map(shutil.which, NAMES)), "")

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not CHROMIUM, reason="Chromium is not installed"),
]

LOOK = """
const seen = () => ({
  rows: [...document.querySelectorAll(".row")].filter((r) => r.checkVisibility()).map((r) => r.id),
  found: form.elements.found.textContent,
});
const set = (name, value) => {
  form.elements[name].value = value;
  form.dispatchEvent(new Event("input", { bubbles: true }));
};
const result = {};
%s
const out = document.createElement("pre");
out.id = "result";
out.textContent = JSON.stringify(result);
document.body.append(out);
"""


@pytest.fixture(scope="module")
def text(report):
    return page(report, Made.now())


@pytest.fixture
def run(text, tmp_path):
    """Run a script at the end of the page, which fills ``result``."""

    def act(script, fragment=""):
        file = tmp_path / "page.html"
        script = f"<script>{LOOK % script}</script></body>"
        file.write_text(text.replace("</body>", script), encoding="utf-8")
        done = subprocess.run(
            (
                CHROMIUM, "--headless=new", "--no-sandbox", "--disable-gpu", "--dump-dom",
                f"--user-data-dir={tmp_path}/profile", "--window-size=1400,900",
                f"{file.as_uri()}#{fragment}",
            ),
            capture_output=True, text=True, timeout=300.0, check=True,
        )  # fmt: skip
        found = re.search(r'<pre id="result">(.*?)</pre>', done.stdout, re.DOTALL)
        assert found, done.stderr
        return json.loads(unescape(found[1]))

    return act


def ids(report, verdict=""):
    return {row.claim.id for row in report.rows if verdict in {"", row.verdict.name}}


def test_verdicts_words_and_chapters_filter_the_rows(run, report):
    result = run(
        """
        result.all = seen();
        for (const box of form.elements.verdict) box.checked = box.value === "not-reproduced";
        set("words", "");
        result.failed = seen();
        for (const box of form.elements.verdict) box.checked = true;
        set("words", "stays TILTED");
        result.words = seen();
        set("words", "");
        set("chapter", "6");
        result.chapter = seen();
        set("chapter", "");
        set("origin", "gains");
        result.origin = seen();
        """
    )
    assert set(result["all"]["rows"]) == ids(report)
    assert result["all"]["found"] == f"{len(report.rows)} rows"
    assert set(result["failed"]["rows"]) == ids(report, "NOT_REPRODUCED")
    assert result["failed"]["found"] == f"2 of {len(report.rows)} rows"
    assert [name[-6:] for name in result["words"]["rows"]] == ["tilted"]
    assert {name[:3] for name in result["chapter"]["rows"]} == {"ch6"}
    assert result["origin"]["rows"] == []


def test_failures_come_first_on_demand_and_the_order_comes_back(run):
    result = run(
        """
        const boxes = () => [...document.querySelectorAll("#chapter-4 .claim")];
        const ranks = () => boxes().map((box) => +box.dataset.rank);
        result.before = ranks();
        set("order", "failures");
        result.first = ranks();
        set("order", "");
        result.again = ranks();
        """
    )
    assert result["first"] == sorted(result["before"], reverse=True) != result["before"]
    assert result["again"] == result["before"]


def test_a_link_opens_its_row(run, report):
    name = report.rows[0].claim.id
    result = run(f'result.open = document.getElementById("{name}").open;', fragment=name)
    assert result["open"]


@pytest.mark.parametrize("width", [420, 1000, 1400])
def test_nothing_is_wider_than_the_screen(run, width):
    """In a frame, since Chromium's own window is never narrower than 500 pixels."""
    result = run(
        f"""
        const whole = document.documentElement.outerHTML.replace(/<script>[^]*/, "");
        const frame = document.createElement("iframe");
        frame.width = {width};
        document.body.append(frame);
        const inner = frame.contentDocument;
        inner.write(whole);
        inner.close();
        for (const box of inner.querySelectorAll("details")) box.open = true;
        result.client = inner.documentElement.clientWidth;
        result.scroll = inner.documentElement.scrollWidth;
        """
    )
    assert width - 20 <= result["client"] <= width
    assert result["scroll"] <= result["client"]
