"""The built site, build/site: every link leads somewhere, and nothing comes from the network."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from urllib.parse import unquote

import pytest

from tests.docs.pages import ROOT

pytestmark = pytest.mark.site

SITE = ROOT / "build" / "site"
REMOTE = re.compile(r"^(?:[a-z]+:)?//")
LOADED = {"script", "img", "source", "video", "audio", "iframe", "embed", "object", "track"}
"""Elements whose ``src`` or ``data`` is loaded with the page; so is the ``href`` of a link."""


class Page(HTMLParser):
    """The ids of a page, its links, and the files that it loads."""

    def __init__(self, path):
        super().__init__()
        self.ids, self.links, self.loaded = set(), set(), set()
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attributes):
        given = dict(attributes)
        self.ids |= {given[key] for key in ("id", "name") if given.get(key)}
        if tag == "a" and given.get("href"):
            self.links.add(given["href"])
        if tag == "link" and {"stylesheet", "icon", "preload"} & {*given.get("rel", "").split()}:
            self.loaded.add(given["href"])
        if tag in LOADED:
            self.loaded |= {given[key] for key in ("src", "data", "poster") if given.get(key)}


@pytest.fixture(scope="module")
def pages():
    found = {path: Page(path) for path in sorted(SITE.rglob("*.html"))}
    assert len(found) > 30, "build the site first, as CONTRIBUTING.md says"
    return found


def dead(path, link, pages):
    """Whether a link leads to no file of the site, or to no place in it."""
    file, _, anchor = unquote(link).partition("#")
    target = (path.parent / file.partition("?")[0]).resolve() if file else path
    target = target / "index.html" if target.is_dir() else target
    place = anchor in pages[target].ids if anchor and target in pages else True
    return not (target.is_file() and place)


def test_every_link_leads_somewhere(pages):
    assert [
        f"{path.relative_to(SITE)}: {link}"
        for path, page in pages.items()
        for link in sorted(page.links | page.loaded)
        if not re.match(r"[a-z]+:", link) and dead(path, link, pages)
    ] == []


def test_nothing_is_loaded_from_the_network(pages):
    loaded = {link for page in pages.values() for link in page.loaded}
    assert [link for link in loaded if REMOTE.match(link)] == []
    sheets = {path: path.read_text(encoding="utf-8") for path in SITE.rglob("*.css")}
    urls = {
        url for text in sheets.values() for url in re.findall(r"url\(\s*['\"]?([^)'\"]+)", text)
    }
    imports = {
        url for text in sheets.values() for url in re.findall(r"@import\s*['\"](.*?)['\"]", text)
    }
    assert sheets
    assert [url for url in urls | imports if REMOTE.match(url)] == []


def test_notebooks_have_their_pictures(pages):
    for name in ("fly_and_look", "design_a_gait", "compare_controllers"):
        page = pages[SITE / "notebooks" / f"{name}.html"]
        assert sum(link.endswith(".png") for link in page.loaded) >= 2
