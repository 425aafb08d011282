"""Full-pose control in closed loops: the tilt angles are inputs (ch. 3, Sec. 6.3)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from tiltsim.closed_loop.loop import ClosedLoop, ControlSetup, Monitoring
from tiltsim.laws.parameters import parameters_of
from tiltsim.laws.rotor_loop import (
    RotorLaw,
    RotorLayout,
    body_of_vehicle,
    layout_of_vehicle,
    rotor_loop,
    table_of,
)
from tiltsim.laws.rotorcraft import rotor_stops, torque_free_columns
from tiltsim.laws.tiltrotor import TILTROTOR_LAYOUT, singularity_columns, tiltrotor_motion
from tiltsim.models.rotor_table import Multirotor
from tiltsim.scenario.tiltrotor_controllers import FullPoseController
from tiltsim.vehicles.rotorcraft import ROTORCRAFT, initial_tilts
from tiltsim_controllers.code.traceable import traceable
from tiltsim_controllers.laws.full_pose import (
    PUBLISHED_TILT_WEIGHT,
    Parameters,
    force_balanced_tilt_weight,
    full_pose,
)
from tiltsim_controllers.mathematics.records import changed_record
from tiltsim_controllers.mathematics.scalar import Floats, Values
from tiltsim_controllers.references.trajectories import reference_derivatives
from tiltsim_controllers.vehicle.parameters import Vehicle

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import FlightPlan, Scenario


@cache
def _inputs_of(layout: RotorLayout) -> Callable[..., Values]:
    """`RotorLaw.inputs`: the ``states`` are the commands of the servos."""
    rotors = layout.tilt_of_rotor

    def inputs(
        time: Any, state: Any, tilt_rates: Any, states: Any, parameters: Any, knots: Any
    ) -> Any:
        reference = reference_derivatives(time, parameters.law.reference, knots)
        return full_pose(time, state, reference, parameters.law, knots, rotors, states)

    return inputs


def _margins(samples: Mapping[str, Floats], setup: ControlSetup) -> dict[str, Floats]:
    """`singularity_columns`; three rotors do not span torque and lift: singular at any attitude."""
    law = setup.parameters.law
    intact = samples["time"] < law.failure.known_from
    columns = singularity_columns(samples, law.vehicle)
    return {name: np.where(intact, column, 0.0) for name, column in columns.items()}


def _setup_of(record: Any) -> Callable[[FlightPlan], tuple[Any, Values]]:
    """`RotorLaw.setup` with a type of record."""

    def setup(plan: FlightPlan) -> tuple[Any, Values]:
        controller = plan.scenario.controller
        assert isinstance(controller, FullPoseController)
        vehicle: Any = plan.scenario.any_rotorcraft.resolve()
        is_multirotor = isinstance(vehicle, Multirotor)
        even = controller.tilt_weight == "even"
        law = parameters_of(
            plan,
            record,
            vehicle=body_of_vehicle(vehicle) if is_multirotor else vehicle,
            tilt_weight=force_balanced_tilt_weight(vehicle) if even else PUBLISHED_TILT_WEIGHT,
            failure=controller.resolve_failure(),
        )
        return law, vehicle.table if is_multirotor else ()

    return setup


def _loop(layout: RotorLayout, parameters: Any, **options: Any) -> ClosedLoop:
    """Full-pose control of all vehicles of a layout, with a type of parameters."""
    places = layout.places
    first, stops = places.speed_1, rotor_stops(places.rotors)

    @traceable
    def speeds(time: Any, values: Any, parameters: Any, knots: Any) -> Any:
        # A pod that turns across its thrust spans one plane with it at any angle: the rank of such
        # rotors' matrix changes only where one of them stops, whichever of them are lost.
        return values[first : first + places.rotors]

    law = RotorLaw(
        "full_pose",
        _inputs_of(layout),
        parameters,
        _setup_of(parameters),
        states=dict.fromkeys(places.names("tilt_command"), "rad"),
        initial=lambda plan: initial_tilts(plan)[0],
        commands=0,
        **options,
    )
    return replace(
        rotor_loop(layout, law),
        monitoring=Monitoring(speeds, lambda _sample, _setup: stops),
        uses_gait=True,  # its angles at time zero
    )


FULL_POSE: Final = replace(
    _loop(
        TILTROTOR_LAYOUT,
        changed_record(Parameters, vehicle=Vehicle),
        margins=_margins,
        motion=tiltrotor_motion,
    ),
    kind=ROTORCRAFT,
)
"""Full-pose control of the tiltrotor."""


@cache
def full_pose_loop(layout: RotorLayout) -> ClosedLoop:
    """Full-pose control of all multirotors of a layout."""
    return _loop(
        layout,
        Parameters,
        margins=lambda samples, setup: torque_free_columns(
            layout.places,
            table_of(layout.places, setup),
            samples,
            failure=setup.parameters.law.failure,
        ),
    )


def full_pose_loop_of(scenario: Scenario, _measured: bool) -> ClosedLoop:
    """The full-pose loop of a scenario's multirotor, without layers; it measures nothing."""
    vehicle = scenario.vehicle.resolve()
    assert isinstance(vehicle, Multirotor)
    return full_pose_loop(layout_of_vehicle(vehicle))
