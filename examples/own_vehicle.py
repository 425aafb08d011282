"""A coaxial hexarotor: write its MJCF, fly it, and draw the flight."""

from math import cos, pi, sin
from pathlib import Path

import tiltsim

sites, thrusts, speeds = [], [], []
for rotor in range(6):  # two on each of three arms of 0.25 m, the lower one turning the other way
    heading, height = rotor // 2 * 2 * pi / 3, 0.03 * (-1) ** rotor
    place = f"{0.25 * cos(heading):.4f} {0.25 * sin(heading):.4f} {height}"
    drag = -1.4e-7 * (-1) ** rotor  # N m per (rad/s)^2; negative: turns counter-clockwise
    sites.append(f'<site name="rotor_{rotor + 1}" pos="{place}"/>')
    gear = f"0 0 8.5e-6 0 0 {drag}"
    thrusts.append(f'<general name="thrust_{rotor + 1}" site="rotor_{rotor + 1}" gear="{gear}"/>')
    speeds.append(f'<general name="rotor_speed_{rotor + 1}" joint="vehicle" class="speed"/>')

Path("coaxial.xml").write_text(
    f"""<mujoco model="coaxial">
  <default>
    <default class="speed"><general dyntype="integrator" gainprm="0"/></default>
  </default>
  <worldbody>
    <body name="vehicle">
      <freejoint name="vehicle"/>
      <geom type="cylinder" size="0.08 0.03" mass="1.4"/>
      {"".join(sites)}
    </body>
  </worldbody>
  <actuator>{"".join(thrusts)}{"".join(speeds)}</actuator>
</mujoco>
"""
)
flight = tiltsim.simulate(
    {
        "vehicle": {"model": "multirotor", "mjcf": "coaxial.xml", "max_rotor_speed": 900.0},
        "simulation": {"duration": 16.0, "timestep": 0.004},
        "controller": {"law": "attitude_force"},
        "reference": {"type": "setpoint", "position": [0.3, -0.2, 0.2]},
    }
)
print(flight.end.kind, flight["position"][-1].round(3), "m")
flight.plot().savefig("own_vehicle.png")
