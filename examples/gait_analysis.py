"""Which tilt angles are singular: the margin of a tiltrotor over all trots."""

import numpy as np

import tiltsim
from tiltsim_controllers.analysis.singularity import acceptable_share, singularity_margin

vehicle = tiltsim.load_scenario("ch04_tracking/setpoint#rho_065_modified").vehicle.resolve()

print("trot (rad)  margin when level (rad)  attitudes that are acceptable")
for rho in np.linspace(0.0, 1.2, 7):
    angles = np.array([-rho, -rho, rho, rho])  # rad
    margin = singularity_margin(angles, vehicle)
    share = acceptable_share(angles, vehicle)
    print(f"{rho:10.1f}  {margin:23.3f}  {share:28.0%}")
