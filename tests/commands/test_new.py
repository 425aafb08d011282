"""``tiltsim new``: the files of every kind fly as written, and nothing is overwritten."""

from __future__ import annotations

import json

import pytest

from tiltsim.cli import main
from tiltsim.models.starters import STARTERS


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """An empty folder, in which the test runs."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("kind", STARTERS)
def test_each_kind_passes_its_check(kind, capsys):
    assert main(["new", kind]) == 0
    assert main(["check", f"{kind}.toml"]) == 0
    assert "3/3 hold" in capsys.readouterr().out
    assert main(["run", f"{kind}.toml", "--quiet", "--set", "reference.position=[2, 0, 0]"]) == 0


def test_a_name_with_quotes_is_found(folder):
    assert main(["new", "quadrotor", 'my "own".xml']) == 0
    assert main(["run", 'my "own".toml', "--quiet", "--set", "simulation.duration=0.04"]) == 1
    assert {file.name for file in folder.iterdir()} == {'my "own".xml', 'my "own".toml'}


@pytest.mark.parametrize("kind", ["bicopter", "tricopter"])
def test_few_rotors_have_abilities_but_no_margin(kind, folder, capsys):
    """The margin is at given tilt angles, at which they cannot hover."""
    assert main(["new", kind]) == 0
    assert main(["gait", "--mjcf", f"{kind}.xml", "--faults"]) == 0
    assert "without rotor 2       none at these tilt angles" in capsys.readouterr().out
    main(["run", f"{kind}.toml", "--set", "simulation.duration=0.04", "--out", "flight"])
    assert "min_singularity_margin" not in json.loads((folder / "flight/metrics.json").read_text())
    assert main(["plot", "flight"]) == 0


def test_a_wall_without_contacts_is_pointed_out(folder, capsys):
    assert main(["new", "quadrotor"]) == 0
    file = folder / "quadrotor.xml"
    for name, words in {"wall": "passes through geom 'wall'", "wall_collision": ""}.items():
        wall = f'<worldbody><geom name="{name}" type="box" size=".1 2 2" pos="3 0 0"/>'
        file.write_text(file.read_text().replace("<worldbody>", wall, 1))
        main(["run", "quadrotor.toml", "--set", "simulation.duration=0.04"])
        assert words in capsys.readouterr().err


@pytest.mark.parametrize("existing", ["mine.xml", "mine.toml"])
def test_files_are_overwritten_only_by_force(existing, folder, capsys):
    (folder / existing).write_text("kept")
    assert main(["new", "hexarotor", "mine.xml"]) == 2
    assert capsys.readouterr().err == f"tiltsim: {existing}: exists; --force replaces it\n"
    assert [file.read_text() for file in folder.iterdir()] == ["kept"]
    assert main(["new", "hexarotor", "mine.xml", "--force"]) == 0
    assert "kept" not in (folder / existing).read_text()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["pentarotor"], "KIND 'pentarotor': unknown; choose bicopter, tricopter, "),
        (["quadrotor", "mine.txt"], "FILE mine.txt: unknown format '.txt'; choose .xml"),
        (["quadrotor", "none/mine.xml"], "FILE none/mine.xml: its folder does not exist"),
    ],
)
def test_mistakes_are_one_line(arguments, message, folder, capsys):
    assert main(["new", *arguments]) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"tiltsim: {message}")
    assert error.count("\n") == 1
    assert not any(folder.iterdir())
