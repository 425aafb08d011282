"""Several vehicles in one world, each under its own controller, as one closed loop.

MuJoCo's vectors hold one vehicle after the other, then the objects. A function of the loop calls
the functions of the vehicles on their parts; none of them sees the others.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache
from itertools import combinations
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from tiltsim.closed_loop.limits import VEHICLE, WITHIN_LIMITS
from tiltsim.closed_loop.loop import ClosedLoop, ControlSetup, Sizes
from tiltsim.engines.sample_evaluation import evaluate_over_samples
from tiltsim.models.parts import ExtraActuators, Visuals
from tiltsim.scenario.scenario import FlightPlan, Scenario, plan_flight
from tiltsim.vehicles.metrics import position_error
from tiltsim.vehicles.rotorcraft import QW, TILT_1, model_spec
from tiltsim_controllers.code.arrays import traceable, xp
from tiltsim_controllers.mathematics.attitude import rotation_of_quaternion
from tiltsim_controllers.mathematics.records import make_record_type
from tiltsim_controllers.mathematics.scalar import Floats, Vector
from tiltsim_controllers.vehicle.air import Downwash, Wake, downwash_force

if TYPE_CHECKING:
    import mujoco


DOWNWASH: Final = "downwash"
"""Column of the force (N) of the wakes of other vehicles along the world's z."""

TRACED: Final = ("controls", "hold", "observe", "sign_check_values")
PLANNED: Final = ("setup", "initial_activations", "derive", "causes")
OF_KIND: Final = ("compile", "initial_motion", "thrusts", "metrics")
"""Functions of `ClosedLoop`, traced or not, and of `VehicleKind`, that several vehicles replace."""


class Member(NamedTuple):
    """A vehicle among several."""

    name: str  # empty for the first
    loop: ClosedLoop
    knots: int

    @property
    def prefix(self) -> str:
        """The beginning of the names of its columns."""
        return f"{self.name}_" if self.name else ""

    @property
    def fields(self) -> tuple[str, ...]:
        """Its fields of a sample."""
        return tuple(f"{self.prefix}{name}" for name in self.loop.sample_fields[1:])

    def own(self, columns: Mapping[str, Any]) -> dict[str, Any]:
        """Its columns, or fields of a sample, of all vehicles' by the names of a vehicle alone."""
        size, common = len(self.prefix), {"time": columns["time"]}
        mine = columns.items() if size else ()
        found = {k[size:]: v for k, v in mine if k.startswith(self.prefix)}
        return common | found if size else {**columns}

    def shared(self, columns: Mapping[str, Any]) -> dict[str, Any]:
        """Columns that have the names of a vehicle alone, by their names among several vehicles."""
        return {f"{self.prefix}{name}": value for name, value in columns.items() if name != "time"}


def _plans(plan: FlightPlan) -> tuple[FlightPlan, ...]:
    """The plans of all vehicles, the first one's first."""
    return (plan, *map(plan_flight, plan.scenario.companions))


def _parts(sizes: Sequence[int], vector: Any) -> Iterator[Any]:
    """Consecutive parts of a vector; the last one ends with it."""
    first = 0
    for size in sizes:
        yield vector[first : first + size]
        first += size


def _wakes(scenario: Scenario) -> tuple[Any, ...]:
    """The effect of wakes, and the wakes of all vehicles."""
    table, flown = scenario.downwash, (scenario, *scenario.companions)
    if table is None:
        return (Downwash(), *[Wake(0.0, 0.0)] * len(flown))
    disc = np.pi * table.rotor_radius**2
    vehicles = [one.true_vehicle for one in flown]
    wakes = (
        Wake(vehicle.mass * vehicle.gravity, disc * one.vehicle.rotor_count)
        for vehicle, one in zip(vehicles, flown, strict=True)
    )
    return (Downwash(scenario.air.density, table.drag_area), *wakes)


def _metrics_among(
    columns: Mapping[str, Floats], members: Sequence[Member], scenario: Scenario
) -> dict[str, Any]:
    """Metrics of all vehicles together."""
    places = [np.stack([columns[f"{member.prefix}{axis}"] for axis in "xyz"]) for member in members]
    apart = [
        np.linalg.norm(one - other, axis=0).min(axis=-1) for one, other in combinations(places, 2)
    ]
    errors = []
    for member, own in zip(members[1:], scenario.companions, strict=True):
        axes = "xyz" if member.loop.follows_position(own) else "z"
        mine = (member.prefix + axis for axis in axes)
        found = position_error(*(columns[f"{name}_ref"] - columns[name] for name in mine))
        errors.append(found["rms_position_error"])
    return {
        "minimum_separation": np.min(apart, axis=0),
        "companion_rms_position_error": np.max(errors, axis=0),
    }


@cache
def with_companions(members: tuple[Member, ...], downwash: bool) -> ClosedLoop:
    """The loop of several vehicles, the first of which keeps its names and has the objects.

    With downwash their wakes act on vehicles below.
    """
    return Several(members, downwash).closed_loop()


class Several:
    """The functions of the loop of several vehicles; see `ClosedLoop`.

    Args:
        members, downwash: See `with_companions`.
    """

    def __init__(self, members: tuple[Member, ...], downwash: bool) -> None:
        self._members, self._downwash = members, downwash
        self._loops = [member.loop for member in members]
        self._wrench = ExtraActuators(wrench=downwash)
        own = [loop.sizes for loop in self._loops]
        self._sizes = [size._replace(ctrl=size.ctrl + self._wrench.controls) for size in own]
        self._total = Sizes(*(sum(numbers) for numbers in zip(*self._sizes, strict=True)))
        self._names = ["inner", *(f"vehicle_{number}" for number in range(1, len(members)))]
        parameters = {n: loop.parameters for n, loop in zip(self._names, self._loops, strict=True)}
        wakes = dict.fromkeys(self._names, Wake)
        self._layer = make_record_type("Wakes", downwash=Downwash, **wakes)
        self._forces = traceable(self._forces_at)
        self._record = make_record_type(
            "Companions", signature=float, layer=self._layer, **parameters
        )

    def _states(self, qpos: Any, qvel: Any, act: Any) -> Iterator[tuple[Any, Any, Any]]:
        """The state of each vehicle; the first one also sees objects and readings."""
        seen = [*_parts([size.act for size in self._sizes], act)]
        if self._total.after_act:
            seen[0] = xp.hstack([seen[0], act[self._total.act :]])
        places = _parts([size.qpos for size in self._sizes], qpos)
        return zip(places, _parts([size.qvel for size in self._sizes], qvel), seen, strict=True)

    def _controls_of(self, ctrl: Any) -> Iterator[Any]:
        vehicles = zip(_parts([size.ctrl for size in self._sizes], ctrl), self._loops, strict=True)
        return (own[: loop.sizes.ctrl] for own, loop in vehicles)

    def _values_of(self, values: Any) -> Iterator[Any]:
        return _parts([len(member.fields) for member in self._members], values)

    def _parameters(self, parameters: Any) -> list[Any]:
        return [getattr(parameters, name) for name in self._names]

    def _setups(self, parameters: Any, knots: Any) -> Iterator[ControlSetup]:
        counts = [member.knots for member in self._members]
        return map(ControlSetup, self._parameters(parameters), _parts(counts, knots))

    def controls(
        self, time: Any, qpos: Any, qvel: Any, act: Any, parameters: Any, knots: Any
    ) -> Any:
        """See `ClosedLoop`."""
        found = zip(self._loops, self._states(qpos, qvel, act), self._setups(parameters, knots))
        own = [loop.controls(time, *s, *p) for loop, s, p in found]
        return self._with_wakes(own, qpos, parameters)

    def hold(self, time: Any, qpos: Any, qvel: Any, act: Any, ctrl: Any, parameters: Any) -> Any:
        """See `ClosedLoop`."""
        states, held = self._states(qpos, qvel, act), self._controls_of(ctrl)
        found = zip(self._loops, states, held, self._parameters(parameters), strict=True)
        own = [loop.hold(time, *s, c, p) for loop, s, c, p in found]
        return self._with_wakes(own, qpos, parameters)

    def _with_wakes(self, controls: list[Any], qpos: Any, parameters: Any) -> Any:
        """The controls of all vehicles, each with the wrench of the other vehicles' wakes."""
        if not self._downwash:
            return xp.hstack(controls)
        poses = [*_parts([size.qpos for size in self._sizes], qpos)]
        forces = self._forces_at(0.0, xp.hstack([pose[:3] for pose in poses]), parameters, ())
        up = [rotation_of_quaternion(pose[QW:TILT_1])[2] for pose in poses]
        wrenches = [xp.hstack([z * force, xp.zeros(3)]) for z, force in zip(up, forces)]
        return xp.hstack([part for both in zip(controls, wrenches) for part in both])

    def sees(self, time: Any, qpos: Any, qvel: Any, act: Any, parameters: Any, knots: Any) -> Any:
        """See `ClosedLoop`; the first vehicle also sees what lies behind all activations."""
        return next(self._states(qpos, qvel, act))

    def observe(self, qpos: Any, qvel: Any, act: Any, ctrl: Any) -> Any:
        """See `ClosedLoop`."""
        found = zip(self._loops, self._states(qpos, qvel, act), self._controls_of(ctrl))
        return xp.hstack([loop.observe(*s, c) for loop, s, c in found])

    def sign_check_values(self, time: Any, values: Any, parameters: Any, knots: Any) -> Any:
        """See `ClosedLoop`."""
        found = zip(self._loops, self._values_of(values), self._setups(parameters, knots))
        checked = [loop.sign_check_values(time, v, *p) for loop, v, p in found]
        return xp.hstack([*map(xp.array, checked)])

    def limit_exceeded(
        self, time: Any, values: Any, reference: Any, knots: Any, follows_position: Any
    ) -> Any:
        """See `VehicleKind`."""
        found: Any = 0.0
        vehicles = enumerate(zip(self._loops, self._values_of(values), strict=True))
        for number, (loop, own) in reversed([*vehicles]):
            # A companion is lost where it is far above or below the first one's reference.
            follows = 0.0 if number else follows_position
            code = loop.kind.limit_exceeded(time, own, reference, knots, follows)
            found = xp.where(code != float(WITHIN_LIMITS), code + float(VEHICLE * number), found)
        return found

    def setup(self, plan: FlightPlan, signature: float) -> ControlSetup:
        """See `ClosedLoop`."""
        each = [loop.setup(own, loop.signature) for loop, own in zip(self._loops, _plans(plan))]
        knots = tuple(knot for one in each for knot in one.knots)
        layer = self._layer(*_wakes(plan.scenario))
        own = (one.parameters for one in each)
        return ControlSetup(self._record(signature, layer, *own), knots)

    def initial_activations(self, plan: FlightPlan, setup: ControlSetup) -> Vector:
        """See `ClosedLoop`."""
        found = zip(self._loops, _plans(plan), self._setups(*setup), strict=True)
        return [a for loop, p, s in found for a in loop.initial_activations(p, s)]

    def initial_motion(self, plan: FlightPlan) -> tuple[Vector, Vector]:
        """See `VehicleKind`."""
        each = [loop.kind.initial_motion(own) for loop, own in zip(self._loops, _plans(plan))]
        return [q for qpos, _ in each for q in qpos], [v for _, qvel in each for v in qvel]

    def derive(self, samples: Mapping[str, Floats], setup: ControlSetup) -> dict[str, Floats]:
        """See `ClosedLoop`."""
        found: dict[str, Floats] = {}
        for member, own in zip(self._members, self._setups(*setup), strict=True):
            found |= member.shared(member.loop.derive(member.own(samples), own))
        if self._downwash:
            names = [member.prefix + axis for member in self._members for axis in "xyz"]
            states = np.stack([samples[name] for name in names], axis=-1)
            own = setup._replace(knots=())
            forces = evaluate_over_samples(
                self._forces, len(self._members), samples["time"], states, own
            )
            found |= {f"{m.prefix}{DOWNWASH}": f for m, f in zip(self._members, forces.T)}
        return found

    def _forces_at(self, _time: Any, state: Any, parameters: Any, _knots: Any) -> Any:
        """The forces of the wakes (N, along z) at the positions of all vehicles."""
        places = state.reshape(len(self._members), 3)
        downwash, *wakes = parameters.layer
        numbers = range(len(self._members))
        return xp.array([downwash_force(places, number, wakes, downwash) for number in numbers])

    def causes(self, sample: Mapping[str, float], setup: ControlSetup) -> tuple[str, ...]:
        """See `ClosedLoop`."""
        return tuple(
            f"{member.name}: {text}" if member.name else text
            for member, own in zip(self._members, self._setups(*setup), strict=True)
            for text in member.loop.causes(member.own(sample), own)
        )

    def thrusts(self, columns: Mapping[str, Floats], scenario: Scenario) -> dict[str, Floats]:
        """See `VehicleKind`."""
        found: dict[str, Floats] = {}
        for member, own in zip(self._members, (scenario, *scenario.companions), strict=True):
            found |= member.shared(member.loop.kind.thrusts(member.own(columns), own))
        return found

    def metrics(
        self, columns: Mapping[str, Floats], scenario: Scenario, follows_position: bool
    ) -> dict[str, Any]:
        """See `VehicleKind`."""
        own = self._loops[0].kind.metrics(columns, scenario, follows_position)
        return own | _metrics_among(columns, self._members, scenario)

    def compile(
        self, scenario: Scenario, _states: int, _extra: Any, size: int, visuals: Visuals
    ) -> mujoco.MjModel:
        """See `VehicleKind`.

        Args:
            scenario: The first vehicle's.
            _states, _extra: The first vehicle's, which its loop has as well.
            size: Numbers of user data.
            visuals: See `Visuals`.
        """
        from tiltsim.models.rotorcraft import compile_model

        added = [self._wrench] if self._downwash else []
        flown = zip((scenario, *scenario.companions), self._loops, strict=True)
        first, *others = (
            replace(
                model_spec(own, loop.controller_states, (*loop.extra_actuators, *added)),
                number=number,
            )
            for number, (own, loop) in enumerate(flown)
        )
        names = (member.name for member in self._members[1:])
        spec = replace(first, userdata_size=size, companions=tuple(zip(names, others, strict=True)))
        return compile_model(spec, visuals=visuals)

    def closed_loop(self) -> ClosedLoop:
        """The closed loop, whose columns are the first vehicle's, then all others with a prefix."""
        first, others = self._loops[0], self._members[1:]
        fields = [name for member in others for name in member.fields]
        units = [first.further_units, *(member.shared(member.loop.units) for member in others)]
        units += [{f"{m.prefix}{DOWNWASH}": "N" for m in self._members if self._downwash}]
        return replace(
            first,
            kind=replace(
                first.kind,
                limit_exceeded=traceable(self.limit_exceeded),
                **{name: getattr(self, name) for name in OF_KIND},
            ),
            parameters=self._record,
            model=" and ".join(loop.model for loop in self._loops),
            sizes=self._total,
            **{name: getattr(self, name) for name in PLANNED},
            **{name: traceable(getattr(self, name)) for name in TRACED},
            fields=(*first.fields, *fields),
            further_units={k: u for each in units for k, u in each.items()},
            observe_reads_controls=any(loop.observe_reads_controls for loop in self._loops),
            equations=None,
            within=first,  # for its controller
            sees=self.sees,
            traced=all(loop.is_traceable for loop in self._loops),
        )
