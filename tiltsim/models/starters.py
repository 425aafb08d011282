"""Files to start from: a commented MJCF vehicle of each kind, and a scenario that flies it."""

import json
from math import cos, pi, sin
from typing import Any, Final, NamedTuple

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
    rotors = [
        {
            "place": _row(place),
            "axis": _row(axis),
            "hinge": _row(place * [1.0, 1.0, 0.0]),
            "sense": "counterclockwise" if spin > 0 else "clockwise",
            "low": f"{-MAX_SPEED if starter.reverses or spin < 0 else 0.0:g}",
            "high": f"{MAX_SPEED if spin > 0 else 0.0:g}",
        }
        for i, (place, axis) in enumerate(zip(starter.places, starter.axes, strict=True))
        for spin in [starter.spin(i)]
    ]
    return _filled(_MJCF, kind=kind, starter=starter, rotors=rotors, thrust=THRUST, drag=DRAG)


def _row(vector: Floats) -> str:
    return " ".join(f"{entry + 0.0:.6g}" for entry in np.round(vector, 6))


def _filled(template: str, **values: Any) -> str:
    from jinja2 import Environment

    options = {"trim_blocks": True, "lstrip_blocks": True, "keep_trailing_newline": True}
    return Environment(**options).from_string(template).render(values)  # type: ignore[arg-type]


_MJCF: Final = """\
<mujoco model="{{ kind }}">
  <!-- {{ starter.title }}.
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
    {% if starter.angles %}
    <default class="hinge">
      <!-- The armature is the servo's inertia; vehicle.tilt_servo in the scenario, its gains. -->
      <joint type="hinge" armature="2e-5"/>
    </default>
    {% endif %}
    <!-- Thrust and drag torque are gear times control, which is the signed square of the rotor
         speed: {{ thrust }} N and {{ drag }} N m per (rad/s)^2. The drag torque opposes \
the spin. -->
    <default class="counterclockwise">
      <general gear="0 0 {{ thrust }} 0 0 -{{ drag }}"/>
    </default>
    <default class="clockwise">
      <general gear="0 0 {{ thrust }} 0 0 {{ drag }}"/>
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
      {% for rotor in rotors %}
      <geom class="arm" fromto="0 0 0 {{ rotor.place }}"/>
      {% if starter.angles %}
      <body name="pod_{{ loop.index }}" pos="{{ rotor.place }}">
        <joint name="tilt_{{ loop.index }}" class="hinge" axis="{{ rotor.hinge }}"/>
        <geom class="motor"/>
        <site name="rotor_{{ loop.index }}"/>
      </body>
      {% else %}
      <geom class="motor" pos="{{ rotor.place }}" zaxis="{{ rotor.axis }}"/>
      <site name="rotor_{{ loop.index }}" pos="{{ rotor.place }}" zaxis="{{ rotor.axis }}"/>
      {% endif %}
      {% endfor %}
    </body>
  </worldbody>
  <actuator>
    {% for _ in starter.angles %}
    <position name="tilt_{{ loop.index }}" joint="tilt_{{ loop.index }}"/>
    {% endfor %}
    {% for rotor in rotors %}
    <general name="thrust_{{ loop.index }}" class="{{ rotor.sense }}" \
site="rotor_{{ loop.index }}"/>
    {% endfor %}
    {% for rotor in rotors %}
    <general name="rotor_speed_{{ loop.index }}" class="speed" joint="vehicle" \
actrange="{{ rotor.low }} {{ rotor.high }}"/>
    {% endfor %}
  </actuator>
</mujoco>
"""


def starter_scenario(kind: str, mjcf: str) -> str:
    """The scenario that flies a kind in `STARTERS`, whose file lies in its folder, to a point."""
    file = json.dumps(mjcf, ensure_ascii=False)
    return _filled(_SCENARIO, starter=STARTERS[kind], mjcf=file, speed=MAX_SPEED)


_SCENARIO: Final = """\
# "tiltsim schema" explains every key, "tiltsim schema reference" the keys of a table.
title = "{{ starter.title }} moves to a point and stays there"

[vehicle]
model = "multirotor"
mjcf = {{ mjcf }}  # in the folder of this file
max_rotor_speed = {{ speed }}              # rad/s
{% if not starter.reverses %}
min_rotor_speed = 100.0              # a rotor that stops would leave the vehicle without control
{% endif %}

[simulation]
duration = 20.0                      # s
timestep = 0.004                     # s

[controller]
{{ starter.controller }}\
{% if starter.angles %}

[gait]
type = "fixed"                       # tilt angles, rad; or "waypoints", "table"
angles = {{ starter.angles | list }}
{% endif %}

[reference]
type = "setpoint"                    # or "circle", "figure_eight", "waypoints", "table"
position = [0.3, -0.2, 0.2]          # m
{% for axis in "xyz" %}

[[expect]]                           # checked after the flight
metric = "final_position_error_{{ axis }}"
min = -0.001                         # m
max = 0.001
{% endfor %}
"""
