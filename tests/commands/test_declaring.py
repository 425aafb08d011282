"""Commands from the signatures and docstrings of functions."""

from __future__ import annotations

import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import pytest

from tiltsim.cli import Parser, build_parser, main
from tiltsim.commands.declaring import Option, call, declare
from tiltsim.commands.options import file_in, refuse_both
from tiltsim.commands.text import markdown_table, table
from tiltsim.errors import InputError


@dataclass(frozen=True, kw_only=True)
class Style:
    """A group.

    Args:
        width (MM): width of the line
    """

    width: float = 1.0


@dataclass(frozen=True, kw_only=True)
class DashedStyle(Style):
    """A group that extends another.

    Args:
        dash: kind of dash
    """

    dash: Literal["dot", "long"] | None = None


def pair(text):
    if ":" not in text:
        raise ValueError("write A:B")
    return tuple(text.split(":"))


def command(
    first: str,
    others: tuple[int, ...] = (),
    *,
    pairs: Annotated[tuple[tuple[str, str], ...], Option("--pair", pair)] = (),
    corner: tuple[float, float] | None = None,
    legs: tuple[tuple[str, ...], ...] = (),
    out: Path | None = None,
    dry_run: bool = False,
    style: DashedStyle,
) -> int:
    """Do something.

    At length.

    Note:
        exit codes: 7

    Args:
        first (FIRST): the first, 100 %% of it
        corner (X Y): a point
        legs (WORD): a leg; it
            continues here
    """
    assert isinstance(style, DashedStyle)
    command.given = (first, others, pairs, corner, legs, out, dry_run, style)
    return 7


@pytest.fixture
def given():
    parser = Parser(prog="command")
    declare(parser, command)

    def parse(*words):
        parsed = parser.parse_args(words)
        assert call(parsed.command, parsed) == 7
        return command.given

    parse.help = parser.format_help()
    return parse


def test_defaults_come_from_the_signature(given):
    assert given("a") == ("a", (), (), None, (), None, False, DashedStyle())


def test_types_tell_how_values_are_read(given):
    words = ["a", "1", "2", "--pair", "b:c", "--pair", "d:e", "--corner", "-0.5", "1"]
    words += ["--leg", "x", "y", "--leg", "z", "--out", "f", "--dry-run"]
    words = [word.replace("--leg", "--legs") for word in words]
    found = given(*words, "--width", "2", "--dash", "dot")
    style = DashedStyle(width=2.0, dash="dot")
    pairs, legs = (("b", "c"), ("d", "e")), (("x", "y"), ("z",))
    assert found == ("a", (1, 2), pairs, (-0.5, 1.0), legs, Path("f"), True, style)


def test_repeated_calls_do_not_share_lists(given):
    given("a", "--pair", "b:c")
    assert given("a")[2] == ()


@pytest.mark.parametrize(
    ("words", "line"),
    [
        ([], "the following arguments are required: FIRST"),
        (["a", "b"], "argument others: invalid int value: 'b'"),
        (["a", "--dash", "short"], "argument --dash: invalid choice: 'short'"),
        (["a", "--corner", "1"], "argument --corner: expected 2 arguments"),
        (["a", "--no"], "unrecognized arguments: --no"),
    ],
)
def test_mistakes_are_one_line(given, words, line, capsys):
    with pytest.raises(SystemExit) as stopped:
        given(*words)
    assert stopped.value.code == 2
    error = capsys.readouterr().err
    assert error.startswith(f"tiltsim: {line}")
    assert error.count("\n") == 1


def test_a_reader_names_the_option_and_the_value(given):
    with pytest.raises(InputError, match=r"^--pair b: write A:B$"):
        given("a", "--pair", "b")
    with pytest.raises(InputError, match=r"^--pair '': write A:B$"):
        given("a", "--pair", "")


def test_the_help_comes_from_the_docstrings(given):
    text = " ".join(given.help.split())
    for part in (
        "Do something. At length.",
        "FIRST the first, 100 % of it",
        "--corner X Y a point",
    ):
        assert part in text
    assert "a leg; it continues here" in text
    assert "style: --width MM width of the line --dash {dot,long} kind of dash" in text
    assert text.endswith("exit codes: 7")
    assert "Args" not in text


def test_every_argument_of_every_command_has_a_help(capsys):
    (commands,) = (action for action in build_parser()._actions if action.dest == "==SUPPRESS==")
    bare = [
        f"{name} {argument.dest}"
        for name, parser in commands.choices.items()
        for argument in parser._actions
        if not argument.help
    ]
    assert bare == []


def test_the_help_lists_every_command_once_in_a_group(capsys):
    with pytest.raises(SystemExit):
        main(["--help"])
    text = capsys.readouterr().out
    groups = [line for line in text.splitlines() if line.endswith(":") and line[0] != " "]
    assert groups == ["options:", "fly:", "look:", "analyze:", "logs:", "thesis:", "tool:"]
    folder = Path(__file__).parents[2] / "tiltsim" / "commands"
    commands = [
        name or file.stem
        for file in folder.glob("*.py")
        for name in re.findall(r"^def run(?:_(\w+))?\(", file.read_text(), re.MULTILINE)
    ]
    listed = [
        line.split()[0] for line in text.partition("fly:")[2].splitlines() if line[:2] == "  "
    ]
    assert sorted(listed) == sorted(commands)


def test_two_alternatives_are_refused():
    refuse_both(one=None, other=3, last=False)
    with pytest.raises(InputError, match=r"^--no-b: not allowed with --a$"):
        refuse_both(a=True, no_b="x")


def test_out_is_a_file_or_a_folder_for_it(tmp_path):
    flight = tmp_path / "flight.parquet"
    flight.touch()
    assert file_in(None, tmp_path, "a.png") == file_in(None, flight, "a.png") == tmp_path / "a.png"
    assert file_in(tmp_path, flight, "a.png") == tmp_path / "a.png"
    assert file_in(tmp_path / "new", flight, "a.png") == tmp_path / "new" / "a.png"
    assert file_in(tmp_path / "b.pdf", flight, "a.png") == tmp_path / "b.pdf"


def test_only_the_requested_command_is_imported():
    code = "import sys; from tiltsim.cli import main; before = {*sys.modules}; "
    code += "main(['list', 'setpoint', '--json']); print(*{*sys.modules} - before, file=sys.stderr)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = {name for name in done.stderr.split() if name.startswith("tiltsim.commands.")}
    assert loaded <= {f"tiltsim.commands.{name}" for name in ("files", "options", "text")}
    assert "tiltsim.commands.files" in loaded


def test_a_markdown_table_escapes_bars():
    lines = markdown_table(("a", "b"), [("1|2", "3")])
    assert lines == ["| a | b |", "| --- | --- |", r"| 1\|2 | 3 |"]


def test_columns_with_a_format_are_right_aligned():
    columns = {"name": ("name", ""), "size (m)": (lambda row: row["size"], ".1f")}
    rows = [{"name": "a", "size": 10.0}, {"name": "b", "size": None}, {"name": "c", "size": "lost"}]
    lines = table(columns, rows).splitlines()
    assert lines == ["name  size (m)", "a         10.0", "b            -", "c         lost"]
