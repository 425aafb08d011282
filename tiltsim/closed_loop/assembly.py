"""Everything that is prepared for one flight, once."""

from dataclasses import dataclass

from tiltsim.closed_loop.loop import ClosedLoop, ControlSetup
from tiltsim.scenario.scenario import FlightPlan
from tiltsim_controllers.mathematics.scalar import Values, Vector


@dataclass(frozen=True, eq=False)
class Assembly(FlightPlan):
    """A planned flight with its closed loop.

    `tiltsim.laws.assembling.assemble` builds it; plants, engines, the termination monitor, flights,
    metrics and views read it.

    Attributes:
        loop: The controller around the vehicle, with all layers.
        setup: Inputs of the control step other than the state.
        follows_position: Whether the controller follows the reference's horizontal position.
        traced: Whether the loop can be traced; else it runs as plain Python.
    """

    loop: ClosedLoop
    setup: ControlSetup
    follows_position: bool
    traced: bool = True

    def sign_check_values(self, time: float, values: Vector) -> Values:
        """The numbers of `Monitoring.sign_check_values`, from a sample."""
        return self.loop.monitoring.sign_check_values(time, values, *self.setup)
