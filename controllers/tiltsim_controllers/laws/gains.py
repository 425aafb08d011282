"""Gains of attitude, altitude and position: their keys, poles, and sets by name."""

from typing import Annotated, Any, Final, Literal, NamedTuple

from pydantic import ConfigDict, Discriminator, Field, Tag

from tiltsim_controllers.code.arrays import xp
from tiltsim_controllers.laws.keys import (
    Gains2,
    Keys,
    NonNegative,
    Positive,
    Vector3,
    default,
    gain_kind,
    required,
)
from tiltsim_controllers.mathematics import records


class Gains(NamedTuple):
    """Gains of the third-order error dynamics and of the position loop (ch. 4, Eqs. 26-28).

    By order: on the errors of the second derivative, of the first, and of the output.
    """

    attitude_1: records.Vector3  # [diagonal of K_P1] roll, pitch and yaw, 1/s
    attitude_2: records.Vector3  # [K_P2] 1/s^2
    attitude_3: records.Vector3  # [K_P3] 1/s^3
    altitude: records.Vector3  # [K_PZ1, K_PZ2, K_PZ3] 1/s, 1/s^2, 1/s^3
    position: records.Vector2  # [K_X1 = K_Y1, K_X2 = K_Y2] on velocity and position, 1/s, 1/s^2

    @property
    def attitude(self) -> Any:
        """Gains of roll, pitch and yaw, one row for each order, shape (3, 3)."""
        return xp.array(self[:3])

    @property
    def loops(self) -> dict[str, tuple[float, ...]]:
        """The three gains of each output with third-order error dynamics, by order."""
        roll, pitch, yaw = zip(*self[:3])
        return {"roll": roll, "pitch": pitch, "yaw": yaw, "altitude": self.altitude}


class IntegralGains(NamedTuple):
    """Gains on the integrals of the position error."""

    position: float = 0.0  # 1/s^3, x and y
    altitude: float = 0.0  # 1/s^4


class Poles(NamedTuple):
    """The desired poles of a closed loop."""

    bandwidth: float  # [omega] natural frequency of its pair of poles, rad/s
    damping: float = 1.0  # [zeta] of the pair
    integral: float = 0.0  # [lambda] pole at -lambda for an integral, rad/s; 0 for none


def second_order_gains(poles: Poles) -> tuple[float, float, float]:
    """Gains of ``(s^2 + 2 zeta omega s + omega^2)(s + lambda)``, the integral's last."""
    omega, zeta, integral = poles
    return (
        2.0 * zeta * omega + integral,
        omega * omega + 2.0 * zeta * omega * integral,
        omega * omega * integral,
    )


def third_order_gains(poles: Poles) -> tuple[float, float, float, float]:
    """Gains of ``(s^2 + 2 zeta omega s + omega^2)(s + omega)(s + lambda)``, the integral's last."""
    omega, zeta, integral = poles
    k1, k2, k3 = (1.0 + 2.0 * zeta) * omega, (1.0 + 2.0 * zeta) * omega**2, omega**3
    return k1 + integral, k2 + k1 * integral, k3 + k2 * integral, k3 * integral


def gains_from_poles(
    attitude: Poles, yaw: Poles, altitude: Poles, position: Poles
) -> tuple[Gains, IntegralGains]:
    """Gains by pole placement, for the exact decoupling matrix.

    Args:
        attitude, yaw, altitude: poles of third-order loops, with a real pole at the bandwidth
        position: poles of a second-order loop
    """
    lean, turn = third_order_gains(attitude)[:3], third_order_gains(yaw)[:3]
    *climb, climb_integral = third_order_gains(altitude)
    *move, move_integral = second_order_gains(position)
    first, second, third = zip(lean, lean, turn)
    gains = Gains(first, second, third, tuple(climb), tuple(move))
    return gains, IntegralGains(move_integral, climb_integral)


class GainTable(Keys):
    """Explicit gains; see `tiltsim_controllers.laws.gains.Gains`."""

    attitude: Annotated[tuple[Vector3, Vector3, Vector3], Field(strict=False)] = required(
        "diagonals of K_P1, K_P2 and K_P3, each roll, pitch, yaw: on the errors of angular "
        "acceleration, rate and angle [1/s, 1/s^2, 1/s^3]",
        [[40, 40, 40], [600, 600, 600], [4000, 4000, 4000]],
    )
    altitude: Vector3 = required(
        "K_PZ1, K_PZ2, K_PZ3: on the errors of vertical acceleration, velocity and altitude [1/s, "
        "1/s^2, 1/s^3]",
        [10.0, 15.0, 10.0],
    )
    position: Gains2 = default(
        (1.0, 1.0), "K_X1, K_X2: on the errors of horizontal velocity and position [1/s, 1/s^2]"
    )


class PoleTable(Keys):
    """The poles of one closed loop: a pair, and for third order a real one at its bandwidth."""

    bandwidth: Positive = required("natural frequency [rad/s]", 10.0)
    damping: Positive = default(1.0, "damping ratio of the pair [-]", 0.7)

    @property
    def poles(self) -> Poles:
        """The poles as `gains_from_poles` takes them."""
        return Poles(**dict(self))


class IntegralPoleTable(PoleTable):
    """The poles of a loop that may have integral action."""

    integral: NonNegative = default(
        0.0, "pole of integral action; 0 disables it; needs gait_rate_feedforward [rad/s]", 0.5
    )


class PolePlacementTable(Keys):
    """Gains by pole placement; see `tiltsim_controllers.laws.gains.gains_from_poles`."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [{"attitude": {"bandwidth": 25.0}, "altitude": {"bandwidth": 10.0}}]
        }
    )

    attitude: PoleTable = required("the loops of roll and pitch")
    yaw: PoleTable | None = default(None, "the loop of yaw; default: as attitude")
    altitude: IntegralPoleTable = required("the loop of the altitude")
    position: IntegralPoleTable = default(
        IntegralPoleTable(bandwidth=1.0, damping=0.5), "the loops of x and y"
    )

    def resolve(self) -> tuple[Gains, IntegralGains]:
        """The gains of the control law and of its integrals."""
        yaw = self.yaw or self.attitude
        return gains_from_poles(
            self.attitude.poles, yaw.poles, self.altitude.poles, self.position.poles
        )


def attitude_altitude_gain_kind(value: object) -> str:
    """The tag of gains that may also be given by poles."""
    if isinstance(value, PolePlacementTable):
        return "poles"
    loops = value.values() if isinstance(value, dict) else ()
    return "poles" if any(isinstance(loop, dict) for loop in loops) else gain_kind(value)


GivenGains = Annotated[
    Annotated[Literal["ch03", "ch04", "exact", "feedforward"], Tag("named")]
    | Annotated[GainTable, Tag("table")]
    | Annotated[PolePlacementTable, Tag("poles")],
    Discriminator(attitude_altitude_gain_kind),
]
"""The name of a set of gains, gains, or poles."""


_LAST: Final = ((10.0, 5.0, 10.0), (1.0, 1.0))  # ch. 4's gains of altitude and position

GAIN_SETS: Final = {
    # ch. 3, Sec. 3.2; the position loop is ch. 4's, ch. 3 has none
    "ch03": Gains((1.0,) * 3, (1.0,) * 3, (1.0,) * 3, *_LAST),
    # ch. 4, Sec. 3.4, Eqs. (26)-(28)
    "ch04": Gains((1.0, 1.0, 1.0), (10.0, 10.0, 1.0), (50.0, 50.0, 1.0), *_LAST),
    # for the exact decoupling matrix, under which the two sets above fail Proposition 4: attitude
    # poles at -20 and -10 +- 10j, altitude poles well damped near -1 to -14
    "exact": Gains((40.0,) * 3, (600.0,) * 3, (4000.0,) * 3, (10.0, 15.0, 10.0), (1.0, 1.0)),
    # for gait-rate feed-forward: attitude poles at -25, yaw's and the altitude's at -10, -1.5
    "feedforward": gains_from_poles(Poles(25.0), Poles(10.0), Poles(10.0), Poles(1.5))[0],
}
"""Named gain sets; `exact` and `feedforward` are ours, the others published."""
