"""Columns and singularity checks of multirotors under the controller of attitude and force."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any, Final

import numpy as np

from tiltsim.closed_loop.loop import ControlSetup, Monitoring
from tiltsim.laws.rotor_loop import Margins, RotorLayout, table_of
from tiltsim.laws.rotorcraft import (
    REFERENCE_COLUMNS,
    rotor_stops,
    singular_attitude,
    torque_free_columns,
)
from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.code.traceable import traceable
from tiltsim_controllers.laws.attitude_altitude import PUBLISHED_DECOUPLING
from tiltsim_controllers.laws.multirotor import independence, present_wrench
from tiltsim_controllers.laws.multirotor_steps import Form

NULL_PART: Final = "null_part"
"""A column: the share of the rotors' ``varpi |varpi|`` that neither force nor torque show."""

REVERSING: Final = 'controller.norm = "thrust", with which rotors reverse'
"""The remedy where a rotor would have to reverse."""

REFERENCES: Final = (*REFERENCE_COLUMNS, NULL_PART)
"""Columns of the references of the law."""


@cache
def margins_of(layout: RotorLayout, dimension: int) -> Margins:
    """The columns that a sample alone decides."""
    places = layout.places
    return lambda samples, setup: torque_free_columns(
        places, table_of(places, setup), samples, dimension, setup.parameters.law.failure
    )


@cache
def monitoring_of(layout: RotorLayout, form: Form) -> Monitoring:
    """Where the outputs depend on each other or, in the norm of the speeds, a rotor stops."""
    places = layout.places
    turning = places.rotors if form.norm == "speed" else 0
    names, stops = places.names("alpha"), rotor_stops(turning, REVERSING)
    rotors, speed_1 = layout.tilt_of_rotor, places.speed_1
    end, harmless = (
        speed_1 + places.rotors,
        np.ones(turning),
    )  # as published, the factor 2 |varpi| is in rows of force only

    @traceable
    def sign_check_values(time: Any, values: Any, parameters: Any, knots: Any) -> Any:
        own = parameters.law
        whole, without = xp.array(own.upper_side), xp.array(own.upper_side_without)
        side = xp.where(time >= own.failure.known_from, without, whole)
        rows, up = present_wrench(time, values[:end], own, knots, rotors)
        speeds = values[speed_1 : speed_1 + turning]
        if own.decoupling == PUBLISHED_DECOUPLING:
            speeds = harmless
        return xp.hstack([independence(rows, up, side, form), speeds])

    def causes(sample: Mapping[str, float], setup: ControlSetup) -> tuple[str, ...]:
        failure, attitude = setup.parameters.law.failure, singular_attitude(sample, names)
        if sample["time"] >= failure.known_from:
            attitude += f", without rotor {failure.rotor:g}"
        return (attitude, *stops)

    return Monitoring(sign_check_values, causes)
