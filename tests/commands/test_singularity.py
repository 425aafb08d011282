"""``tiltsim singularity`` and ``tiltsim gait --balance``."""

from __future__ import annotations

import json

import numpy as np
import pytest

from tiltsim.cli import main
from tiltsim.views.figures.vehicles import singularity_figure, surfaces
from tiltsim_controllers.analysis.singularity import published_determinant
from tiltsim_controllers.vehicle.parameters import PRESETS


def report(capsys, *words):
    assert main([*words, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_level_attitude_is_singular_only_as_published(capsys):
    level = report(capsys, "singularity", "quadrotor")
    assert level["published_determinant"] == 0.0
    assert level["normalized_determinant"] == pytest.approx(1.0)
    assert level["singularity_margin"] == pytest.approx(np.pi / 2)


def test_the_curve_is_where_the_surface_vanishes(capsys):
    curve = report(capsys, "singularity", "quadrotor")["published_curve"]
    values = published_determinant(curve["roll"], curve["pitch"])
    np.testing.assert_allclose(values, 0.0, atol=1e-12)


def test_the_exact_determinant_is_far_from_zero_on_the_curve(capsys):
    assert report(capsys, "singularity", "quadrotor")["exact_on_published_curve"]["min"] > 0.7


def test_another_attitude_and_vehicle(capsys):
    words = ("singularity", "quadrotor", "--roll", "0.5", "--pitch", "-0.5")
    first = report(capsys, *words)
    other = report(capsys, *words, "--vehicle", "luukkonen")
    assert first["published_determinant"] == pytest.approx(-0.7309, abs=1e-4)
    assert first["normalized_determinant"] == pytest.approx(other["normalized_determinant"])
    assert first["exact_determinant"] != other["exact_determinant"]


def test_the_summary_is_readable(capsys):
    assert main(["singularity", "quadrotor"]) == 0
    assert "never singular" in capsys.readouterr().out


def test_the_figure_is_drawn(capsys, tmp_path):
    file = tmp_path / "figure.png"
    assert main(["singularity", "quadrotor", "--plot", str(file)]) == 0
    assert file.read_bytes().startswith(b"\x89PNG")
    assert capsys.readouterr().out.endswith(f"\nfigure written to {file}\n")
    assert len(singularity_figure(PRESETS["ar_drone_2"]).axes) == 8


def test_surfaces_hold_both_claims():
    roll, pitch, published, exact = surfaces(PRESETS["ar_drone_2"], samples=11)
    assert roll.shape == pitch.shape == published.shape == exact.shape == (11, 11)
    assert published.max() > 0.0 > published.min()
    assert exact.min() > 0.0


@pytest.mark.parametrize(
    "words", [["quadrotor", "--vehicle", "none"], ["quadrotor", "--roll", "45"]]
)
def test_mistakes_exit_with_2(capsys, words):
    assert main(["singularity", *words]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


def test_the_balanced_gait_points_its_force_into_the_gust(capsys):
    gait = report(capsys, "gait", "--balance", "-2,1,0.5", "--vehicle", "luukkonen")
    vehicle = PRESETS["luukkonen"]
    force = np.array([2.0, -1.0, vehicle.gravity - 0.5])
    np.testing.assert_allclose(
        gait["torque_free_direction"], force / np.linalg.norm(force), atol=1e-9
    )


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("1,2", "must be three numbers"),
        ("a,b,c", "must be three numbers"),
        ("nan,0,0", "must be finite"),
        ("0,20,0", "no tilt angles up to 1.05 rad"),
        ("0,0,10", "no tilt angles up to 1.05 rad"),
    ],
)
def test_an_acceleration_that_cannot_be_balanced_is_one_line(capsys, value, message):
    assert main(["gait", "--balance", value]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert f"--balance {value}: " in error
    assert len(error.splitlines()) == 1
