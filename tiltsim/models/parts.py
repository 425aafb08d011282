"""Parts of a vehicle that its model is compiled with."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Final, NamedTuple


class ExtraActuators(NamedTuple):
    """Actuators that a layer around a law appends to the vehicle's, in this order."""

    states: int = 0  # integrators that act on nothing: ctrl is the rate of an activation
    memories: int = 0  # act on nothing and have no state: a held ctrl is all there is
    wrench: bool = False  # force (N) and torque (N m) on the body, six, in body axes


INTEGRATORS: Final = ("Euler", "RK4", "implicit", "implicitfast")


@dataclass(frozen=True)
class TiltServo:
    """The position servo that tilts a pod: ``alpha'' = w^2 (command - alpha) - 2 zeta w alpha'``.

    This holds exactly on a body that does not move; on a free one, which gives way to the pod's
    reaction, the servo is slightly faster.

    Attributes
    ----------
    natural_frequency : float
        ``w``, rad/s.
    damping_ratio : float
        ``zeta``, dimensionless.
    max_angle : float or None
        Largest tilt angle either way, rad: the command is clipped there and the hinge has a stop.
        None leaves the pod free to turn around.
    """

    natural_frequency: float = 300.0
    damping_ratio: float = 1.0
    max_angle: float | None = None


@dataclass(frozen=True)
class Pod:
    """The part of a rotor that tilts; its centre of mass lies on the hinge.

    The defaults are as good as nothing, for the thesis gives its pods no inertia: a pod that
    turns by 1 rad then turns chapter 3's body by less than 5e-11 rad. MuJoCo refuses moving
    bodies below 1e-15; the armature keeps the hinge's equation well conditioned.

    Attributes
    ----------
    mass : float
        kg.
    inertia : float
        About any axis through the pod's centre of mass, kg m^2; the same for all axes, so that
        the vehicle's inertia does not depend on the tilt.
    """

    mass: float = 1e-9
    inertia: float = 1e-13


@dataclass(frozen=True)
class RotorLimits:
    """Limits on a rotor's speed, held by MuJoCo at the end of each step.

    Within a step the stages of RK4 may see speeds beyond a limit by what one step adds. The thrust
    stays within the limits there, too.

    Attributes
    ----------
    min_speed : float or None
        Smallest ``|varpi|``, rad/s: the rotor cannot reverse. None lets it stop and reverse.
    max_speed : float or None
        Largest ``|varpi|``, rad/s, in either sense where the rotor may reverse. None is unlimited.
    thrust_factors : tuple of float
        The least and the greatest factor on the thrust that the flight brings: faults.
    """

    min_speed: float | None = None
    max_speed: float | None = None
    thrust_factors: tuple[float, float] = (1.0, 1.0)

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


@dataclass(frozen=True)
class Ground:
    """Level ground that the vehicle can stand on.

    Attributes
    ----------
    height : float
        m, world.
    friction : float
        Coefficient of sliding friction.
    """

    height: float = 0.0
    friction: float = 0.8
