"""Physical parameters of the tiltrotor, and the vehicles known by name."""

from typing import Any, Final, NamedTuple

from tiltsim_controllers.mathematics.scalar import Values
from tiltsim_controllers.vehicle.body import Body


class Vehicle(NamedTuple):
    """A rotorcraft with four arms (thesis symbols in brackets).

    The inertia is taken about the center of mass in body axes, everything on board included.
    """

    mass: float  # [m] kg
    inertia_xx: float  # [I_B] kg m^2
    inertia_yy: float  # kg m^2
    inertia_zz: float  # kg m^2
    arm_length: float  # [L] m, from the center of mass to the thrust axis
    thrust_coefficient: float  # [K_f] N s^2/rad^2
    drag_coefficient: float  # [K_m] N m s^2/rad^2
    gravity: float  # [g] m/s^2

    @property
    def moments(self) -> tuple[float, ...]:
        """Principal moments of inertia, kg m^2."""
        return self[1:4]

    @property
    def body(self) -> Body:
        """Mass, inertia and gravity; the principal axes are the body axes."""
        x, y, z = self.moments
        inertia = (x, 0.0, 0.0, 0.0, y, 0.0, 0.0, 0.0, z)
        inverse = (1.0 / x, 0.0, 0.0, 0.0, 1.0 / y, 0.0, 0.0, 0.0, 1.0 / z)
        return Body(self.mass, self.gravity, inertia, inverse)

    @property
    def spins(self) -> Values:
        """Signs of the rotor speeds at positive thrust."""
        return SPIN

    @property
    def thrust_coefficients(self) -> Values:
        """K_f of each rotor, N s^2/rad^2."""
        return (self.thrust_coefficient,) * len(SPIN)

    @property
    def tilts(self) -> int:
        """The number of tilt angles that a gait plans; without hinges they are idle."""
        return 4

    @property
    def hover_rotor_speed(self) -> Any:
        """The speed (rad/s) at which four untilted rotors carry the weight."""
        return (self.mass * self.gravity / (4.0 * self.thrust_coefficient)) ** 0.5


def drag_ratio(vehicle: Vehicle) -> float:
    """Drag torque over thrust torque of a rotor, ``r = K_m / (L K_f)``, dimensionless."""
    return vehicle.drag_coefficient / (vehicle.arm_length * vehicle.thrust_coefficient)


SPIN: Final = (-1.0, 1.0, -1.0, 1.0)
"""Signs of the rotor speeds: rotors 1 and 3 have varpi < 0, rotors 2 and 4 varpi > 0 (ch. 3)."""

PRESETS: Final = {
    # ch. 3, Sec. 2; also ch. 4 to 9
    "ar_drone_2": Vehicle(
        mass=0.429,
        inertia_xx=2.24e-3,
        inertia_yy=2.99e-3,
        inertia_zz=4.80e-3,
        arm_length=0.1785,
        thrust_coefficient=8.048e-6,
        drag_coefficient=2.423e-7,
        gravity=9.8,
    ),
    # ch. 2, Table A1: the same airframe with its inertia unrounded, flown as a plain quadrotor. The
    # table gives 8.048e-4 for both rotor coefficients. The inputs of ch. 2 are forces and torques
    # and do not use them, so the rotors here are taken from ch. 3.
    "ar_drone_2_unrounded": Vehicle(
        mass=0.429,
        inertia_xx=2.237568e-3,
        inertia_yy=2.985236e-3,
        inertia_zz=4.80374e-3,
        arm_length=0.1785,
        thrust_coefficient=8.048e-6,
        drag_coefficient=2.423e-7,
        gravity=9.8,
    ),
    # Luukkonen, "Modelling and control of quadcopter" (2011), Table 1; ch. 12 takes its L, K_f, K_m
    "luukkonen": Vehicle(
        mass=0.468,
        inertia_xx=4.856e-3,
        inertia_yy=4.856e-3,
        inertia_zz=8.801e-3,
        arm_length=0.225,
        thrust_coefficient=2.980e-6,
        drag_coefficient=1.140e-7,
        gravity=9.81,
    ),
}
"""Vehicles by name."""
