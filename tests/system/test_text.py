"""Text of files cannot control a terminal, nor be markup in a report."""

from __future__ import annotations

from xml.etree import ElementTree

import pytest

from tiltsim.cli import main
from tiltsim.report.pages import markdown_cell
from tiltsim.system.text import printable, printable_html, printable_markdown

HOSTILE = "\x1b]0;owned\x07\x1b[2J\r\u202etxt.\x00\ud800\u2028\nok  <script>&\x9b1m"


def test_ordinary_text_stays_as_it_is():
    text = "Tränen, |α₁| <= 0.65 rad, 飛行, 🚁\u00a0x"
    assert printable(text) == printable_markdown(text) == text
    assert printable_html(text) == text.replace("<", "&lt;")


def test_hostile_text_is_one_line_of_visible_characters():
    shown = printable(HOSTILE)
    assert shown.isprintable()
    assert shown.startswith(r"\x1b]0;owned\x07\x1b[2J\r\u202etxt.\x00\ud800\u2028\nok  <script>")
    shown.encode()
    assert "<script" not in printable_html(HOSTILE) + printable_markdown(HOSTILE)
    assert markdown_cell("a|b\n<b>c") == "a\\|b<br>&lt;b>c"


@pytest.fixture
def hostile(tmp_path):
    """A scenario with terminal sequences in its title, its source and its file's name."""
    file = tmp_path / "a\x1b[2Jb.toml"
    escaped = "\\u001b]0;owned\\u0007\\u202e\\nok"
    file.write_text(
        f'title = "{escaped}"\nsource = "{escaped}"\n'
        "[simulation]\nduration = 0.01\ntimestep = 0.002\n",
        encoding="utf-8",
    )
    return file


def visible(text):
    return all(line.isprintable() for line in text.splitlines()) and "\r" not in text


def test_commands_show_hostile_titles_and_names_escaped(hostile, tmp_path, capsys):
    junit = tmp_path / "junit.xml"
    assert main(["run", str(hostile), "--out", str(tmp_path / "o\x1bt")]) == 0
    assert main(["check", str(hostile), str(hostile) + "#x\x1b", "--junit", str(junit)]) == 2
    assert main(["gait", str(hostile)]) == 0
    shown = capsys.readouterr()
    assert visible(shown.out)
    assert visible(shown.err)
    assert r"\x1b]0;owned\x07\u202e\nok" in shown.out
    names = [case.get("name") for case in ElementTree.parse(junit).iter("testcase")]
    assert names == [r"a\x1b[2Jb.toml", r"a\x1b[2Jb.toml#x\x1b"]
