"""Observations of a rotorcraft in MuJoCo, as a controller gets them."""

from collections.abc import Sequence

import numpy as np

from tiltsim.closed_loop.assembly import Assembly
from tiltsim.engines.base import vectors_of
from tiltsim.laws.layers.actuation import measured, sensor_parameters
from tiltsim.laws.layers.contact import commanded_force, felt_among, push_of
from tiltsim.plants.command import Observation, Reference
from tiltsim.plants.mujoco_plant import MujocoPlant
from tiltsim.scenario.gait import tilts_of
from tiltsim.vehicles.rotorcraft.others import FELT, others_of
from tiltsim_controllers.code.arrays import as_arrays
from tiltsim_controllers.mathematics.attitude import euler_angles
from tiltsim_controllers.mathematics.scalar import Floats, Values
from tiltsim_controllers.references.trajectories import attitude_reference, reference_derivatives


class Observer:
    """Makes the observations of one flight. Raises TypeError for a vehicle that is no rotorcraft.

    Args:
        assembly: The flight.
    """

    def __init__(self, assembly: Assembly) -> None:
        vehicle = assembly.scenario.any_rotorcraft
        self._vehicle, self._tilting = vehicle.resolve(), vehicle.has_tilting_rotors
        self._tilts, self._spins = tilts_of(self._vehicle), np.array(vehicle.spins)
        scenario = assembly.scenario
        self._felt = felt_among(others_of(scenario)) if scenario.has_objects else None
        self._push = push_of(scenario)
        self._attachment = scenario.payload.attachment if scenario.payload else (0.0, 0.0, 0.0)
        self._assembly, self._sensors = assembly, as_arrays(sensor_parameters(assembly.scenario))

    def observe(self, plant: MujocoPlant, rotor_speeds: Sequence[float]) -> Observation:
        """The plant's present state as a controller sees it, through the scenario's sensors.

        ``rotor_speeds`` are signed, one for each rotor, rad/s.
        """
        time, data = plant.evaluation_time, plant.data
        qpos, qvel = measured(time, data.qpos, data.qvel, self._sensors)
        tilts, tilt_rates = qpos[7 : 7 + self._tilts], qvel[6 : 6 + self._tilts]
        return Observation(
            time=plant.time,
            position=qpos[:3].copy(),
            velocity=qvel[:3].copy(),
            attitude=euler_angles(qpos[3:7]),
            quaternion=qpos[3:7].copy(),
            body_rates=qvel[3:6].copy(),
            tilt_angles=tilts.copy() if self._tilting else np.zeros(self._tilts),
            tilt_rates=tilt_rates.copy() if self._tilting else np.zeros(self._tilts),
            rotor_speeds=self._spins * rotor_speeds,
            reference=self._reference(time),
            vehicle=self._vehicle,
            reference_at=self._reference,
            **self._felt_by(plant),
        )

    def _felt_by(self, plant: MujocoPlant) -> dict[str, Floats]:
        """Force of contacts and swing of a load."""
        if self._felt is None:
            return {}
        qpos, _, act = vectors_of(self._assembly.loop, plant.data).joined()
        felt = np.array(self._felt(qpos, act, self._attachment))
        return {"contact_force": felt[FELT.contact_force], "swing": felt[FELT.swing]}

    def _reference(self, time: float) -> Reference:
        knots, reference = self._assembly.knots, self._assembly.reference
        motion = np.array(reference_derivatives(time, reference, knots)[:9])
        angles, rates = np.zeros((2, self._tilts))
        if self._tilting:
            angles, rates = self._assembly.gait.angles(time), self._assembly.gait.rates(time)
        return Reference(
            position=motion[:3],
            velocity=motion[3:6],
            acceleration=motion[6:],
            attitude=np.array(attitude_reference(time, reference, knots)),
            tilt_angles=angles.copy(),
            tilt_rates=rates.copy(),
            force=commanded_force(time, self._push) * np.array(self._push.direction),
        )


def flip_by_spin(values: Sequence[float], spins: Sequence[float]) -> Values:
    """Speeds along the spin from signed ones, and back."""
    return tuple(spin * value for spin, value in zip(spins, values, strict=True))
