"""Write a scenario as a dict, fly it, and change one key at a time."""

import tiltsim

scenario = tiltsim.load_scenario(
    {
        "simulation": {"duration": 20.0, "timestep": 0.002},
        "controller": {"decoupler": "conventional"},
        "gait": {"type": "fixed", "angles": [-0.2, -0.2, 0.2, 0.2]},  # rad
        "reference": {"type": "setpoint", "position": [0.5, 0.0, 1.0]},  # m
    }
)
for decoupler in ("conventional", "modified", "exact"):
    flight = tiltsim.simulate(scenario.replace({"controller.decoupler": decoupler}))
    x, y, z = flight["reference_position"][-1] - flight["position"][-1]
    print(f"{decoupler:<13} error at the end: {x:.4f}, {y:.4f}, {z:.4f} m")
