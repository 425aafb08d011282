"""An estimator between the instruments and the controller, which then flies on its estimate.

The filter (`tiltsim_controllers.laws.estimator`) works at a horizon that lies as far back as the
longest delay of an instrument: there each reading meets the state at its time.
From the horizon a predictor integrates the newer inertial readings to the present, and one
transition of all of them carries the covariance along. Readings that arrive early wait in lines.
"""

from functools import cache
from math import ceil, sqrt
from typing import Any, Final, NamedTuple, get_type_hints

import numpy as np

from tiltsim.closed_loop.loop import ClosedLoop
from tiltsim.laws.law import parts
from tiltsim.laws.layers.actuation import along_line
from tiltsim.laws.layers.instruments import Instrument
from tiltsim.laws.layers.layer import Layer, PlantState, wrap_loop
from tiltsim.models.parts import ExtraActuators
from tiltsim.scenario.scenario import FlightPlan
from tiltsim.vehicles.rotorcraft import QW, TILT_1, TILT_RATE_1
from tiltsim_controllers.code.arrays import branch, normal, xp
from tiltsim_controllers.laws import estimator as filters
from tiltsim_controllers.laws.estimator import Estimate, ImuNoise, Outcome, Reading
from tiltsim_controllers.mathematics.attitude import (
    euler_angles,
    quaternion_of_euler,
    quaternion_product,
    rotation_of_quaternion,
)
from tiltsim_controllers.mathematics.linear import cross
from tiltsim_controllers.mathematics.records import Vector3, make_record_type, vector_of
from tiltsim_controllers.mathematics.scalar import Vector, chi_square_quantile

AXES: Final = ("x", "y", "z")
CORRECTIONS: Final = {
    "mocap": ("position", "attitude"),
    "gps": ("position", "velocity"),
    "barometer": ("altitude",),
    "magnetometer": ("direction",),
}
"""Instruments that correct the filter, each with its measurements."""

COMPONENTS: Final = {
    "position": AXES,
    "attitude": AXES,
    "velocity": AXES,
    "altitude": ("z",),
    "direction": AXES,
}

_STATE: Final = {"position": 3, "velocity": 3, "quaternion": 4, "gyro_bias": 3, "force_bias": 3}
_FILTER: Final = {**_STATE, "covariance": filters.PACKED}
_ANGLES: Final = ("roll", "pitch", "yaw")

ESTIMATED: Final = {
    **{f"estimate_{axis}": "m" for axis in AXES},
    **{f"estimate_v{axis}": "m/s" for axis in AXES},
    **{f"estimate_{angle}": "rad" for angle in _ANGLES},
    **{f"estimate_{rate}": "rad/s" for rate in "pqr"},
    **{f"estimate_gyro_bias_{axis}": "rad/s" for axis in AXES},
    **{f"estimate_force_bias_{axis}": "m/s^2" for axis in AXES},
}
DEVIATIONS: Final = {
    **{f"deviation_rotation_{axis}": "rad" for axis in AXES},
    **{f"deviation_v{axis}": "m/s" for axis in AXES},
    **{f"deviation_{axis}": "m" for axis in AXES},
    **{f"deviation_gyro_bias_{axis}": "rad/s" for axis in AXES},
    **{f"deviation_force_bias_{axis}": "m/s^2" for axis in AXES},
}
CONSISTENCY: Final = {"nees": "1", "nis": "1", "nis_count": "1"}

LEAST_VARIANCE: Final = 1e-12
LEAST_GYRO_BIAS: Final = 1e-3  # rad/s: the filter's least deviation of the gyro's bias at the start
LEAST_FORCE_BIAS: Final = 1e-2  # m/s^2, likewise of the accelerometer's

MOST_PREDICTED: Final = 12
"""Integrations of the predictor; where more readings wait, it takes means of some of them."""

CHANNEL: Final = 7000.0  # first channel of the draws of the errors at the start


class Fusion(NamedTuple):
    """The instruments on a vehicle, for which a filter is compiled."""

    carried: tuple[Instrument, ...]

    @property
    def imu(self) -> Instrument:
        """The inertial measurement unit."""
        return next(each for each in self.carried if each.name == "imu")

    @property
    def correctors(self) -> tuple[Instrument, ...]:
        """Instruments that correct the filter."""
        return tuple(each for name in CORRECTIONS for each in self.carried if each.name == name)

    @property
    def horizon(self) -> int:
        """How far back the filter works, control steps."""
        return max(each.late for each in (self.imu, *self.correctors))

    @property
    def readings(self) -> int:
        """Numbers at the end of the velocities."""
        return sum(len(each.columns) for each in self.carried)

    @property
    def innovations(self) -> tuple[str, ...]:
        """Names of the components of all innovations."""
        return tuple(
            f"innovation_{each.name}_{kind}_{axis}"
            for each in self.correctors
            for kind in CORRECTIONS[each.name]
            for axis in COMPONENTS[kind]
        )

    def waits(self, each: Instrument) -> int:
        """Control steps that a reading waits for the horizon."""
        return self.horizon - each.late

    @property
    def sizes(self) -> dict[str, int]:
        """Sizes of the parts of the states."""
        lines = {i.name: self.waits(i) * (len(i.units) + 1) for i in self.correctors}
        line, innovations = 6 * (self.waits(self.imu) + 1), len(self.innovations)
        return {**_FILTER, "imu": line, **lines, "nis": 2, "innovations": innovations}


@cache
def _record(fusion: Fusion) -> Any:
    """The type of the layer's parameters."""
    correctors = {
        each.name: make_record_type(
            f"Corrections{each.name.capitalize()}",
            arm=Vector3,  # m, from the inertial measurement unit
            field=Vector3,  # world axes, of a magnetometer
            **{f"{kind}_variance": vector_of(len(COMPONENTS[kind])) for kind in own},
            **{f"{kind}_gate": float for kind in own},
        )
        for each in fusion.correctors
        for own in [CORRECTIONS[each.name]]
    }
    return make_record_type(
        "Estimation",
        control_timestep=float,  # s
        gravity=float,  # m/s^2
        place=Vector3,  # m, of the inertial measurement unit
        noise=ImuNoise,
        **correctors,
    )


def _reading(kind: str, now: Estimate, value: Any, own: Any, rates: Any) -> Reading:
    """A measurement of an instrument."""
    variance = getattr(own, f"{kind}_variance")
    if kind == "position":
        return filters.position_reading(now, value[:3], own.arm, variance)
    if kind == "attitude":
        return filters.attitude_reading(now, value[3:], variance)
    if kind == "velocity":
        return filters.velocity_reading(now, value[3:], own.arm, variance, rates)
    if kind == "altitude":
        return filters.altitude_reading(now, value, own.arm, variance)
    return filters.direction_reading(now, value, own.field, variance)


def _corrections(
    now: Estimate, name: str, value: Any, own: Any, rates: Any
) -> tuple[Estimate, list[Any], Any, Any]:
    """The state after a reading; innovations by their deviation; NIS and its components."""
    shown: list[Any] = []
    nis: Any = 0.0
    count: Any = 0.0
    for kind in CORRECTIONS[name]:
        seen: Outcome
        reading = _reading(kind, now, value, own, rates)
        now, seen = filters.corrected(now, reading, getattr(own, f"{kind}_gate"))
        shown += [*(seen.innovation / seen.deviation)]
        nis = nis + xp.where(seen.accepted, seen.nis, 0.0)
        count = count + seen.accepted * len(reading.innovation)
    return now, shown, nis, count


def _filtered(
    time: Any, readings: Any, before: Any, fusion: Fusion, p: Any
) -> tuple[Estimate, Estimate, Any]:
    """One sample of the filter: the state at the horizon, at present, and the rates of the states.

    Readings are as the layer of the instruments appends them, ``before`` the states, shape (S,).
    """
    T, unit, horizon = p.control_timestep, fusion.imu, fusion.horizon
    W, late = horizon - unit.late, unit.late
    at = parts(before, **fusion.sizes)
    past = at.imu.reshape(W + 1, 6)
    imu = xp.vstack([readings[unit.first : unit.first + 6], past])  # the newest first
    state = Estimate(*(getattr(at, name) for name in _FILTER))

    def moved(now: Estimate, through: Any, steps: range) -> Any:
        """Through control steps, numbered backwards from the latest reading."""
        lengths = [xp.where(time > (step + late + 0.5) * T, T, 0.0) for step in steps]
        means = [0.5 * (imu[step] + imu[step + 1]) for step in steps]
        length = sum(lengths)
        whole = sum(each * mean for each, mean in zip(lengths, means))
        mean = means[0] if len(steps) == 1 else whole / xp.maximum(length, T)
        return filters.integrated(now, through, mean[3:], mean[:3], length, p.gravity)

    now, through = moved(state, filters.no_transition(), range(W, W + 1))
    now = now._replace(covariance=filters.propagated(now.covariance, through, p.noise))
    lines, shown, nis, count = [], [], at.nis[0], at.nis[1]
    first = 0
    for each in fusion.correctors:
        own, size = getattr(p, each.name), len(each.units) + 1
        sent = readings[each.first : each.first + size]
        waiting = getattr(at, each.name).reshape(fusion.waits(each), size)
        value, line_rates = along_line(waiting, sent, T)
        lines.append(line_rates.ravel())
        names = sum(len(COMPONENTS[kind]) for kind in CORRECTIONS[each.name])
        kept = [*at.innovations[first : first + names]]
        first += names

        def fused(now: Any = now, each: Any = each, value: Any = value, own: Any = own) -> Any:
            return _corrections(now, each.name, value[:-1], own, imu[W][3:])

        def waits(now: Any = now, kept: Any = kept) -> Any:
            return now, kept, 0.0, 0.0

        due = (value[-1] > 0.0) & (time > (horizon - 0.5) * T)
        now, own_shown, own_nis, own_count = branch(due, fused, waits)
        shown += own_shown
        nis, count = nis + own_nis, count + own_count
    present, through = now, filters.no_transition()
    together = max(1, ceil(W / MOST_PREDICTED))
    for first in reversed(range(0, W, together)):
        steps = range(first, min(first + together, W))
        present, through = moved(present, through, steps)
    if late:  # nothing newer is known
        length = xp.minimum(late * T, time)
        present, through = filters.integrated(
            present, through, imu[0, 3:], imu[0, :3], length, p.gravity
        )
    if horizon:
        carried = filters.propagated(now.covariance, through, p.noise)
        present = present._replace(covariance=carried)
    rates = (xp.hstack([*now]) - before[: len(xp.hstack([*now]))]) / T
    moving = (imu[:-1] - past) / T
    tail = (xp.hstack([nis, count, *shown]) - xp.hstack([at.nis, at.innovations])) / T
    return now, present, xp.hstack([rates, moving.ravel(), *lines, tail])


def _nees(present: Estimate, qpos: Any, qvel: Any, place: Any) -> Any:
    """The squared errors of rotation, velocity and position, by their covariance."""
    quaternion = qpos[QW:TILT_1]
    rotation = rotation_of_quaternion(quaternion)
    truth = present._replace(
        position=qpos[:3] + rotation @ place,
        velocity=qvel[:3] + rotation @ cross(qvel[3:6], place),
        quaternion=quaternion,
    )
    return filters.nees_of(present, truth, filters.NAVIGATION_ERRORS)


@cache
def with_estimator(loop: ClosedLoop, fusion: Fusion) -> ClosedLoop:
    """A loop whose controller sees an estimate in place of the true motion.

    It goes between the controller and the layer of the instruments, which appends their readings
    to the velocities.
    """
    first = loop.sizes.act
    states, gyro = sum(fusion.sizes.values()), fusion.imu.first + 3
    fields = {**ESTIMATED, **DEVIATIONS, **CONSISTENCY, **dict.fromkeys(fusion.innovations, "1")}

    def controls(within: Any, time: Any, state: PlantState, p: Any, knots: Any) -> Any:
        qpos, qvel, act = state
        size = len(qvel) - fusion.readings
        readings, before = qvel[size:], act[first : first + states]
        _, present, rates = _filtered(time, readings, before, fusion, p)
        rotation = rotation_of_quaternion(present.quaternion)
        omega = readings[gyro : gyro + 3] - present.gyro_bias
        position = present.position - rotation @ p.place
        velocity = present.velocity - rotation @ cross(omega, p.place)
        seen = PlantState(
            xp.hstack([position, present.quaternion, qpos[TILT_1:]]),
            xp.hstack([velocity, omega, qvel[TILT_RATE_1:size]]),
            act,
        )
        after = parts(before + p.control_timestep * rates, **fusion.sizes)
        estimated = [position, velocity, euler_angles(present.quaternion), omega]
        variances = xp.array([present.covariance[i * (i + 3) // 2] for i in range(filters.ERRORS)])
        consistency = [_nees(present, qpos, qvel, p.place), *after.nis, *after.innovations]
        shown = [*estimated, present.gyro_bias, present.force_bias, xp.sqrt(variances)]
        return xp.hstack([within(seen), rates, *shown, *consistency])

    layer = Layer(
        _record(fusion),
        lambda plan: _parameters(plan, fusion),
        controls=controls,
        actuators=ExtraActuators(states=states, memories=len(fields)),
        initial_activations=lambda plan, p, _inner: _start(plan, p, fusion),
        remembered=fields,
        of_controller=True,
    )
    return wrap_loop(loop, layer)


def _parameters(plan: FlightPlan, fusion: Fusion) -> Any:
    """The layer's parameters: the noise of the filter is the instruments' own."""
    scenario, record = plan.scenario, _record(fusion)
    sensors, timestep = scenario.sensors, scenario.simulation.control_timestep
    imu, estimator = sensors.imu, scenario.controller.estimator_table
    assert imu is not None
    assert estimator is not None
    period = max(imu.period(timestep), timestep)
    known = imu.errors(1.0 / imu.period(timestep), 0)
    density = [sqrt(period) * _deviation(known, i) for i in (0, 3)]
    walk = [known.walk[i] / sqrt(imu.period(timestep)) for i in (0, 3)]
    types = get_type_hints(record)
    correctors = {}
    for each in fusion.correctors:
        table = getattr(sensors, each.name)
        errors, place = table.errors(1.0 / table.period(timestep), 0), 0
        own: dict[str, Any] = {}
        for kind in CORRECTIONS[each.name]:
            count = len(COMPONENTS[kind])
            deviations = [_deviation(errors, place + i) for i in range(count)]
            own[f"{kind}_variance"] = tuple(max(d * d, LEAST_VARIANCE) for d in deviations)
            own[f"{kind}_gate"] = chi_square_quantile(estimator.gate, count)
            place += count
        field = table.field if each.name == "magnetometer" else (0.0, 0.0, 0.0)
        arm = tuple(np.subtract(getattr(table, "position", imu.position), imu.position).tolist())
        correctors[each.name] = types[each.name](arm, field, **own)
    return record(
        timestep,
        plan.scenario.any_rotorcraft.resolve().gravity,
        imu.position,
        ImuNoise(density[1], density[0], walk[1], walk[0]),
        **correctors,
    )


def _deviation(errors: Any, index: int) -> float:
    """Standard deviation of a reading, the uniform error of its resolution included."""
    return sqrt(errors.noise[index] ** 2 + errors.resolution[index] ** 2 / 12.0)


def _start(plan: FlightPlan, p: Any, fusion: Fusion) -> Vector:
    """The states at time zero: the true motion with drawn errors, and no bias.

    The errors have the covariance with which the filter starts.
    """
    scenario, initial = plan.scenario, plan.scenario.initial
    imu, table = scenario.sensors.imu, scenario.controller.estimator_table
    assert imu is not None
    assert table is not None
    sizes = (table.initial_attitude, table.initial_velocity, table.initial_position)
    seed = float(scenario.simulation.seed)
    draws = [normal(seed, CHANNEL + i, 0.0) for i in range(filters.NAVIGATION_ERRORS)]
    error = np.array(draws) * np.repeat(sizes, 3)
    quaternion = np.array(quaternion_of_euler(initial.attitude))
    rotation = rotation_of_quaternion(quaternion)
    position = initial.position + rotation @ p.place
    velocity = initial.velocity + rotation @ cross(initial.angular_velocity, p.place)
    turned = quaternion_product(filters.quaternion_of_vector(error[:3]), quaternion)
    biases = [*(max(abs(b), LEAST_GYRO_BIAS) for b in imu.gyro_bias)]
    biases += [max(abs(b), LEAST_FORCE_BIAS) for b in imu.accelerometer_bias]
    covariance = np.diag(np.square([*np.repeat(sizes, 3), *biases]))
    state = [position + error[6:9], velocity + error[3:6], turned, np.zeros(6)]
    packed = covariance[filters.ROWS, filters.COLUMNS]
    rest = sum(fusion.sizes.values()) - 16 - filters.PACKED
    return tuple(np.hstack([*state, packed, np.zeros(rest)]).tolist())
