"""How far a trot of larger and larger tilt angles stays from singular attitudes."""

import numpy as np

import tiltsim

scenario = tiltsim.load_scenario(
    {
        "simulation": {"duration": 12.0, "timestep": 0.002, "plant": "rigid_body"},
        "controller": {
            "decoupling": "exact",
            "decoupler": "exact",
            "gait_rate_feedforward": True,
            "gains": "feedforward",
        },
        "gait": {"type": "trot_continuous", "amplitude": 0.1, "period": 4.0},
        "reference": {"type": "setpoint", "position": [0.0, 0.0, 0.0]},
    }
)
for amplitude in np.linspace(0.1, 0.7, 4):  # rad
    flight = tiltsim.simulate(scenario.replace({"gait.amplitude": amplitude}))
    print(
        f"amplitude {amplitude:.1f} rad: {flight.end.kind}, smallest margin "
        f"{flight['singularity_margin'].min():.3f} rad, largest lean "
        f"{abs(flight['attitude'][:, :2]).max():.3f} rad"
    )
