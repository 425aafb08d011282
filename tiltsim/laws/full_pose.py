"""Full-pose control in closed loops: the tilt angles are inputs (ch. 3, Sec. 6.3)."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from tiltsim.closed_loop.loop import ClosedLoop, ControlSetup
from tiltsim.laws.law import Law, parameters_of, tilts_in_states
from tiltsim.laws.rotor_loop import (
    RotorLayout,
    body_of_vehicle,
    layout_of_vehicle,
    margins_of,
    rotor_loop,
    rotor_stops,
)
from tiltsim.laws.tiltrotor import singularity_columns
from tiltsim.models.rotor_table import Multirotor
from tiltsim.scenario.scenario import FlightPlan, Scenario
from tiltsim.scenario.tiltrotor_controllers import FullPoseController
from tiltsim.vehicles.rotorcraft import ROTORCRAFT, initial_tilts
from tiltsim_controllers.laws.full_pose import (
    PUBLISHED_TILT_WEIGHT,
    Parameters,
    force_balanced_tilt_weight,
    full_pose,
)
from tiltsim_controllers.laws.observed import Seen
from tiltsim_controllers.mathematics.records import changed_record
from tiltsim_controllers.mathematics.scalar import Floats, Values
from tiltsim_controllers.vehicle.parameters import Vehicle
from tiltsim_controllers.vehicle.states import state_of


def _margins(samples: Mapping[str, Floats], setup: ControlSetup) -> dict[str, Floats]:
    """`singularity_columns`; three rotors do not span torque and lift: singular at any attitude."""
    law = setup.parameters.law
    intact = samples["time"] < law.failure.known_from
    columns = singularity_columns(samples, law.vehicle)
    return {name: np.where(intact, column, 0.0) for name, column in columns.items()}


def _setup_of(record: Any) -> Callable[[FlightPlan], tuple[Any, Values]]:
    """`Law.setup` with a type of record."""

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


@cache
def full_pose_loop(layout: RotorLayout) -> ClosedLoop:
    """Full-pose control of all vehicles of a layout."""
    rotors, places = layout.tilt_of_rotor, layout.places
    is_multirotor = layout.model == "multirotor"
    record = Parameters if is_multirotor else changed_record(Parameters, vehicle=Vehicle)

    def speeds(seen: Seen, p: Any, knots: Any) -> Any:
        # A pod that turns across its thrust spans one plane with it at any angle: the rank of such
        # rotors' matrix changes only where one of them stops, whichever of them are lost.
        return state_of(seen.state, rotors).speeds

    stops = rotor_stops(places.rotors)
    law = Law(
        lambda seen, p, knots: full_pose(seen, p, knots, rotors),
        record,
        _setup_of(record),
        states=dict.fromkeys(places.names("tilt_command"), "rad"),
        initial=lambda plan: initial_tilts(plan)[0],
        tilts=tilts_in_states(0, places.tilts),
        margins=margins_of(layout) if is_multirotor else _margins,
        signs=speeds,
        causes=lambda _sample, _setup: stops,
    )
    loop = rotor_loop(layout, law)
    return loop if is_multirotor else replace(loop, kind=ROTORCRAFT)


def full_pose_loop_of(scenario: Scenario, _measured: bool, _strategy: str) -> ClosedLoop:
    """The full-pose loop of a scenario's multirotor, without layers."""
    vehicle = scenario.vehicle.resolve()
    assert isinstance(vehicle, Multirotor)
    return full_pose_loop(layout_of_vehicle(vehicle))
