"""Kinds of vehicles, each a folder of `tiltsim.vehicles`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from tiltsim.models.parts import ExtraActuators, Visuals
from tiltsim.models.vehicle_parts import MAX_ROTORS
from tiltsim.scenario.scenario import FlightPlan, Scenario
from tiltsim.system.text import Quantity
from tiltsim_controllers.mathematics.scalar import Floats, Vector

if TYPE_CHECKING:
    import mujoco


@dataclass(frozen=True, eq=False)
class VehicleKind:
    """Common properties of all vehicles of a kind, and their construction in MuJoCo.

    Attributes:
        observed_fields: Fields of a sample after the time.
        columns: Columns of every flight, their labels and units, in the order of the file.
        thrusts: ``(columns so far, scenario) -> columns``: the rotors' thrusts, N.
        compile: ``(scenario, law_states, extra_actuators, userdata_size, visuals) -> model``.
            Raises `ValueError` where MuJoCo cannot build it.
        initial_motion: ``(plan) -> qpos, qvel`` at time zero.
        limit_exceeded: Function ``(time, values, reference, knots, follows_position) ->
            code`` of the first limit of `tiltsim.closed_loop.limits` that a sample exceeds;
            ``values`` begin with the observed fields.
        metrics: ``(columns, scenario, follows_position) -> metrics``, without the metrics that all
            kinds share. Columns have shape (..., N), the time (N,); numbers of the scenario may be
            arrays (..., 1); metrics have shape (...) and are NaN where a flight has none.
    """

    observed_fields: tuple[str, ...]
    columns: Mapping[str, Quantity]
    thrusts: Callable[[Mapping[str, Floats], Scenario], dict[str, Floats]]
    compile: Callable[[Scenario, int, tuple[ExtraActuators, ...], int, Visuals], mujoco.MjModel]
    initial_motion: Callable[[FlightPlan], tuple[Vector, Vector]]
    limit_exceeded: Callable[..., Any]
    metrics: Callable[[Mapping[str, Floats], Scenario, bool], dict[str, Any]]

    @property
    def rotors(self) -> tuple[int, ...]:
        """The numbers of the rotors."""
        return tuple(i for i in range(1, MAX_ROTORS + 1) if f"rotor_speed_{i}" in self.columns)
