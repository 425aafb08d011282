"""Keys and parameters of the control law of attitude and force, `multirotor`."""

from typing import Annotated, Any, Final, Literal, NamedTuple

from pydantic import Field

from tiltsim_controllers.gaits.motion import GaitParameters
from tiltsim_controllers.laws.allocation import RotorRange
from tiltsim_controllers.laws.gains import Gains, GivenGains, IntegralGains
from tiltsim_controllers.laws.keys import Keys, NonNegative, Vector3, default, record_of, required
from tiltsim_controllers.laws.observed import Failure
from tiltsim_controllers.laws.supervised_vehicles import Watched
from tiltsim_controllers.laws.supervisor import Supervisor
from tiltsim_controllers.mathematics.records import vector_of
from tiltsim_controllers.references.trajectories import ReferenceParameters
from tiltsim_controllers.vehicle.body import Body

ROTATION: Final = 0.0
"""An error of attitude: the rotation that remains, which has no singular pitch."""

EULER_ANGLES: Final = 1.0
"""Another: of roll, pitch and yaw, as in ch. 3."""

INTEGRAL_FIELDS: Final = ("integral_x", "integral_y", "integral_z")
"""The controller's own states: integrals of the position error, m s, world axes."""


class FeedforwardTerms(NamedTuple):
    """The terms that the controller includes: 1 or 0 each."""

    gait_rates: float = 1.0  # tilt rates in Ma
    attitude_rates: float = 1.0  # velocity and acceleration of the roll and pitch references
    reference_derivatives: float = 1.0  # acceleration, jerk and snap of the position reference
    euler_rates: float = 1.0  # exact derivatives of the Euler angles, else the body rates
    gyroscopic_torque: float = 1.0  # omega x I omega
    integral_action: float = 1.0


class Form(NamedTuple):
    """Options that a program of the law is made for; all else is data."""

    dimension: int  # components of force that are outputs, 1 to 3
    norm: str = "speed"  # of the inputs, or "thrust": of the rates of ``w``
    forward: bool = False  # two components are those along x and z, of a vehicle that has three
    losses: bool = False  # whether the controller knows of failures
    supervised: bool = False  # whether a supervisor changes its gait
    own_yaw: bool = False  # whether its decoupler takes yaw and planned tilts even if all rests
    spin: bool = False  # whether it takes along the angular momentum of the rotors


RESTORING: Final = 0.5
"""1/s, the default where rotor speeds would drift."""


class AttitudeForce(Keys):
    """Keys of the law."""

    law: Literal["attitude_force"] = required(
        "feedback linearization of a multirotor: its rotor speeds control the attitude and as "
        "many components of the force as it has; the tilt angles follow the gait"
    )
    dimension: Annotated[int, Field(ge=1, le=3)] | None = default(
        None,
        "how many components of the force are controlled beside the attitude: 1, lift; 2, one "
        "sideways, too, of a vehicle with three that along its x axis; 3, all, so that the "
        "vehicle need not lean; default: as many as the vehicle has at all angles of its gait [-]",
        1,
    )
    decoupler: Literal["none", "conventional", "modified", "exact"] = default(
        "exact",
        "how the vehicle leans to control what its side force leaves of the horizontal position: "
        "as for the tiltrotor; other than exact needs dimension 1 [-]",
    )
    decoupling: Literal["published", "exact"] = default(
        "exact",
        "form of the decoupling matrix; published lacks the factor 2 |rotor speed| in its "
        "attitude rows, as the thesis prints it for the tiltrotor",
    )
    attitude_error: Literal["rotation", "euler_angles"] = default(
        "rotation",
        "what the attitude's error is: the rotation that remains, without any singular attitude, "
        "or roll, pitch and yaw, as in the thesis",
    )
    gains: GivenGains = default("exact", "a named set, or a table of gains or of poles")
    side_gains: Vector3 = default(
        (12.0, 48.0, 64.0),
        "on the errors of acceleration, velocity and position along directions that side force "
        "moves [1/s, 1/s^2, 1/s^3]",
    )
    norm: Literal["speed", "thrust"] = default(
        "speed",
        "of all rotor accelerations that do the same, those of least norm: of the accelerations "
        "themselves, for rotors that turn one way, or of the rates of thrust, for rotors that "
        "reverse",
    )
    slowest_rotor: NonNegative = default(
        5.0, "speed below which norm = thrust accelerates a rotor as if it were that fast [rad/s]"
    )
    restoring: NonNegative | None = default(
        None,
        "rate toward the rotor speeds of least power among those that do the same, "
        "with norm = thrust to those whose thrusts have the least sum of squares; default: "
        f"{RESTORING:g} where they would drift, which is with moving tilts and more rotors than "
        "outputs, else 0 [1/s]",
        0.5,
    )
    turn_time: NonNegative = default(
        0.0, "time in which the reference of roll and pitch is reached, smoothly [s]"
    )


WITH_GAIT: Final[dict[str, Any]] = {
    "gains": Gains,
    "integral": IntegralGains,
    "max_acceleration": float,  # m/s^2 of the feedback, horizontally; integrators stop there
    "max_angular_acceleration": float,  # rad/s^2, desired, per axis
    "anticipation": float,  # s before and after a corner of the gait in which the body turns
    "terms": FeedforwardTerms,
    "gait": GaitParameters,
    "reference": ReferenceParameters,
    "supervisor": Supervisor,
    "limits": RotorRange,  # of prioritized allocation
}
"""Parameters that every law with feed-forward of a gait has beside its keys."""

Parameters = record_of(
    AttitudeForce,
    frozenset({"law", "dimension", "norm"}),  # see `Form`
    vehicle=Body,
    **WITH_GAIT,
    side_integral=float,  # 1/s^4, with the side gains
    rotors=float,  # where in the knots the table of the rotors begins
    restoring=float,  # 1/s, rate toward the least power or sum of w^2
    failure=Failure,
    watched=Watched,
    watched_without=Watched,  # once the failed rotor is known
    upper_side=vector_of(3),  # body axes, of the force with which it lifts, if it has two; else 0
    upper_side_without=vector_of(3),  # once the failed rotor is known
)
"""Parameters of the law: its keys and these."""
