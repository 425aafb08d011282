"""The folder of a sweep: foreign files keep every byte, foreign and damaged rows are refused."""

from __future__ import annotations

import json
import os
import shutil

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from tests.damage import read_with_flipped_bits
from tests.sweeps.files import short_sweep
from tests.system.test_files import HEX
from tiltsim.errors import InputError
from tiltsim.scenario.loading import parse_scenario
from tiltsim.simulation.simulate import simulate
from tiltsim.sweeps.dataset import load_results, open_sweep_folder, read_definition, read_rows
from tiltsim.sweeps.loading import load_sweep
from tiltsim.sweeps.points import SweepPoints
from tiltsim.sweeps.running import run_sweep
from tiltsim.system.parquet import parquet_bytes


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """A definition and its finished folder."""
    folder = tmp_path_factory.mktemp("flown")
    definition = load_sweep(short_sweep(folder / "sweep.toml"))
    run_sweep(definition, folder / "out")
    return definition, folder / "out"


@pytest.fixture(scope="module")
def other(flown, tmp_path_factory):
    """The finished folder of a sweep with other draws."""
    folder = tmp_path_factory.mktemp("other")
    file = short_sweep(folder / "sweep.toml")
    file.write_text(file.read_text().replace("seed = 3", "seed = 4"))
    run_sweep(load_sweep(file), folder / "out")
    return folder / "out"


@pytest.fixture
def copy(flown, tmp_path):
    """The definition and a copy of the finished folder."""
    return flown[0], shutil.copytree(flown[1], tmp_path / "out")


def contents(folder):
    """Every file below a folder, links and empty folders included."""
    return {
        path.relative_to(folder).as_posix(): path.readlink()
        if path.is_symlink()
        else path.read_bytes()
        if path.is_file()
        else None
        for path in sorted(folder.rglob("*"))
    }


def refused(definition, folder):
    with pytest.raises(InputError) as caught:
        run_sweep(definition, folder)
    line = str(caught.value)
    assert "\n" not in line
    return line


FOREIGN = {
    "lock": {".lock": b"mine", "notes.md": b"x"},
    "dataset": {"sweep.parquet": b"mine", ".a.new": b"x"},
    "table": {"rows.parquet": b"mine", ".sweep.json.new": b"x"},
    "parts": {"parts/a": b"mine", "parts/.000000.parquet.1.new": b"x"},
    "definition": {"sweep.json": b"{}", ".lock": b"mine", "parts/.000000.parquet.1.new": b"x"},
}


@pytest.mark.parametrize("kind", FOREIGN)
def test_a_foreign_folder_keeps_every_byte(flown, tmp_path, kind):
    folder = tmp_path / "out"
    for name, content in FOREIGN[kind].items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)
    before = contents(folder)
    refused(flown[0], folder)
    assert contents(folder) == before


def test_the_folder_of_another_sweep_keeps_every_byte(copy, tmp_path):
    _, folder = copy
    (folder / "parts" / ".000001.parquet.1.new").write_bytes(b"x")
    before = contents(folder)
    other = load_sweep(short_sweep(tmp_path / "other.toml", count=7))
    assert "sample.count was 6 and is 7" in refused(other, folder)
    assert contents(folder) == before


@pytest.mark.parametrize("name", [".lock", "parts", "sweep.json", "sweep.parquet"])
def test_links_are_not_followed(copy, tmp_path, name):
    definition, folder = copy
    moved = tmp_path / "moved"
    (folder / name).rename(moved)
    (folder / name).symlink_to(moved)
    before = contents(tmp_path)
    assert f"{name} is a link" in refused(definition, folder)
    assert contents(tmp_path) == before


def test_only_a_sweeps_own_leftovers_are_removed(copy):
    definition, folder = copy
    own = {folder / f".sweep.parquet.{HEX}.new", folder / "parts" / f".000002.parquet.{HEX}.new"}
    others = {
        folder / ".notes.new",
        folder / ".sweep.parquet.new",
        folder / "parts" / ".000002.parquet.12.new",
        folder / "parts" / ".a.new",
        folder / "parts" / "5 copy.parquet.bak",
    }
    for file in own | others:
        file.write_bytes(b"x")
    before = {*folder.rglob("*")}
    run_sweep(definition, folder)
    assert {*folder.rglob("*")} == before - own
    assert len(load_results(folder)) == 12


def test_nothing_is_removed_from_a_folder_that_holds_no_sweep_yet(flown, tmp_path):
    file = tmp_path / f".sweep.json.{HEX}.new"
    file.write_bytes(b"x")
    for exists in (True, False):
        with open_sweep_folder(tmp_path, SweepPoints(flown[0])):
            assert file.exists() == exists


def part(folder, number):
    return folder / "parts" / f"{number:06d}.parquet"


def swap(folder, _other):
    one, two = part(folder, 0).read_bytes(), part(folder, 1).read_bytes()
    part(folder, 0).write_bytes(two)
    part(folder, 1).write_bytes(one)
    return part(folder, 0), "rows of other points"


def plain_table(file):
    """The rows as a table that carries no checksum."""
    return pq.read_table(file, partitioning=None)


def shorten(folder, _other):
    part(folder, 1).write_bytes(parquet_bytes(plain_table(part(folder, 1)).slice(1)))
    return part(folder, 1), "rows of other points"


def take_from_another_sweep(folder, other):
    shutil.copy(part(other, 2), part(folder, 2))
    return part(folder, 2), "of another sweep: sample.seed was 4 and is 3"


def replace_the_dataset(folder, other):
    shutil.copy(other / "sweep.parquet", folder)
    return folder / "sweep.parquet", "of another sweep: sample.seed was 4 and is 3"


def put_a_flight_in_place_of_the_dataset(folder, _other):
    row = pq.read_table(folder / "sweep.parquet").to_pylist()[0]
    simulate(parse_scenario(json.loads(row["scenario"]))).save(folder.parent / "flight")
    shutil.copy(folder.parent / "flight" / "flight.parquet", folder / "sweep.parquet")
    return folder / "sweep.parquet", "not of a sweep"


def make_a_draw_nan(folder, _other):
    """No figure can show it: each ended in another error of NumPy or matplotlib."""
    name, table = "initial.attitude[0]", plain_table(part(folder, 0))
    edited = pa.array([*table[name].to_pylist()[:-1], float("nan")])
    place = table.column_names.index(name)
    field = table.schema.field(name)
    pq.write_table(table.set_column(place, field, edited), part(folder, 0))
    return part(folder, 0), "has no checksum, as tiltsim writes it"


def drop_a_column(folder, _other):
    table = plain_table(folder / "sweep.parquet")
    pq.write_table(table.drop_columns(["initial.attitude[0]"]), folder / "sweep.parquet")
    return folder / "sweep.parquet", "has no checksum, as tiltsim writes it"


def make_a_folder_of_a_part(folder, _other):
    part(folder, 0).unlink()
    part(folder, 0).mkdir()
    return part(folder, 0), "not a file"


DAMAGES = (
    swap,
    shorten,
    take_from_another_sweep,
    replace_the_dataset,
    put_a_flight_in_place_of_the_dataset,
    make_a_draw_nan,
    drop_a_column,
    make_a_folder_of_a_part,
)


@pytest.mark.parametrize("damage", DAMAGES)
def test_rows_that_are_not_of_this_sweep_are_refused(copy, other, damage):
    definition, folder = copy
    file, words = damage(folder, other)
    if file.name != "sweep.parquet":
        (folder / "sweep.parquet").unlink()
    before = contents(folder)
    line = refused(definition, folder)
    assert file.name in line
    assert words in line
    assert contents(folder) == before
    with pytest.raises(InputError, match=file.name) as caught:
        load_results(folder)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("flips", [50, pytest.param(1000, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", ["parts/000001.parquet", "sweep.parquet", "sweep.json"])
def test_a_flipped_bit_is_refused_or_changes_nothing(copy, name, flips):
    definition, folder = copy
    points = SweepPoints(definition)
    rows = range(3, 6) if name.startswith("parts") else range(12)

    def read():
        if name == "sweep.json":
            return read_definition(folder / name)
        return read_rows(folder / name, points, rows).to_pylist()

    whole = read()
    for found in read_with_flipped_bits(folder / name, read, flips):
        assert found == whole


def test_a_sweep_whose_file_name_is_not_utf_8_is_flown_and_read(tmp_path):
    folder = tmp_path / os.fsdecode(b"\xff")
    folder.mkdir()
    run_sweep(load_sweep(short_sweep(folder / "sweep.toml", count=1)), folder / "out")
    results = load_results(folder / "out")
    assert len(results) == 2
    assert results.points.definition.address == rf"{tmp_path}/\udcff/sweep.toml"


@pytest.mark.parametrize(
    "name", ["parts/5 copy.parquet", "parts/000099.parquet", "flights/a.parquet"]
)
def test_foreign_tables_in_a_sweep_are_refused(copy, name):
    definition, folder = copy
    foreign = folder / name
    foreign.parent.mkdir(exist_ok=True)
    shutil.copy(folder / "parts" / "000000.parquet", foreign)
    before = contents(folder)
    assert refused(definition, folder).startswith(f"{foreign}: not written by this sweep")
    assert contents(folder) == before
