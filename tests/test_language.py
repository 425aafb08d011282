"""Docstrings, comments and names of tests are plain American technical English.

Riddles such as a sentence that begins with "What" or "Of" make a reader search for the noun. Each
pattern has a suggestion. Text in quotes is not checked: titles and words of the thesis.
"""

from __future__ import annotations

import ast
import io
import re
import tokenize
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

import tiltsim

ROOT = Path(tiltsim.__file__).parents[1]
START = r"(?:^|(?<=[.:;(] ))"
BRITISH = (
    r"colour|behaviour|neighbour|favour|centre|(?:milli|micro|nano|\b)metre|\bgrey|catalogue|"
    r"(?:general|initial|linear|minim|maxim|normal|optim|organ|parametr|recogn|summar|visual)is"
    r"(?:e|ing|ation)|\banalys(?:ed?|ing)\b|(?:label|model|travel|cancel)l(?:ed|ing)|"
    r"\b(?:in|to)wards\b"
)

PROSE = {
    "name the thing instead of 'what ...'": (
        rf"(?:{START}W|^w)hat\b(?![^.?!]*\?)"
        r"|\b(?:and|are|as|but|by|for|from|in|is|of|on|or|than|that|to|with) what\b|[,;:(] ?what\b"
    ),
    "repeat the noun instead of 'those of' or 'that of'": (
        r"\bthat of\b|\b[Tt]hose (?:at|for|from|in|of|on|that|to|which|whose|with)\b"
    ),
    "begin with the noun, or with 'for', instead of 'Of ...'": rf"{START}Of\b",
    "name the thing instead of 'the same of'; write 'see x' instead of 'as x'": (
        rf"\bthe same of\b|{START}The same\b|{START}As (?:for|in|of|with|those|that|`)"
    ),
    "name the number instead of 'so many' or 'as many'": r"\b(?:so|as) (?:many|much)\b",
    "requested, sent, documented": r"\b(?:asked|asks|said|t(?:ells|old))\b",
    "custom, separate, or its own x": r"\bof (?:its|one's|our|their|your) own\b",
    "one x per y": r"\b(?:an?|one) \w+ an? (?:flight|row|rotor|scenario|step|line)\b",
    "also, again, in addition to": r"\btoo(?:[.,;:]|$)|\banew\b|\b[Bb]esides\b",
    "American spelling": BRITISH,
}

NAMES = {
    "name the thing instead of 'what'": r"(?:^test|_by|_from|_of|_with)_what_",
    "name the thing instead of a pronoun": r"^test_(?:its?|their|they)_",
    "repeat the noun": r"_(?:that|those)_of_",
    "custom, separate": r"_of_(?:its|ones|our|their|your)_own",
    "requested, sent, refused": r"_(?:asked|said|t(?:ells|old))(?=_|$)",
    "also, again": r"_too$|_anew(?=_|$)",
    "name the number": r"_(?:as|so)_(?:many|much)_",
    "American spelling": BRITISH.replace(r"\b", ""),
}


@cache
def compiled(patterns: str) -> dict[str, re.Pattern[str]]:
    return {hint: re.compile(text) for hint, text in (PROSE, NAMES)[patterns == "names"].items()}


def found(text: str, patterns: str) -> list[str]:
    """The suggestions for a text, each with the words that it is about."""
    matches = ((hint, one.search(text)) for hint, one in compiled(patterns).items())
    return [f"{match[0].strip()!r}: {hint}" for hint, match in matches if match]


def paragraphs(docstring: str) -> list[str]:
    """Paragraphs, list items and arguments of a docstring, each in one line without quotes."""
    parts = re.split(r"\n\s*\n|\n(?=\s*(?:[-*] |\*{0,2}\w+(?:, \w+)*: ))", docstring)
    parts = [re.sub(r"^\*{0,2}\w+(?:, \w+)*: ", "", part.strip()) for part in parts]
    return [re.sub(r'"[^"]*"|“[^”]*”|``[^`]*``', "``", " ".join(part.split())) for part in parts]


def statements(node: ast.AST) -> Iterator[ast.stmt]:
    """All statements below a node."""
    for child in getattr(node, "body", ()):
        yield child
        yield from statements(child)


def prose(source: str) -> list[tuple[int, str]]:
    """Docstrings and comments of a module, with their lines."""
    texts = [
        (node.lineno, str(node.value.value))
        for node in statements(ast.parse(source))
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
    ]
    # Tokens cost ten times the syntax tree: read them only where a comment may have a finding.
    if any(found(text.strip(), "prose") for text in re.findall("# (.*)", source)):
        tokens = tokenize.generate_tokens(io.StringIO(source).readline)
        texts += [
            (token.start[0], token.string.strip("# "))
            for token in tokens
            if token.type == tokenize.COMMENT
        ]
    return texts


def findings(file: Path) -> list[str]:
    """The suggestions for a file, each with its line."""
    source = file.read_text(encoding="utf-8")
    found_at = [
        (line, hint)
        for line, text in prose(source)
        for part in paragraphs(text)
        for hint in found(part, "prose")
    ]
    if file.name.startswith("test_"):
        for match in re.finditer(r"^\s*(?:async )?def (test_\w+)", source, re.MULTILINE):
            line = source.count("\n", 0, match.start(1)) + 1
            found_at += [(line, f"{match[1]}: {hint}") for hint in found(match[1], "names")]
    return [f"{file.relative_to(ROOT)}:{line}: {hint}" for line, hint in found_at]


@pytest.mark.parametrize("folder", ["tiltsim", "controllers", "tests"])
def test_prose_and_names_of_tests_are_plain_english(folder):
    listed = [hint for file in sorted((ROOT / folder).rglob("*.py")) for hint in findings(file)]
    assert not listed, "\n".join(listed)


@pytest.mark.parametrize(
    ("riddle", "plain"),
    [
        ("What the law reads.", "Inputs of the law."),
        ("names: Those of `act`.", "names: Names of the entries of `act`."),
        ("period: Of the orbit, s.", "period: Period of the orbit, s."),
        ("The same of a sample.", "The metrics of a sample."),
        ("A state with so many numbers.", "A state of size ``n``."),
        ("The angle asked of a servo.", "The angle commanded to a servo."),
        ("A controller of your own.", "A custom controller."),
        ("Draw one line a flight.", "Draw one line per flight."),
        ("It begins anew.", "It begins again."),
        ("The colour.", "The color."),
    ],
)
def test_every_pattern_catches_a_riddle_and_accepts_the_rewrite(riddle, plain):
    for text, caught in ((riddle, True), (plain, False)):
        source = f'"""{text}"""\n\nx = 1  # {text.rpartition(": ")[2]}\n'
        texts = [part for _, each in prose(source) for part in paragraphs(each)]
        assert [bool(found(part, "prose")) for part in texts] == [caught] * (1 + caught)


@pytest.mark.parametrize(
    ("riddle", "plain"),
    [
        ("test_what_is_no_path_is_an_error", "test_invalid_paths_are_refused"),
        ("test_it_needs_equations", "test_gradients_need_equations"),
        ("test_gains_are_those_of_hover", "test_gains_equal_the_gains_of_hover"),
        ("test_yaw_is_a_loop_of_its_own", "test_yaw_is_a_separate_loop"),
        ("test_a_soft_servo_is_told", "test_a_soft_servo_is_reported"),
        ("test_a_class_is_made_anew", "test_a_class_is_made_again"),
        ("test_as_many_lanes_as_flights", "test_one_lane_per_flight"),
        ("test_a_geom_without_a_colour", "test_a_geom_without_a_color"),
    ],
)
def test_every_pattern_of_names_catches_a_riddle(riddle, plain):
    assert found(riddle, "names")
    assert not found(plain, "names")
