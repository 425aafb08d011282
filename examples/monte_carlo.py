"""Fly 256 vehicles whose mass, thrust and initial attitude differ from the controller's model."""

import numpy as np

import tiltsim

flights = tiltsim.sweep(
    {
        "scenario": "fleet/tilt_hexarotor#circle",
        "set": {"simulation.duration": 6.0},
        "metrics": ["final_position_error_x", "final_position_error_z", "max_abs_roll"],
        "axis": [
            {"type": "uniform", "key": "model_error.mass", "low": 0.9, "high": 1.1},
            {"type": "uniform", "key": "model_error.thrust_coefficient", "low": 0.9, "high": 1.1},
            {
                "type": "normal",
                "key": "initial.attitude[0]",
                "mean": 0.0,
                "standard_deviation": 0.1,
            },
        ],
        "sample": {"method": "sobol", "count": 256, "seed": 1},
    }
)
print(f"{np.mean(flights['end'] == 'completed'):.0%} of {len(flights['end'])} flights completed")
for name in ("final_position_error_z", "max_abs_roll"):
    low, middle, high = np.nanquantile(flights[name], [0.05, 0.5, 0.95])
    print(f"{name}: median {middle:.4f}, 90 % between {low:.4f} and {high:.4f}")
