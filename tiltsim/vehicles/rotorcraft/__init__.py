"""Rotorcraft: a free body with any number of rotors, tilted or not.

Places of its numbers in a sample and in MuJoCo's vectors, its true rotors, its columns and model.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from math import inf
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from tiltsim.closed_loop.limits import limit_exceeded_of
from tiltsim.closed_loop.loop import ClosedLoop, Sizes, VehicleKind
from tiltsim.models.parts import ExtraActuators, Pod, RotorLimits, TiltServo, Visuals
from tiltsim.models.rotor_table import Multirotor, hover_speeds
from tiltsim.scenario.interaction import objects_of
from tiltsim.scenario.linearizing_controllers import AttitudeForceController
from tiltsim.scenario.scenario import FlightPlan, Scenario
from tiltsim.scenario.vehicle import VehicleTable
from tiltsim.system.text import Quantity, subscript
from tiltsim.vehicles.metrics import rotorcraft_metrics
from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.mathematics.attitude import quaternion_of_euler
from tiltsim_controllers.mathematics.scalar import Floats, Values, Vector
from tiltsim_controllers.vehicle.body import BODY_FIELDS, ROTATION_NAMES, Body, body_of
from tiltsim_controllers.vehicle.craft import craft_parameters
from tiltsim_controllers.vehicle.parameters import Vehicle

if TYPE_CHECKING:
    import mujoco

    from tiltsim.models.rotorcraft import RotorcraftSpec


# Places in ``qpos`` and ``qvel``: the quaternion, and the first tilt and tilt rate.
QW, QX, QY, QZ, TILT_1 = range(3, 8)
TILT_RATE_1: Final = 6


class Layout(NamedTuple):
    """The layout of a rotorcraft's numbers, by its numbers of rotors and tilt hinges."""

    rotors: int
    tilts: int

    def sizes(self, controller_states: int = 0) -> Sizes:
        """Lengths of MuJoCo's vectors, the controller's states included."""
        act, ctrl = self.rotors + controller_states, self.further_rates + controller_states
        return Sizes(TILT_1 + self.tilts, TILT_RATE_1 + self.tilts, act, ctrl)

    @property
    def thrusts(self) -> slice:
        """In ``ctrl``: the thrusts follow the tilt servos."""
        return slice(self.tilts, self.acceleration_1)

    @property
    def accelerations(self) -> slice:
        """In ``ctrl``: the rotor accelerations follow the thrusts."""
        return slice(self.acceleration_1, self.further_rates)

    @property
    def acceleration_1(self) -> int:
        """In ``ctrl``: the rotor accelerations follow the thrusts."""
        return self.tilts + self.rotors

    @property
    def further_rates(self) -> int:
        """In ``ctrl``: the rates of further states follow the rotor accelerations."""
        return self.tilts + 2 * self.rotors

    @property
    def speed_1(self) -> int:
        """In the values of a sample: the rotor speeds follow the rigid body and the tilts."""
        return len(BODY_FIELDS) + self.tilts

    def names(self, kind: str) -> tuple[str, ...]:
        """Names of fields or columns: one a tilt where the kind begins with alpha, else a rotor."""
        count = self.tilts if kind.startswith(("alpha", "tilt")) else self.rotors
        return tuple(f"{kind}_{i}" for i in range(1, count + 1))

    @property
    def motion(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Names of the coordinates of ``qpos`` and ``qvel``, see `ClosedLoop`."""
        places = (*BODY_FIELDS[:3], *ROTATION_NAMES, *self.names("alpha"))
        return places, (*BODY_FIELDS[3:6], *BODY_FIELDS[9:], *self.names("alpha_rate"))

    @property
    def observed_fields(self) -> tuple[str, ...]:
        """A sample after its time: rigid body, tilts, rotor speeds, tilt rates."""
        kinds = ("alpha", "rotor_speed", "alpha_rate")
        return (*BODY_FIELDS, *(name for kind in kinds for name in self.names(kind)))


def layout_of(loop: ClosedLoop) -> Layout:
    """The layout of a model's vectors; the quadrotor's have no tilts."""
    return Layout(len(loop.spins), loop.sizes.qpos - TILT_1)


def is_fixed_cross(loop: ClosedLoop) -> bool:
    """Whether its rotors are on a cross without hinges and make any thrust at once, as in ch. 2."""
    return loop.vehicle_record is Vehicle and not layout_of(loop).tilts


CROSS: Final = Layout(4, 4)
"""Tiltrotor and quadrotor, whose samples are alike; see `tiltsim_controllers.vehicle.body`."""


def true_rotors(scenario: Scenario) -> Any:
    """The parameters of the simulated vehicle, not the controller's.

    `tiltsim_controllers.vehicle.craft.craft_of` makes its arrays.
    """
    vehicle = scenario.true_vehicle
    if not isinstance(vehicle, Multirotor):
        return vehicle
    return craft_parameters(vehicle.body, vehicle.rotors)


def body_less(scenario: Scenario, inertias: Values) -> Body:
    """The simulated vehicle's body without inertias (kg m^2) about its hinges."""
    vehicle = scenario.true_vehicle
    if isinstance(vehicle, Multirotor):
        inertia = np.reshape(vehicle.inertia, (3, 3)).copy()
        for tilt, own in enumerate(inertias):
            axis = next(rotor.hinge_axis for rotor in vehicle.rotors if rotor.tilt == tilt)
            inertia -= own * np.outer(axis, axis)
        return body_of(vehicle.mass, inertia, vehicle.gravity)
    # two hinges lie along each axis; a quadrotor has none
    about_x, about_y = (2.0 * own for own in inertias[:2] or (0.0, 0.0))
    return vehicle._replace(
        inertia_xx=vehicle.inertia_xx - about_x, inertia_yy=vehicle.inertia_yy - about_y
    ).body


def rotorcraft_columns(layout: Layout) -> dict[str, Quantity]:
    """The columns of every flight, their labels and units, in the order of the file."""
    tilts, rotors = range(1, layout.tilts + 1), range(1, layout.rotors + 1)
    angles = ("roll", "pitch", "yaw")
    return {
        "time": Quantity("time", "s"),
        **{axis: Quantity(axis, "m") for axis in "xyz"},
        **{f"v{axis}": Quantity(f"velocity along {axis}", "m/s") for axis in "xyz"},
        **{angle: Quantity(angle, "rad") for angle in angles},
        **{
            name: Quantity(f"body rate {name} about {axis}", "rad/s")
            for name, axis in zip("pqr", "xyz", strict=True)
        },
        **{f"alpha_{i}": Quantity(f"tilt angle α{subscript(i)}", "rad") for i in tilts},
        **{f"alpha_ref_{i}": Quantity(f"planned tilt angle α{subscript(i)}", "rad") for i in tilts},
        **{
            f"alpha_rate_{i}": Quantity(f"rate of tilt angle α{subscript(i)}", "rad/s")
            for i in tilts
        },
        **{f"rotor_speed_{i}": Quantity(f"speed of rotor {i}", "rad/s") for i in rotors},
        **{f"thrust_{i}": Quantity(f"thrust of rotor {i}", "N") for i in rotors},
        **{f"{axis}_ref": Quantity(f"reference {axis}", "m") for axis in "xyz"},
        **{f"{angle}_ref": Quantity(f"reference {angle}", "rad") for angle in angles},
    }


def rotor_thrusts(columns: Mapping[str, Floats], scenario: Scenario) -> dict[str, Floats]:
    """Thrusts (N) of the rotors, negative where one turns against its spin."""
    vehicle = scenario.any_rotorcraft
    coefficients = scenario.true_vehicle.thrust_coefficients
    rotors = enumerate(zip(coefficients, vehicle.spins, strict=True), start=1)
    return {
        f"thrust_{i}": coefficient
        * sign
        * columns[f"rotor_speed_{i}"]
        * np.abs(columns[f"rotor_speed_{i}"])
        * columns.get(f"thrust_factor_{i}", 1.0)  # of a fault
        for i, (coefficient, sign) in rotors
    }


def _thrust_factors(scenario: Scenario) -> tuple[float, float]:
    factors = [1.0]
    for fault in scenario.fault:
        if fault.type == "rotor_loss":
            factors.append(0.0)
        elif fault.type == "partial_thrust":
            factors.append(fault.factor)
    return min(factors), max(factors)


def rotor_limits(scenario: Scenario) -> RotorLimits:
    """The limits of a rotorcraft's speeds and thrusts."""
    vehicle = scenario.any_rotorcraft
    speeds = vehicle.min_rotor_speed, vehicle.max_rotor_speed
    return RotorLimits(*speeds, _thrust_factors(scenario))


def _compile(
    scenario: Scenario,
    law_states: int,
    extra_actuators: tuple[ExtraActuators, ...],
    userdata_size: int,
    visuals: Visuals,
) -> mujoco.MjModel:
    from tiltsim.models.rotorcraft import compile_model

    spec = model_spec(scenario, law_states, extra_actuators)
    return compile_model(replace(spec, userdata_size=userdata_size), visuals=visuals)


def model_spec(
    scenario: Scenario, law_states: int, extra_actuators: tuple[ExtraActuators, ...]
) -> RotorcraftSpec:
    """The specification of the model of a rotorcraft alone; see `VehicleKind.compile`."""
    from tiltsim.models.rotorcraft import RotorcraftSpec

    vehicle = scenario.any_rotorcraft
    simulation = scenario.simulation
    return RotorcraftSpec(
        vehicle.model,
        scenario.true_vehicle,
        timestep=simulation.timestep,
        integrator=simulation.integrator,
        tilt_servo=TiltServo(**vehicle.tilt_servo.model_dump(exclude={"max_rate"})),
        pod=vehicle.pod if isinstance(vehicle, VehicleTable) else Pod(),
        rotor_limits=rotor_limits(scenario),
        law_states=law_states,
        extra_actuators=extra_actuators,
        ground=scenario.ground,
        objects=objects_of(scenario),
        user_vehicle=vehicle.user_vehicle,
    )


def initial_tilts(plan: FlightPlan) -> tuple[Values, Values]:
    """Tilt angles (rad) and tilt rates (rad/s) at time zero: the gait's.

    A flight begins in the midst of its gait, as the thesis has it, whose angles follow the plan
    exactly. So nothing swings in, and no pod is faster than its servo can be.
    """
    jets = plan.gait.jets(0.0)
    fastest = plan.scenario.any_rotorcraft.tilt_servo.max_rate or inf
    angles = tuple(angle for angle, _, _ in jets)
    return angles, tuple(xp.clip(rate, -fastest, fastest) for _, rate, _ in jets)


def initial_rotor_speeds(plan: FlightPlan) -> Values:
    """Signed rotor speeds (rad/s) at time zero: as given, or a multirotor's in hover."""
    scenario = plan.scenario
    table = scenario.any_rotorcraft
    if not table.cross and scenario.initial.rotor_speed is None:
        vehicle = table.multirotor
        controller, dimension = scenario.controller, 3
        if isinstance(controller, AttitudeForceController):
            dimension = controller.resolve_force(vehicle, plan.gait).dimension
        return hover_speeds(vehicle, initial_tilts(plan)[0], table.speeds_along_spin, dimension)
    speeds = scenario.initial.rotor_speeds(table.rotor_count)
    return tuple(sign * speed for sign, speed in zip(table.spins, speeds, strict=True))


def initial_motion(plan: FlightPlan) -> tuple[Vector, Vector]:
    """``qpos`` and ``qvel`` of MuJoCo at time zero."""
    initial = plan.scenario.initial
    tilting = plan.scenario.vehicle.has_tilting_rotors
    angles, rates = initial_tilts(plan) if tilting else ((), ())
    return (
        (*initial.position, *quaternion_of_euler(initial.attitude), *angles),
        (*initial.velocity, *initial.angular_velocity, *rates),
    )


@cache
def rotorcraft_kind(layout: Layout, extra_columns: tuple[str, ...] = ()) -> VehicleKind:
    """The kind of rotorcraft with a layout, and its columns among `EXTRA_COLUMNS`.

    Fewer than four rotors control attitude and lift only by their tilts, and have no margin at
    given tilts.
    """
    if layout.rotors < FEWEST_WITH_MARGIN:
        extra_columns = tuple(name for name in extra_columns if name != "singularity_margin")
    return VehicleKind(
        observed_fields=layout.observed_fields,
        columns=rotorcraft_columns(layout) | {name: EXTRA_COLUMNS[name] for name in extra_columns},
        thrusts=rotor_thrusts,
        compile=_compile,
        initial_motion=initial_motion,
        limit_exceeded=limit_exceeded_of(layout.observed_fields),
        metrics=rotorcraft_metrics,
    )


FEWEST_WITH_MARGIN: Final = 4

EXTRA_COLUMNS: Final = {
    "singularity_margin": Quantity("singularity margin", "rad"),
    "determinant": Quantity("determinant n · r₃", "1"),
}
"""Columns of controllers that can become singular."""

ROTORCRAFT: Final = rotorcraft_kind(CROSS, tuple(EXTRA_COLUMNS))  # tiltrotor and quadrotor
COLUMNS: Final = ROTORCRAFT.columns  # the columns of every flight of tiltrotor and quadrotor
