"""The attitude-altitude controller in a closed loop with the tiltrotor (ch. 3 and 4)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tiltsim.laws.rotor_loop import RotorLaw
from tiltsim.laws.tiltrotor import tiltrotor_loops
from tiltsim.scenario.tiltrotor_controllers import AttitudeAltitudeController
from tiltsim_controllers.laws.attitude_altitude import (
    DECOUPLINGS,
    Parameters,
    attitude_altitude_inputs,
)
from tiltsim_controllers.laws.decouplers import DECOUPLERS
from tiltsim_controllers.mathematics.scalar import Triple, Values, Vector, scalar

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import FlightPlan


@scalar
def _law(
    time: float,
    state: Values,
    tilt_rates: Values,
    states: Values,
    parameters: Parameters,
    knots: Vector,
    motion: Triple,
    measured: Triple | None = None,
) -> Values:
    """The control law as `tiltsim.laws.tracking` takes it; it has no states."""
    return attitude_altitude_inputs(time, state, parameters, knots, measured)


def _setup(plan: FlightPlan) -> tuple[Parameters, Values]:
    controller, rotorcraft = plan.scenario.controller, plan.scenario.rotorcraft
    assert isinstance(controller, AttitudeAltitudeController)
    law = Parameters(
        vehicle=rotorcraft.resolve(),
        gains=controller.resolve_gains(),
        gait=plan.gait.parameters,
        reference=plan.reference,
        decoupler=DECOUPLERS[controller.decoupler],
        decoupling=DECOUPLINGS[controller.decoupling],
    )
    return law, ()


TILTROTOR, MEASURED_TILTROTOR = tiltrotor_loops(
    RotorLaw("attitude_altitude", _law, Parameters, _setup)
)
"""The attitude-altitude controller of the tiltrotor; the second with the angular acceleration of
the plant in place of the model's."""
