"""Errors of an estimate inside three standard deviations."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from tiltsim.flight.flight import Flight
from tiltsim.views.figures import style
from tiltsim.views.figures.flight_lines import Shown
from tiltsim_controllers.code.traceable import traceable
from tiltsim_controllers.mathematics.attitude import attitude_error, rotation_matrix
from tiltsim_controllers.mathematics.scalar import Floats

TUBES = {
    "estimate_position_error": (("x", "y", "z"), "position error (m)"),
    "estimate_velocity_error": (("vx", "vy", "vz"), "velocity error (m/s)"),
    "estimate_attitude_error": (("roll", "pitch", "yaw"), "attitude error (rad)"),
}
"""Panels by name: columns, and the label of their errors."""


@traceable
def _turn(true: Floats, estimated: Floats) -> Floats:
    """The rotation (rad, world axes) from an estimated attitude to the true one, if small."""
    about_body = attitude_error(rotation_matrix(estimated), rotation_matrix(true))
    return rotation_matrix(estimated) @ about_body


def errors_of(flight: Flight, name: str) -> tuple[Floats, Floats]:
    """Errors of an estimate and their standard deviations, each of shape (N, 3).

    Args:
        flight: A flight with an estimator.
        name: A name of `TUBES`.
    """
    columns, _ = TUBES[name]
    true = np.stack([flight[column] for column in columns], axis=-1)
    estimated = np.stack([flight[f"estimate_{column}"] for column in columns], axis=-1)
    shown = [f"rotation_{axis}" for axis in "xyz"] if columns[0] == "roll" else columns
    deviation = np.stack([flight[f"deviation_{column}"] for column in shown], axis=-1)
    if columns[0] != "roll":
        return true - estimated, deviation
    return np.array([_turn(*pair) for pair in zip(true, estimated)]), deviation


def draw_tube(axes: Axes, shown: Sequence[Shown], name: str) -> None:
    """The errors of a flight with a tube of three standard deviations about zero.

    Args:
        axes: Where to draw.
        shown: One flight.
        name: A name of `TUBES`.
    """
    flight = shown[0].flight
    errors, deviation = errors_of(flight, name)
    for axis, look in enumerate(style.AXIS_LINES[:3]):
        axes.plot(flight["time"], errors[:, axis], label="xyz"[axis], **{**look, "lw": 0.8})
    widest = 3.0 * deviation.max(axis=-1)
    axes.fill_between(flight["time"], -widest, widest, color=style.INK, alpha=0.12, lw=0.0)
    settled = widest[len(widest) // 20 :].max()
    axes.set_ylim(-2.0 * settled, 2.0 * settled)
    axes.set_title(name.replace("_", " ").capitalize(), loc="left")
    axes.set_ylabel(TUBES[name][1])
