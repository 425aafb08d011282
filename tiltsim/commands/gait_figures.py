"""The figures of ``tiltsim gait``."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tiltsim.commands.angles import parse_speed_limits
from tiltsim.errors import InputError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tiltsim.commands.gait_selection import SelectedGait


def draw_gait(
    selected: SelectedGait, kind: str | None, speed_limits: str | None, panels: tuple[str, ...]
) -> Figure:
    """The ``--figure`` of a gait, by default its roll-pitch diagram.

    Args:
        selected: The gait with its vehicle.
        kind: Which figure.
        speed_limits: For the attainable figure; see `parse_speed_limits`.
        panels: For the default one; default: all that suit the gait.
    """
    from tiltsim.views.figures import attainable, faults, gait

    compared = [(selected.title, selected.gait)]
    if selected.twin is not None:
        compared.append((selected.twin_title, selected.twin))
    if kind == "faults":
        return faults.fault_figure(selected.vehicle)
    if kind == "attainable":
        if not selected.gait.is_constant:
            raise InputError(f"--figure attainable: {selected.gait.name} moves; give fixed angles")
        limits = _speed_limits(selected, speed_limits)
        return attainable.attainable_figure(selected.gait, selected.vehicle, limits)
    if kind == "comparison":
        if len(compared) == 1:
            name = selected.gait.name
            raise InputError(f"--figure comparison: {name} has no bias to compare with")
        return gait.comparison_figure(compared, selected.vehicle)
    if kind == "margin":
        return gait.margin_figure(compared, selected.vehicle)
    return gait.gait_figure(selected.gait, selected.vehicle, panels)


def attainable_warnings(selected: SelectedGait, speed_limits: str | None) -> list[str]:
    """A warning if the attainable figure is empty."""
    from tiltsim_controllers.analysis.attainable import attainable_torque_thrust

    low, high = _speed_limits(selected, speed_limits)
    angles = selected.gait.angles(0.0)
    if not attainable_torque_thrust(angles, selected.vehicle, (low, high)).is_empty:
        return []
    return [
        f"nothing is attainable: no rotor speeds from {low:.2f} to {high:.2f} rad/s hover without "
        "yaw torque; the figure is empty"
    ]


def _speed_limits(selected: SelectedGait, text: str | None) -> tuple[float, float]:
    """Minimum and maximum rotor speed (rad/s) of the attainable figure."""
    from tiltsim_controllers.analysis.attainable import published_speed_limits

    return published_speed_limits(selected.vehicle) if text is None else parse_speed_limits(text)
