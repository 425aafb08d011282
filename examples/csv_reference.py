"""Follow a path from a CSV file with the columns time, x, y, z."""

import numpy as np

import tiltsim

time = np.arange(0.0, 20.01, 0.1)  # s
path = np.column_stack([time, np.sin(0.5 * time), np.sin(time), 0.1 * np.cos(0.5 * time)])  # m
np.savetxt("path.csv", path, delimiter=",", header="time,x,y,z", comments="")

scenario = tiltsim.load_scenario(
    "fleet/cant_hexarotor#hover",
    {
        "simulation.duration": 20.0,
        "initial": {"position": path[0, 1:], "velocity": [0.5, 1.0, 0.0]},
        "reference.interpolation": "cubic",
    },
    reference="path.csv",
)
flight = tiltsim.simulate(scenario)
error = np.linalg.norm(flight["position"] - flight["reference_position"], axis=1)
print(f"largest distance from the path: {1e3 * error.max():.3f} mm")
flight.plot().savefig("csv_reference.png")
