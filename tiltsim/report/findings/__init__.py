"""Our own findings, each with its proof, and the list of errors of the thesis.

An error counts if a row with the verdict refuted or misprint names it
(`tiltsim.report.claim_rows.errors`); its proof runs when the report is made.
The texts, in the TOML files of this folder, contain no measured number: functions compute them when
the report is made.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from tiltsim.report.measures.slips import deviation
from tiltsim_controllers.analysis.attainable import (
    attainable_accelerations,
    attainable_torque_thrust,
    published_speed_limits,
)
from tiltsim_controllers.analysis.published_gaits import PUBLISHED_GAITS
from tiltsim_controllers.analysis.singularity import (
    normalized_determinant,
    published_singular_curve,
    residuals,
    singular_values,
)
from tiltsim_controllers.analysis.stability import third_order_loop
from tiltsim_controllers.analysis.two_color_map import delta, grid_roots
from tiltsim_controllers.laws import gains, yaw_position
from tiltsim_controllers.tilt_car.cycles import drift_rate, orbit
from tiltsim_controllers.tilt_car.vehicle import THESIS_CAR, turn_per_tilt
from tiltsim_controllers.vehicle.parameters import PRESETS

_VEHICLE: Final = PRESETS["ar_drone_2"]


@dataclass(frozen=True, kw_only=True)
class Finding:
    """A result beyond the thesis."""

    key: str
    title: str
    chapters: str
    text: Sequence[str]
    """Paragraphs with ``{names}`` of ``numbers``; text between backticks is code."""
    proof: str  # why it is true, or where that is derived; also with ``{names}``
    tests: Mapping[str, Sequence[str]]  # names of tests by their file in the folder of the tests
    flights: Sequence[str] = ()  # addresses in the scenario library that show it
    sweep: str = ""  # name of a sweep of the library that shows it
    pictures: Sequence[str] = ()  # names of pictures of the report that show it
    numbers: Callable[[], dict[str, str]] = dict

    @property
    def paragraphs(self) -> list[str]:
        """The text, then the proof, with their numbers."""
        numbers = self.numbers()
        return [paragraph.format(**numbers) for paragraph in (*self.text, self.proof)]

    @property
    def nodes(self) -> list[str]:
        """Its tests, as pytest addresses them."""
        return [f"tests/{file}::{name}" for file, names in self.tests.items() for name in names]

    @property
    def flown(self) -> list[str]:
        """The commands that fly what shows it."""
        sweep = [f"tiltsim sweep '{self.sweep}'"] if self.sweep else []
        return [*(f"tiltsim run '{address}'" for address in self.flights), *sweep]

    @property
    def command(self) -> str:
        """The command that runs its tests."""
        return " \\\n  ".join(("pytest -n 0", *self.nodes))

    @property
    def summary(self) -> str:
        """How much supports it."""
        counts = {
            "test": len(self.nodes),
            "flight": len(self.flights),
            "sweep": int(bool(self.sweep)),
        }
        named = [f"{n} {name}{'s' * (n > 1)}" for name, n in counts.items() if n]
        return ", ".join(named)


def _map_numbers() -> dict[str, str]:
    """2 delta of both published vehicles, rad."""
    return {
        "ar": f"{2.0 * delta(_VEHICLE):.9f}",
        "luukkonen": f"{2.0 * delta(PRESETS['luukkonen']):.9f}",
    }


def _blue_numbers() -> dict[str, str]:
    """Ratios of the singular values of ch. 6's blue gait, as printed and on the exact lines."""
    printed = PUBLISHED_GAITS["ch06_gait_1"]
    assert printed.exact is not None
    shares = []
    for gait in (printed.gait, printed.exact):
        values = singular_values(gait.angles(gait.sample_times(401)), _VEHICLE)
        shares.append(float((values[:, 2] / values[:, 0]).max()))
    angles = printed.exact.angles(printed.exact.sample_times(401))
    largest = max(float(np.abs(part).max()) for part in residuals(angles, _VEHICLE))
    remainder = max(shares[1], largest)
    return {
        "printed": f"{shares[0]:.0e}",
        "zero": "below 1e-9" if remainder < 1e-9 else f"{remainder:.0e}",
    }


def _triangle_numbers() -> dict[str, str]:
    """Grid points of ch. 6 that have a root with R > 0, and how many lie below the diagonal."""
    positive = {
        (i, j)
        for i, row in enumerate(grid_roots(_VEHICLE)[1:-1])
        for j, cell in enumerate(row[1:-1])
        for root in cell
        if root.R > 1e-9
    }
    below = sum(j < i for i, j in positive)
    return {"points": str(len(positive)), "below": str(below)}


def _quadrotor_numbers() -> dict[str, str]:
    """The exact determinant on ch. 2's published curve, and the unstable root of its gains."""
    vehicle = PRESETS["ar_drone_2_unrounded"]
    hover = vehicle.mass * vehicle.gravity
    on_curve = normalized_determinant(*published_singular_curve(), hover, vehicle)
    roots = np.roots((1.0, *yaw_position.GAIN_SETS["ch02"].position))
    worst = roots[np.argmax(roots.real)]
    return {
        "low": f"{on_curve.min():.3f}",
        "high": f"{on_curve.max():.3f}",
        "root": f"{worst.real:.2f} ± {abs(worst.imag):.2f}j",
    }


def _matrix_gain() -> dict[str, str]:
    """Routh's numbers for ch. 4's roll gains, and the loop gain that the printed matrix adds."""
    roll = gains.GAIN_SETS["ch04"].loops["roll"]
    factor = 2.0 * _VEHICLE.hover_rotor_speed
    loop = third_order_loop("roll", roll, 1.0)
    worst = max(root.real for root in np.roots(loop.polynomial))
    return {
        "factor": f"{factor:.0f}",
        "product": f"{roll[0] * roll[1]:g}",
        "third": f"{roll[2]:g}",
        "root": f"{worst:+.2f}",
    }


def _attainable_numbers() -> dict[str, str]:
    """Rotor limits of ch. 9, and the accelerations that gait 2 attains within them."""
    limits = published_speed_limits(_VEHICLE)
    angles = PUBLISHED_GAITS["ch09_gait_2"].gait.angles(0.0)
    found = attainable_torque_thrust(angles, _VEHICLE, limits)
    sideways = attainable_accelerations(angles, _VEHICLE, limits)
    return {
        "slow": f"{limits[0]:.2f}",
        "fast": f"{limits[1]:.2f}",
        "low": f"{found.lower[2]:.2f}",
        "high": f"{found.upper[2]:.2f}",
        "sideways": f"{sideways.upper[0]:.2f}",
    }


def _norm_numbers() -> dict[str, str]:
    """By how much a unit of tilt rate moves the force more than a unit of w' in hover."""
    return {"ratio": f"{_VEHICLE.hover_rotor_speed**2:,.0f}"}


def _drift_numbers() -> dict[str, str]:
    """The drift on ch. 10's circle, rad/s, from the aligned state."""
    return {"rate": f"{drift_rate(0.0, orbit(10.0, 1.0), THESIS_CAR):.2e}"}


def _column_numbers() -> dict[str, str]:
    return {"share": f"{turn_per_tilt(THESIS_CAR):g}"}


NUMBERS: Final[Mapping[str, Callable[[], dict[str, str]]]] = {
    "map": _map_numbers,
    "blue": _blue_numbers,
    "triangle": _triangle_numbers,
    "quadrotor": _quadrotor_numbers,
    "gains": _matrix_gain,
    "norm": _norm_numbers,
    "limits": _attainable_numbers,
    "holonomy": _drift_numbers,
    "tilt-column": _column_numbers,
}


def _tables(name: str) -> dict[str, Any]:
    return tomllib.loads((Path(__file__).parent / f"{name}.toml").read_text(encoding="utf-8"))


FINDINGS: Final = tuple(
    Finding(key=key, numbers=NUMBERS.get(key, dict), **table)
    for name in ("singularities", "flights", "tilt_car")
    for key, table in _tables(name).items()
)
"""All findings, in the order of the report."""


TEST: Final = (
    "tests/report/test_errors.py::test_the_printed_formula_is_wrong_and_the_mended_one_right"
)


@dataclass(frozen=True, kw_only=True)
class PublishedError:
    """A formula, number or statement of the thesis that is wrong."""

    key: str
    title: str
    place: str
    printed: str
    mended: str
    proof: str
    changes: str  # its consequences downstream

    @property
    def off(self) -> str:
        """How far the printed and the mended formula are from the truth."""
        return (
            f"{deviation(self.key, False):.3g} as printed, {deviation(self.key, True):.1g} mended"
        )

    @property
    def command(self) -> str:
        """The command that runs the proof."""
        return f"pytest -n 0 '{TEST}[{self.key}]'"


ERRORS: Final = {key: PublishedError(key=key, **table) for key, table in _tables("errors").items()}
"""All entries by key: first the one of most consequence, then in the order of the text."""
