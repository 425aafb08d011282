"""Controllers whose law is one function of arrays: baselines, and laws of packages and users.

A package adds one by a subclass of `LawController`, which the entry-point group
``tiltsim.controllers`` names; see docs/controller_package.md.
"""

from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, ClassVar, Literal, TypeVar

from tiltsim.models.rotor_table import Multirotor
from tiltsim.scenario.controller_table import ControllerTable, ReferenceKind
from tiltsim.scenario.reference import Reference
from tiltsim.scenario.rotorcraft import RotorcraftTable, TiltServoTable
from tiltsim.scenario.table import Positive, default
from tiltsim_controllers.analysis.stability import ErrorLoop, linear_loop
from tiltsim_controllers.code.arrays import xp as xp
from tiltsim_controllers.gaits.plans import Gait
from tiltsim_controllers.laws.compensation import Compensating
from tiltsim_controllers.laws.keys import number_of, record_of
from tiltsim_controllers.laws.observed import Command as Command
from tiltsim_controllers.laws.observed import Observed as Observed
from tiltsim_controllers.mathematics.scalar import Triple, Values

Function = TypeVar("Function", bound=Callable[..., Any])


def law(function: Function) -> Function:
    """Mark a function of NumPy arrays from `tiltsim.Observed` to `tiltsim.Command` as a law.

    A law remembers nothing but its states. It is compiled, and flies on every engine and plant. A
    law that cannot be compiled, as with an ``if`` on numbers or a solver, flies as plain Python,
    with a warning that names the line.
    """
    function.is_law = True  # type: ignore[attr-defined]
    return function


def is_law(controller: object) -> bool:
    """Whether `law` marked a function, or it is a `LawController` or a class of these."""
    if isinstance(controller, type):
        return issubclass(controller, LawController)
    return isinstance(controller, LawController) or getattr(controller, "is_law", False)


@dataclass(frozen=True)
class Airframe:
    """The data that a controller has when a flight is planned."""

    vehicle: Multirotor  # all about it, its rotors as a table
    gait: Gait  # gait of its tilts
    initial_tilts: Values  # its tilt angles at time zero, rad
    initial_speeds: Values  # its rotor speeds at time zero, rad/s along the spin
    initial_position: Triple  # its position at time zero, m
    initial_velocity: Triple  # its velocity at time zero, m/s, world axes
    initial_attitude: Triple  # its roll, pitch and yaw at time zero, rad
    initial_body_rates: Triple  # its body rates at time zero, rad/s
    gyroscopic: float  # 1 where the plant has gyroscopic torque, else 0
    timestep: float  # step of the integration, s
    control_timestep: float  # period of control samples, s; 0 if continuous
    latency: int  # control samples from a reading to its command
    speed_limits: tuple[float, float]
    """Lowest and highest rotor speeds that the plant enforces, rad/s along the spin; infinite
    without limits."""
    rotor_time_constant: float | None  # time constant of the rotors' lag, s; None for no lag
    tilt_servo: TiltServoTable  # the servos of its tilts
    reference: Reference  # the flight's ``[reference]`` table
    noise: tuple[float, float]
    """Standard deviations of measured velocities (m/s) and body rates (rad/s), in the mean of a
    second."""

    @property
    def rotors(self) -> int:
        """Their number."""
        return len(self.vehicle.spins)


class EveryRotorcraft:
    """The models of all vehicles that fly, found at each access: kinds are discovered."""

    def __get__(self, _table: object, _type: object = None) -> tuple[str, ...]:
        from tiltsim.scenario.vehicle import VEHICLES

        return tuple(name for name, kind in VEHICLES.items() if issubclass(kind, RotorcraftTable))


class LawTable(ControllerTable):
    """The common part of the tables of laws, wherever the function comes from."""

    vehicle_models = EveryRotorcraft()
    reference_kinds: ClassVar[tuple[ReferenceKind, ...]] = ("position",)
    rotors_have_speeds = True
    damps_swing = True
    leans_unrecorded = True
    linearization = "exact allocation"

    rotor_bandwidth: Positive = default(
        100.0,
        "of the rotors' speed controllers: the speeds approach the commanded ones as a lag of "
        "first order [1/s]",
    )

    def error_loops(self, vehicle: Any) -> list[ErrorLoop]:
        return [linear_loop("rotor speed", (self.rotor_bandwidth,))]

    @property
    def tilt_rate_gain(self) -> float:
        """Rate (1/s) at which the tilts approach the commands of a law with `commands_tilts`."""
        return 30.0


class LawController(LawTable):
    """A controller whose law is one function of arrays, and whose fields are its parameters.

    The rotors take up the commanded speeds with a lag.

    Attributes:
        states: Names and units of the law's states, columns of the flight; names begin with
            ``state_``.
        discrete_states: Likewise, of states that change at control samples only, such as flags and
            queues.
    """

    states: ClassVar[Mapping[str, str]] = {}
    discrete_states: ClassVar[Mapping[str, str]] = {}

    law: str = "numpy"

    @staticmethod
    @abstractmethod
    def control(observed: Observed, p: Any) -> Command:
        """The law.

        Args:
            observed: State and reference, see `tiltsim.Observed`.
            p: Result of `law_parameters`, tuples as arrays.
        """

    def law_function(self, airframe: Airframe) -> Callable[..., Command]:
        """The function of the law: `control`, or one that is chosen by a key or the vehicle."""
        return self.control

    def law_parameters(self, airframe: Airframe) -> tuple[Any, ...]:
        """The law's parameters, a NamedTuple of floats and tuples: by default its own keys."""
        record = record_of(type(self), _not_read(type(self)))
        return record(*(number_of(self, name) for name in record._fields))

    def law_table(self, airframe: Airframe) -> Values:
        """Any number of further floats: ``observed.table``."""
        return ()

    def state_units(self, airframe: Airframe) -> Mapping[str, str]:
        """The law's states and their units: by default `states`."""
        return self.states

    def initial_states(self, airframe: Airframe) -> Values:
        """The law's states at time zero, then its discrete ones."""
        return (0.0,) * (len(self.state_units(airframe)) + len(self.discrete_states))


class TiltingTable(LawTable):
    """Tables of laws that may also command the tilts."""

    only_with: ClassVar = {("tilt_bandwidth",): ("tilts", "free")}

    tilts: Literal["gait", "free"] = default(
        "gait",
        "whether the tilts follow the gait, or are the law's, the gait being the angles at the "
        "start",
    )
    tilt_bandwidth: Positive = default(
        30.0, "of the approach to the tilts that the law commands; needs tilts = free [1/s]"
    )

    @property
    def commands_tilts(self) -> bool:  # type: ignore[override]
        """Whether the tilt angles are the law's."""
        return self.tilts == "free"

    @property
    def tilt_rate_gain(self) -> float:
        return self.tilt_bandwidth

    def check_scenario(self, scenario: Any) -> None:
        if self.commands_tilts and not scenario.vehicle.has_tilting_rotors:
            raise self.mistake("tilts", f"the rotors of the {scenario.vehicle.model} do not tilt")
        super().check_scenario(scenario)


@cache
def _not_read(table: type[LawController]) -> frozenset[str]:
    """Keys of a table that its law does not read: of the bases that it has."""
    bases: set[Any] = {LawController, TiltingTable, Compensating} & {*table.mro()}
    return frozenset(key for base in bases for key in base.model_fields)
