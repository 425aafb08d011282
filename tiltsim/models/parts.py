"""Parts and options that models of vehicles are compiled from; a scenario's tables fill them in."""

from collections.abc import Callable
from dataclasses import dataclass, field
from math import inf
from typing import TYPE_CHECKING, Annotated, Final, NamedTuple

from pydantic import Field

from tiltsim_controllers.laws.keys import Keys, Positive, default

if TYPE_CHECKING:
    import mujoco

WRENCH_SIZE: Final = 6

Visuals = bool | Callable[["mujoco.MjSpec"], None]
"""Whether a model has parts that are only drawn or measured; or a function that adds such parts."""


class ExtraActuators(NamedTuple):
    """Actuators that a layer around a control law appends to the vehicle's, in this order."""

    states: int = 0  # integrators that act on nothing: ctrl is the rate of an activation
    memories: int = 0  # act on nothing and have no state: a held ctrl is all there is
    wrench: bool = False  # force (N) and torque (N m) on the body, six, in body axes
    hinge_torques: int = 0  # number of tilt hinges with a torque, N m
    begins_with_rotor_speeds: bool = False  # these states keep within the rotors' limits
    names: tuple[str, ...] = ()  # of the states

    @property
    def controls(self) -> int:
        """Their number of controls."""
        return self.states + self.memories + WRENCH_SIZE * self.wrench + self.hinge_torques


@dataclass(frozen=True)
class TiltServo:
    """The position servo that tilts a pod: ``alpha'' = w^2 (command - alpha) - 2 zeta w alpha'``.

    This holds exactly on a body that does not move; on a free one, which gives way to the pod's
    reaction, the servo is slightly faster.
    """

    natural_frequency: float = 300.0  # w, rad/s
    damping_ratio: float = 1.0  # zeta
    max_angle: float | None = None  # of hinge and command, either way, rad; None to turn around


SERVO_ARMATURE: Final = 1e-6
"""Inertia (kg m^2) of a tilt servo behind its gear, as felt at the hinge.

It loads the servo but, other than the pod's own inertia, turns no body in reaction.
"""


class Pod(Keys):
    """The keys of the part of a rotor that tilts; its center of mass lies on the hinge.

    The defaults are negligible, because the thesis gives its pods no inertia: a pod that turns by
    1 rad then turns chapter 3's body by less than 5e-11 rad. MuJoCo refuses moving bodies below a
    tenth of the bounds; the armature keeps the hinge's equation well conditioned. The inertia is
    equal about all axes, so that the vehicle's does not depend on the tilt.
    """

    mass: Annotated[float, Field(ge=1e-14)] = default(1e-9, "of one pod [kg]", 0.02)
    inertia: Annotated[float, Field(ge=1e-14)] = default(
        1e-13, "about each axis of the pod [kg m^2]", 1e-5
    )


@dataclass(frozen=True)
class RotorLimits:
    """Limits on a rotor's speed, enforced by MuJoCo at the end of each step.

    Within a step the stages of RK4 may see speeds beyond a limit by the change in one step. The
    thrust also stays within the limits there.
    """

    min_speed: float | None = None  # smallest |varpi|, rad/s; None: it may stop and reverse
    max_speed: float | None = None  # largest |varpi|, rad/s, in either sense; None: unlimited
    thrust_factors: tuple[float, float] = (1.0, 1.0)  # extremes that faults put on the thrust

    def speed_range(self, spin: float) -> tuple[float, float] | None:
        """The range (rad/s) of the signed speed of a rotor with this spin; None if unlimited."""
        if self.min_speed is None and self.max_speed is None:
            return None
        upper = inf if self.max_speed is None else self.max_speed
        lower = -upper if self.min_speed is None else self.min_speed
        return (lower, upper) if spin > 0.0 else (-upper, -lower)

    @property
    def thrust_range(self) -> tuple[float, float] | None:
        """The range ((rad/s)^2) of the controls of the thrusts; None if unlimited."""
        along_spin = self.speed_range(1.0)
        if along_spin is None:
            return None
        lower, upper = along_spin
        least, greatest = self.thrust_factors
        return lower * abs(lower) * (least if lower > 0.0 else greatest), greatest * upper * upper


class Ground(Keys):
    """The keys of level ground that the vehicle can stand on."""

    height: float = default(0.0, "z of the surface in the world [m]")
    friction: Positive = default(0.8, "coefficient of sliding friction [-]")


@dataclass(frozen=True, kw_only=True)
class ModelSpec:
    """Common specification of the vehicles' models; a scenario's tables have checked its values."""

    timestep: float = 1e-3  # of the physics, s
    integrator: str = "RK4"  # MuJoCo's name: Euler, RK4, implicit or implicitfast
    userdata_size: int = 0  # numbers of user data in the simulation's state
    # Integrators law_1, law_2, ... after the vehicle's actuators, which act on nothing.
    law_states: int = 0
    tilt_servo: TiltServo = field(default=TiltServo())  # ignored for a quadrotor
