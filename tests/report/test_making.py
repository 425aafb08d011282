"""The report end to end, on a tiny library: flights, rows, page and summary."""

from __future__ import annotations

import csv
import dataclasses
import io
import json
import re
from html import escape
from html.parser import HTMLParser
from io import BytesIO

import numpy as np
import pytest
from PIL import Image

from tiltsim.cli import main
from tiltsim.errors import EXPECTATION_FAILED, INVALID_INPUT
from tiltsim.report import flights
from tiltsim.report.claim import ClaimVerdict
from tiltsim.report.claim_rows import Cell, Criterion, Row, count
from tiltsim.report.claims import registered_claims, scenario_claims
from tiltsim.report.content import (
    Report,
    criterion_text,
    failure_text,
    measured_text,
    published_text,
)
from tiltsim.report.findings import ERRORS, FINDINGS
from tiltsim.report.flights import FlightRecord, flight_key, fly, report_entries
from tiltsim.report.making import Made, make_report
from tiltsim.report.pages import errors_page, markdown, page, rows_csv, rows_json
from tiltsim.report.pictures import DPI, Drawing, Picture, png
from tiltsim.scenario.loading import load_scenario
from tiltsim.studies.checking import collect
from tiltsim.views.figures.style import CYCLE, new_figure

MADE = Made(
    date="2026-01-31", commit="0123456789ab", versions={"tiltsim": "1.2"}, machine="a <machine>"
)


def rows_of(report, statement):
    return [row for row in report.rows if row.statement.text == statement]


def test_every_scenario_is_flown_on_both_plants_or_gives_the_reason(report, library):
    assert {key[1] for key in report.flights} == {"thesis", "mujoco"}
    unsupported = {k: v for k, v in report.flights.items() if isinstance(v, str)}
    assert list(unsupported) == [(f"{library}/bounded.toml", "thesis")]
    assert "no ground contact" in unsupported[f"{library}/bounded.toml", "thesis"]


def test_rows_hold_both_plants_and_their_verdicts(report):
    level, tilted = rows_of(report, "It stays where it is")
    assert [*level.cells] == ["thesis", "mujoco"]
    assert level.verdict is ClaimVerdict.REPRODUCED
    assert tilted.verdict is ClaimVerdict.QUALITATIVE
    for row in (level, tilted):
        for plant, cell in row.cells.items():
            record = report.flights[row.claim.flights[0], plant]
            assert cell.measured == record.metrics["final_position_error_x"]
    [flies] = rows_of(report, "It flies | to the end")
    assert flies.verdict is ClaimVerdict.NOT_REPRODUCED
    assert count(report.rows).total() == len(report.rows) == 6


def test_an_unsupported_plant_has_no_cell(report):
    [row] = rows_of(report, "Rotors are slow")
    assert "thesis" not in row.cells
    assert row.cells["mujoco"].measured is False
    speed = report.flights[row.claim.flights[0], "mujoco"].metrics["max_rotor_speed"]
    assert measured_text(row.claim, row.cells["mujoco"]) == f"no ({speed:.4g} rad/s)"
    assert row.verdict is ClaimVerdict.REPRODUCED


def test_a_flight_that_terminates_early_has_no_final_values(report):
    [ended] = rows_of(report, "The flight terminates early")
    assert ended.verdict is ClaimVerdict.REPRODUCED
    assert re.fullmatch(
        r"terminated at [\d.]+ s", measured_text(ended.claim, ended.cells["mujoco"])
    )
    [level] = rows_of(report, "It ends level")
    assert level.cells["thesis"].measured is None
    assert level.verdict is ClaimVerdict.NOT_REPRODUCED
    assert measured_text(level.claim, level.cells["thesis"]).startswith("terminated at ")


def test_bounds_that_do_not_hold_are_named(report, library):
    texts = [failure_text(failure) for failure in report.failures]
    assert any(
        text.startswith(f"{library}/bounded.toml on the mujoco plant: max_rotor_speed = ")
        and text.endswith("expected <= 1")
        for text in texts
    )
    assert all("hover" not in text for text in texts)


def test_values_are_shown_a_digit_finer_than_printed(report):
    level, tilted = rows_of(report, "It stays where it is")
    assert published_text(level) == "0 m"
    assert measured_text(level.claim, level.cells["mujoco"]) == "0.0000 m"
    assert published_text(tilted) == "5 m"
    assert re.fullmatch(r"−?\d\.\d{2} m", measured_text(tilted.claim, tilted.cells["mujoco"]))


def test_a_second_report_flies_nothing(library, kept, report, monkeypatch):
    monkeypatch.setattr(flights, "_fly_one", lambda *_, **__: pytest.fail("flown again"))
    again = make_report([str(library)], kept, 1)
    assert again.flights == report.flights
    assert again.rows == report.rows
    assert page(again, MADE) == page(report, MADE)


def test_an_interrupted_report_goes_on(library, report, tmp_path, monkeypatch):
    entries = report_entries(collect([str(library)]))
    fly_one, flown = flights._fly_one, []

    def interrupted(task, **how):
        if len(flown) == 3:
            raise KeyboardInterrupt
        flown.append(task)
        return fly_one(task, **how)

    monkeypatch.setattr(flights, "_fly_one", interrupted)
    with pytest.raises(KeyboardInterrupt):
        fly(entries, tmp_path, 1)
    flown.clear()
    seen = []
    monkeypatch.setattr(
        flights, "_fly_one", lambda task, **how: flown.append(task) or fly_one(task, **how)
    )
    records = fly(entries, tmp_path, 1, lambda done, total: seen.append((done, total)))
    assert len(flown) == 4  # seven flights, three of them stored
    assert seen[0] == (4, 8)  # and an unsupported plant
    assert seen[-1] == (8, 8)
    assert records == report.flights


def test_a_damaged_record_is_flown_again(library, report, tmp_path):
    entries = report_entries([f"{library}/lost.toml"])
    fly(entries, tmp_path, 1)
    for file in tmp_path.iterdir():
        file.write_text("{", encoding="utf-8")
    records = fly(entries, tmp_path, 1)
    assert all(isinstance(record, FlightRecord) for record in records.values())


def test_a_flights_key_covers_all_that_its_numbers_depend_on(library):
    [entry] = report_entries([f"{library}/lost.toml"])
    scenario = entry.scenario
    simulation = scenario.simulation.model_copy(update={"duration": 0.5})
    keys = {
        flight_key(scenario),
        flight_key(entry.plants["thesis"]),
        flight_key(scenario.model_copy(update={"simulation": simulation})),
    }
    assert len(keys) == 3
    retitled = scenario.model_copy(update={"title": "another", "source": "ours", "expect": ()})
    assert flight_key(retitled) == flight_key(scenario)


@pytest.mark.parametrize(
    ("keys", "name", "before", "after"),
    [
        ('[controller]\nlaw = "python"\nfunction = "mine.py:hover"', "mine.py", "A = 1", "A = 2"),
        ('[reference]\ntype = "table"\nfile = "way.csv"', "way.csv", "0,0,0,0", "0,1,0,0"),
    ],
)
def test_a_changed_file_of_the_users_means_another_key(tmp_path, keys, name, before, after):
    """Files that a scenario names: its controller's code, or the table of its reference."""
    flown = tmp_path / "own.toml"
    flown.write_text(f'title = "own"\n{keys}\n', encoding="utf-8")
    head = "" if name.endswith(".py") else "time,x,y,z\n"
    found = []
    for text in (before, after, before):
        rows = f"{head}{text}\n" + ("1,1,1,1\n" if head else "")
        (tmp_path / name).write_text(rows, encoding="utf-8")
        found.append(flight_key(load_scenario(str(flown))))
    assert found[0] == found[2] != found[1]


def test_a_changed_source_means_another_key(library, monkeypatch):
    [entry] = report_entries([f"{library}/lost.toml"])
    before = flight_key(entry.scenario)
    monkeypatch.setattr(flights, "code_digest", lambda: b"another")
    assert flight_key(entry.scenario) != before


def test_the_digest_covers_the_core_and_spares_the_screens(monkeypatch):
    seen = []
    monkeypatch.setattr(flights, "sources_digest", lambda files, *_: seen.extend(files) or b"")
    flights.code_digest.__wrapped__()
    names = {file.as_posix() for file in seen}
    for name in (
        "tiltsim/flight/metrics.py",
        "tiltsim/laws/rotor_loop.py",
        "controllers/tiltsim_controllers/vehicle/parameters.py",
    ):
        assert any(path.endswith(name) for path in names), name
    assert any(path.endswith(".xml") for path in names)
    assert not any("tiltsim/report/" in path or "/figures/" in path for path in names)


class Page(HTMLParser):
    """Collects what a browser would fetch, the balance of tags, ids and links."""

    VOID = frozenset({"meta", "img", "br", "link", "input"})

    def __init__(self):
        super().__init__()
        self.fetched, self.open, self.ids, self.links = [], [], [], []

    def handle_starttag(self, tag, attributes):
        values = dict(attributes)
        self.fetched += [values[key] for key in ("src", "srcset", "data") if key in values]
        if tag in {"link", "iframe"}:
            self.fetched.append(tag)
        if "href" in values:
            self.links.append(values["href"])
        if "id" in values:
            self.ids.append(values["id"])
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


@pytest.fixture(scope="module")
def full(report):
    """The report with findings and a drawing, as the whole library has them."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(2.0, 1.0))
    figure.subplots().plot([0.0, 1.0])
    flight = report.rows[-1].claim.flights[0]
    picture = Picture(4, "line", "A <line>", lambda _: figure, ((flight, "mujoco"),))
    return dataclasses.replace(report, findings=FINDINGS, drawings=[Drawing(picture, png(figure))])


def test_the_page_is_self_contained(full):
    text = page(full, MADE)
    parser = Page()
    parser.feed(text)
    parser.close()
    assert parser.open == []
    assert parser.fetched
    assert all(source.startswith("data:image/png;base64,") for source in parser.fetched)
    assert all(link.startswith("#") for link in parser.links)
    assert {link[1:] for link in parser.links} <= set(parser.ids)
    assert len(set(parser.ids)) == len(parser.ids)
    assert not re.search(r"https?://|@import|url\((?!data:)", text)


def test_the_page_contains_the_findings(full):
    text = page(full, MADE)
    assert "It does <code>not</code> end &lt;early&gt;." in text
    assert "A &lt;line&gt;" in text
    assert text.count('<article class="claim"') >= len(full.chapters)
    for finding in FINDINGS:
        assert f'id="{finding.key}"' in text
    for verdict in ClaimVerdict:
        assert f">{verdict.value}</span>" in text
    assert '<a class="thumb thumb-line" href="#figure-line"' in text
    code = r"<style>.*?</style>|<script>.*?</script>|<pre.*?</pre>"
    assert "{" not in re.sub(code, "", text, flags=re.DOTALL)


def test_the_page_says_how_it_was_made_and_how_to_cite_it(full):
    text = page(full, MADE)
    assert (
        "Made on 2026-01-31 with tiltsim 1.2 at commit 0123456789ab on a &lt;machine&gt;." in text
    )
    assert "note = {Version 1.2, commit 0123456789ab, made on 2026-01-31;" in text
    now = Made.now()
    assert now.versions["mujoco"]
    assert re.fullmatch(r"([0-9a-f]{12}\+?)?", now.commit)


def test_every_row_can_be_linked_to_and_checked(full):
    text = page(full, MADE)
    for row in full.rows:
        assert f'id="{row.claim.id}"' in text
        assert f'id="{row.statement.id}"' in text
        assert escape(criterion_text(row.claim), quote=False) in text.replace("<code>", "`")
        for address in row.claim.flights:
            assert f"tiltsim run '{escape(address)}'" in text
    assert text.count('<details class="row"') == len(full.rows)


def test_the_files_have_the_rows_of_the_page(full):
    shown = re.findall(r"<dt>Id</dt><dd><code>([^<]+)</code></dd>", page(full, MADE))
    table = list(csv.DictReader(io.StringIO(rows_csv(full))))
    records = json.loads(rows_json(full))
    assert sorted(shown) == sorted(row["id"] for row in table)
    assert len(table) == len(full.rows)
    by_id = {row.claim.id: row for row in full.rows}
    for cells, record in zip(table, records, strict=True):
        row = by_id[cells["id"]]
        assert cells["verdict"] == record["verdict"] == row.verdict.value
        assert cells["published"] == published_text(row)
        for plant in ("thesis", "mujoco"):
            cell = row.cells.get(plant)
            assert cells[plant] == (measured_text(row.claim, cell) if cell else "")
        assert record["flights"] == list(row.claim.flights) == cells["flights"].split()


def test_the_library_has_no_anchor_twice(scenarios):
    """A statement stands once, even if its rows have different sources."""
    claims = [claim for scenario in scenarios for claim in scenario_claims(scenario)]
    rows = [Row(claim, Cell(None, ClaimVerdict.REPRODUCED)) for claim in claims]
    rows += [Row(claim, Cell(None, ClaimVerdict.REPRODUCED)) for claim in registered_claims()]
    full = Report([], {}, rows, [], [], [])
    groups = [group for chapter in full.chapters for group in full.chapter_groups(chapter)]
    names = [group.statement.id for group in groups]
    assert len(set(names)) == len(names) == len({row.statement.id for row in rows})


def test_a_criterion_and_an_error_stand_on_the_page(full):
    row = dataclasses.replace(
        full.rows[0],
        claim=dataclasses.replace(
            full.rows[0].claim, published=9.0, fault="refuted", error="routh", why="It is not."
        ),
        cells={"computed": Cell(1.0, ClaimVerdict.REFUTED)},
    )
    criterion = Criterion("short", "0.05 m", "As thick as a line.", 4, (1, 2))
    changed = dataclasses.replace(full, rows=[row], criteria=[criterion])
    text = page(changed, MADE)
    assert 'id="error-routh"' in text
    assert f'<a href="#{row.claim.id}">{row.claim.id}</a>' in text
    assert "<td>0.05 m</td>" in text
    assert ERRORS["routh"].title in errors_page(changed)
    assert "1 rows are refuted or misprints; they trace back to 1 errors" in text


def test_drawings_have_a_palette():
    figure = new_figure(3.0, 2.0)
    shades = figure.subplots()
    shades.imshow(np.linspace(0.0, 1.0, 10_000).reshape(100, 100), cmap="cividis", aspect="auto")
    for number, color in enumerate(CYCLE):
        shades.axhline(10.0 * number, lw=0.4, color=color)
    drawn, packed = BytesIO(), png(figure)
    figure.savefig(drawn, dpi=DPI)
    with Image.open(BytesIO(packed)) as image, Image.open(drawn) as full:
        assert image.mode == "P"
        assert image.size == full.size
        far = np.abs(np.asarray(image.convert("RGB"), int) - np.asarray(full.convert("RGB"), int))
    assert far.max() < 24  # of 255
    assert len(packed) < 0.7 * len(drawn.getvalue())
    assert png(figure) == packed


def test_the_summary_is_stable_and_well_formed(full, library, kept):
    text = markdown(full)
    assert text == markdown(dataclasses.replace(full, drawings=[]))
    again = dataclasses.replace(make_report([str(library)], kept, 1), findings=FINDINGS)
    assert text == markdown(again)
    tables = [line for line in text.splitlines() if line.startswith("|")]
    widths = {len(re.findall(r"(?<!\\)\|", line)) for line in tables}
    assert widths == {6, 13}  # claims and counts
    assert "It flies \\| to the end" in text
    assert str(library) not in text
    for finding in FINDINGS:
        assert f"### {finding.title}" in text


@pytest.mark.slow
def test_the_command_writes_both_and_reports_bounds(library, tmp_path, capsys):
    out, summary = tmp_path / "out", tmp_path / "summary.md"
    arguments = ["report", f"{library}/bounded.toml", f"{library}/lost.toml", "--jobs", "2"]
    code = main([*arguments, "--out", str(out), "--markdown", str(summary)])
    shown, printed = capsys.readouterr()
    assert code == EXPECTATION_FAILED
    assert all(line.startswith("tiltsim: ") for line in printed.splitlines())
    assert "3 rows: 2 reproduced, 1 not reproduced" in shown
    assert "FAILED  " in shown
    assert "max_rotor_speed" in shown
    assert (out / "report.html").read_text(encoding="utf-8").startswith("<!doctype html>")
    assert summary.read_text(encoding="utf-8").startswith("# Reproduction report\n")
    assert len(json.loads((out / "rows.json").read_text(encoding="utf-8"))) == 3
    assert (out / "rows.csv").read_text(encoding="utf-8").startswith("id,statement_id,chapter,")


def test_mistakes_are_one_clear_line(tmp_path, capsys):
    bad = tmp_path / "bad.toml"
    bad.write_text("[simulation]\nduration = -1.0\n", encoding="utf-8")
    for arguments in (
        ["report", str(bad), "--out", str(tmp_path / "out")],
        ["report", "no_such", "--out", str(tmp_path / "out")],
        ["report", "--out", str(bad)],
        ["report", "--markdown", str(tmp_path / "no" / "file.md"), "--out", str(tmp_path / "out")],
    ):
        assert main(arguments) == INVALID_INPUT
        captured = capsys.readouterr()
        assert captured.err.startswith("tiltsim: ")
        assert captured.err.count("\n") == 1


def test_digest_of_sources_depends_on_their_contents_alone(tmp_path):
    for first, second in (("a", "b"), ("z", "c")):  # the order of the folders is another
        for folder, text in ((first, "one"), (second, "two")):
            (tmp_path / folder).mkdir()
            (tmp_path / folder / "law.py").write_text(text)
    here = sorted(tmp_path.glob("[ab]/law.py"))
    there = sorted(tmp_path.glob("[cz]/law.py"))
    assert flights.sources_digest(here, "numpy") == flights.sources_digest(there, "numpy")
    assert flights.sources_digest(here) != flights.sources_digest(here, "numpy")
    there[0].write_text("three")
    assert flights.sources_digest(here, "numpy") != flights.sources_digest(there, "numpy")
