"""Files to start from: a commented MJCF vehicle of each kind, and a scenario that flies it."""

import json
from collections.abc import Iterator
from math import cos, pi, sin
from typing import Final, NamedTuple

import numpy as np

from tiltsim_controllers.mathematics.scalar import Floats

THRUST: Final = 8.5e-6  # thrust coefficient, N s^2/rad^2
DRAG: Final = 1.4e-7  # drag torque coefficient, N m s^2/rad^2
MAX_SPEED: Final = 850.0  # highest speed of the rotors, rad/s


class Starter(NamedTuple):
    """A kind of vehicle."""

    title: str  # such as "Planar hexarotor"
    places: Floats  # (N, 3), m, the rotors in body axes: x forward, y left, z up
    axes: Floats  # (N, 3), unit vectors of their thrusts, at zero tilt angles
    angles: tuple[float, ...] = ()  # (N,), rad, that the scenario holds; empty without tilts
    reverses: bool = False  # whether the rotors also turn backwards
    controller: str = ""  # the table of the scenario, as text

    def spin(self, rotor: int) -> int:
        """Sense of rotation of a rotor, from 0: 1 is counter-clockwise about its thrust."""
        return 1 if self.reverses or rotor % 2 == 0 else -1


def _ring(
    title: str,
    rotors: int,
    radius: float,
    *,
    cant: float = 0.0,
    angles: tuple[float, ...] = (),
    controller: str = "",
) -> Starter:
    """Rotors around the hull, radius in m, turned to either side by ``cant`` (rad)."""
    heading = (2.0 * np.arange(rotors) + 1.0) * pi / rotors
    places = radius * np.stack([np.cos(heading), np.sin(heading), 0.0 * heading], axis=1)
    lean = sin(cant) * (-1.0) ** np.arange(rotors)
    axes = np.stack([lean * np.sin(heading), -lean * np.cos(heading), 0.0 * heading + cos(cant)], 1)
    return Starter(title, places, axes, angles, controller=controller or _ATTITUDE_FORCE + _LIMITED)


def _cube(title: str, radius: float) -> Starter:
    """Rotors on the corners of a cube, at a radius (m) (Brescianini and D'Andrea, 2016, eq. 16)."""
    a, b, c = 0.5 + 12**-0.5, 0.5 - 12**-0.5, 3**-0.5
    corners = [(x, y, z) for z in (1, -1) for y in (1, -1) for x in (1, -1)]
    upper = [(-a, b, c), (b, a, -c), (-b, -a, -c), (a, -b, c)]
    axes = np.array([*upper, *reversed(upper)])
    places = radius * c * np.array(corners)
    return Starter(title, places, axes, reverses=True, controller=_ATTITUDE_FORCE + _NORM)


def _pair(title: str, width: float, height: float) -> Starter:
    """Two rotors on arms of a width, at a height (m), that tilt about the lateral axis."""
    places, axes = np.array([[0.0, width, height], [0.0, -width, height]]), np.eye(3)[[2, 2]]
    return Starter(title, places, axes, (0.0, 0.0), controller=_GEOMETRIC)


_ATTITUDE_FORCE: Final = """\
law = "attitude_force"               # controls the attitude and all forces that need no torque
"""

_LIMITED: Final = """\
allocation = "prioritized"           # within rotor limits first the attitude, then the lift
"""

_NORM: Final = """\
norm = "thrust"                      # least changes of the thrusts: rotors may reverse
"""

_GEOMETRIC: Final = """\
law = "geometric"                    # two rotors and two tilts control attitude and lift
tilts = "free"
attitude_bandwidth = 8.0             # rad/s
"""

_FULL_POSE: Final = """\
law = "full_pose"                    # three rotors and three tilts control position and attitude
gains = { position = [6.0, 12.0, 8.0], attitude = [18.0, 108.0, 216.0] }
"""

STARTERS: Final[dict[str, Starter]] = {
    "bicopter": _pair("Bicopter", 0.25, 0.12),
    "tricopter": _ring("Tricopter", 3, 0.25, angles=(0.0,) * 3, controller=_FULL_POSE),
    "quadrotor": _ring("Quadrotor", 4, 0.18),
    "hexarotor": _ring("Hexarotor", 6, 0.22),
    "octorotor": _ring("Octorotor", 8, 0.26),
    "canted_hexarotor": _ring("Hexarotor with canted rotors", 6, 0.22, cant=0.44),
    "tiltrotor": _ring("Tiltrotor with four tilting arms", 4, 0.18, angles=(0.3, -0.3, -0.3, 0.3)),
    "tilt_hexarotor": _ring("Hexarotor with six tilting arms", 6, 0.22, angles=(0.35, -0.35) * 3),
    "omni_octorotor": _cube("Omnidirectional octorotor", 0.2),
}
"""The vehicles of ``tiltsim new``, by kind."""


def starter_mjcf(kind: str) -> str:
    """The MJCF file of a kind in `STARTERS`."""
    starter = STARTERS[kind]
    indices = range(len(starter.places))
    tilting = indices if starter.angles else ()
    body = [line for rotor in indices for line in _rotor(starter, rotor)]
    actuators = [f'<position name="tilt_{i + 1}" joint="tilt_{i + 1}"/>' for i in tilting]
    for i in indices:
        sense = "counterclockwise" if starter.spin(i) > 0 else "clockwise"
        actuators.append(f'<general name="thrust_{i + 1}" class="{sense}" site="rotor_{i + 1}"/>')
    for i in indices:
        low = -MAX_SPEED if starter.reverses or starter.spin(i) < 0 else 0.0
        high = MAX_SPEED if starter.spin(i) > 0 else 0.0
        actuators.append(
            f'<general name="rotor_speed_{i + 1}" class="speed" joint="vehicle" '
            f'actrange="{low:g} {high:g}"/>'
        )
    hinge = _HINGE if starter.angles else ""
    return _MJCF.format(
        kind=kind,
        title=starter.title,
        hinge=hinge,
        thrust=THRUST,
        drag=DRAG,
        body="\n".join(f"      {line}" for line in body),
        actuators="\n".join(f"    {line}" for line in actuators),
    )


def _rotor(starter: Starter, rotor: int) -> Iterator[str]:
    """An arm with its motor and the site of its thrust, on a hinge if the rotors tilt."""
    number, place, axis = rotor + 1, _row(starter.places[rotor]), _row(starter.axes[rotor])
    hinge = _row(starter.places[rotor] * [1.0, 1.0, 0.0])
    yield f'<geom class="arm" fromto="0 0 0 {place}"/>'
    if not starter.angles:
        yield f'<geom class="motor" pos="{place}" zaxis="{axis}"/>'
        yield f'<site name="rotor_{number}" pos="{place}" zaxis="{axis}"/>'
        return
    yield f'<body name="pod_{number}" pos="{place}">'
    yield f'  <joint name="tilt_{number}" class="hinge" axis="{hinge}"/>'
    yield '  <geom class="motor"/>'
    yield f'  <site name="rotor_{number}"/>'
    yield "</body>"


def _row(vector: Floats) -> str:
    return " ".join(f"{entry + 0.0:.6g}" for entry in np.round(vector, 6))


_HINGE: Final = """\
    <default class="hinge">
      <!-- The armature is the servo's inertia; vehicle.tilt_servo in the scenario, its gains. -->
      <joint type="hinge" armature="2e-5"/>
    </default>
"""

_MJCF: Final = """\
<mujoco model="{kind}">
  <!-- {title}.
       Body axes: x forward, y left, z up, from the center of mass. SI units, rad. tiltsim finds
       its parts by name: the body vehicle with its free joint, and for each rotor i = 1, 2, ...
       the site rotor_i, whose z axis is the direction of the thrust, the actuators
       thrust_i and rotor_speed_i, and if it tilts the hinge tilt_i with its servo. -->
  <compiler angle="radian"/>
  <option gravity="0 0 -9.81"/>
  <default>
    <default class="arm">
      <geom type="capsule" size="0.007" mass="0.04" rgba="0.3 0.32 0.35 1"/>
    </default>
    <default class="motor">
      <geom type="cylinder" size="0.016 0.014" mass="0.05" rgba="0.3 0.32 0.35 1"/>
    </default>
{hinge}\
    <!-- Thrust and drag torque are gear times control, which is the signed square of the rotor
         speed: {thrust:g} N and {drag:g} N m per (rad/s)^2. The drag torque opposes the spin. -->
    <default class="counterclockwise">
      <general gear="0 0 {thrust:g} 0 0 -{drag:g}"/>
    </default>
    <default class="clockwise">
      <general gear="0 0 {thrust:g} 0 0 {drag:g}"/>
    </default>
    <!-- The rotor speeds, rad/s, are states of the simulation. -->
    <default class="speed">
      <general dyntype="integrator" gainprm="0"/>
    </default>
  </default>
  <worldbody>
    <body name="vehicle">
      <freejoint name="vehicle"/>
      <!-- Masses in kg; MuJoCo computes the inertia from the geoms. -->
      <geom name="hull" type="ellipsoid" size="0.08 0.06 0.03" mass="0.7" rgba="0.6 0.63 0.67 1"/>
      <geom name="nose" type="sphere" size="0.02" pos="0.07 0 0" mass="0" rgba="0.8 0.1 0.1 1"/>
{body}
    </body>
  </worldbody>
  <actuator>
{actuators}
  </actuator>
</mujoco>
"""


def starter_scenario(kind: str, mjcf: str) -> str:
    """The scenario that flies a kind in `STARTERS`, whose file lies in its folder, to a point."""
    starter = STARTERS[kind]
    return _SCENARIO.format(
        title=starter.title,
        mjcf=json.dumps(mjcf, ensure_ascii=False),
        speed=MAX_SPEED,
        controller=starter.controller,
        least="" if starter.reverses else _LEAST,
        expectations="".join(_EXPECTATION.format(axis=axis) for axis in "xyz"),
        gait=_GAIT.format(angles=list(starter.angles)) if starter.angles else "",
    )


_LEAST: Final = """\
min_rotor_speed = 100.0              # a rotor that stops would leave the vehicle without control
"""

_GAIT: Final = """
[gait]
type = "fixed"                       # tilt angles, rad; or "waypoints", "table"
angles = {angles}
"""

_EXPECTATION: Final = """
[[expect]]                           # checked after the flight
metric = "final_position_error_{axis}"
min = -0.001                         # m
max = 0.001
"""

_SCENARIO: Final = """\
# "tiltsim schema" explains every key, "tiltsim schema reference" the keys of a table.
title = "{title} moves to a point and stays there"

[vehicle]
model = "multirotor"
mjcf = {mjcf}  # in the folder of this file
max_rotor_speed = {speed}              # rad/s
{least}\

[simulation]
duration = 20.0                      # s
timestep = 0.004                     # s

[controller]
{controller}\
{gait}
[reference]
type = "setpoint"                    # or "circle", "figure_eight", "waypoints", "table"
position = [0.3, -0.2, 0.2]          # m
{expectations}"""
