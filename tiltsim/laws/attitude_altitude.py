"""The attitude-altitude controller in a closed loop with the tiltrotor (ch. 3 and 4)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from tiltsim.laws.rotor_loop import RotorLaw
from tiltsim.laws.tiltrotor import tiltrotor_loops
from tiltsim.laws.tracking import tracking_parameters
from tiltsim_controllers.laws.attitude_altitude import Parameters, attitude_altitude_inputs
from tiltsim_controllers.mathematics.scalar import Triple, Values, Vector, scalar

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import FlightPlan


@scalar
def _law(
    time: float,
    state: Values,
    tilt_rates: Values,
    states: Values,
    parameters: Any,
    knots: Vector,
    motion: Triple,
    measured: Triple | None = None,
) -> Values:
    """The control law as `tiltsim.laws.tracking` takes it; it has no states."""
    return attitude_altitude_inputs(time, state, parameters, knots, measured)


def _setup(plan: FlightPlan) -> tuple[Any, Values]:
    vehicle = plan.scenario.rotorcraft.resolve()
    return tracking_parameters(plan, Parameters, vehicle=vehicle), ()


TILTROTOR, MEASURED_TILTROTOR = tiltrotor_loops(
    RotorLaw("attitude_altitude", _law, Parameters, _setup)
)
"""The attitude-altitude controller of the tiltrotor; the second with the angular acceleration of
the plant in place of the model's."""
