"""Every link of README, docs and notebooks leads somewhere, here and on the site."""

from __future__ import annotations

import re
from urllib.parse import unquote

import pytest

import tiltsim
from tests.docs.pages import NOTEBOOKS, PAGES, ROOT, anchors, links
from tiltsim.folders import CONTROLLERS

DOCS = ROOT / "docs"
API = DOCS / "api"


def dead_links(page):
    for link in links(page):
        if re.match(r"[a-z]+:", link):
            continue
        path, _, anchor = unquote(link).partition("#")
        target = (page.parent / path).resolve() if path else page
        if not target.is_relative_to(ROOT) or not target.exists():
            yield f"{link}: no such file"
        elif anchor and anchor not in anchors(target):
            yield f"{link}: no such heading"


@pytest.mark.parametrize("page", [*PAGES, *NOTEBOOKS], ids=lambda page: page.name)
def test_links_lead_somewhere(page):
    assert [*dead_links(page)] == []


def test_a_dead_link_is_noticed(tmp_path, monkeypatch):
    monkeypatch.setattr("tests.docs.test_links.ROOT", tmp_path)
    page = tmp_path / "page.md"
    page.write_text(
        "# A `key`, and more\n[x](#a-key-and-more) [y](#key) [z](none.md) [w](..)\n"
        '[![p](p.png)](page.md)\n<img width="3" src="q.gif">\n`[code](no)`\n'
        "```\n# no heading\n[code](no)\n```\n[web](https://example.org/a#b)\n"
    )
    dead = [line.partition(":")[0] for line in dead_links(page)]
    assert sorted(dead) == ["#key", "..", "none.md", "p.png", "q.gif"]


def test_every_page_is_in_the_contents_of_the_site():
    listed = [
        contents.parent / entry
        for contents in (DOCS / "index.md", API / "index.md")
        for entry in re.findall(r"^[\w/]+$", contents.read_text(), re.MULTILINE)
    ]
    pages = [page.with_suffix("") for page in [*NOTEBOOKS, *DOCS.glob("**/*.md")]]
    assert sorted([DOCS / "index", *listed]) == sorted(pages)


def test_every_public_name_is_in_the_api_reference():
    text = (API / "tiltsim.md").read_text()
    documented = re.findall(r"^\.\. auto\w+:: tiltsim\.(\w+)$", text, re.MULTILINE)
    assert sorted(documented) == sorted(tiltsim.__all__)
    assert {*CONTROLLERS} <= {page.stem for page in API.glob("*.md")}


def test_the_tests_that_the_security_page_names_exist():
    rows = (ROOT / "SECURITY.md").read_text(encoding="utf-8").partition("Such Python code")[0]
    named = set(re.findall(r"`(test_\w+)`", rows))
    sources = (file.read_text(encoding="utf-8") for file in (ROOT / "tests").rglob("test_*.py"))
    known = {name for text in sources for name in re.findall(r"def (test_\w+)", text)}
    assert len(named) >= 10
    assert named <= known
    _heading, _line, *table = [row for row in rows.splitlines() if row.startswith("|")]
    assert [row for row in table if "test_" not in row.split("|")[3]] == []
