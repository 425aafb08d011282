"""From a log to a model to a controller that flies better with it.

A quadrotor is 12 % heavier than its controller assumes, and turns more slowly. Its mass and inertia
are found in a log of 6 s with the noise of a camera system; the controller then knows them.
"""

import numpy as np

import tiltsim

NOISE = dict.fromkeys(["x", "y", "z", "roll", "pitch", "yaw"], 0.002)
NOISE |= dict.fromkeys(["vx", "vy", "vz", "p", "q", "r"], 0.01)

assumed = tiltsim.load_scenario("arena/quadrotor#figure_eight").replace(
    {
        "controller": {"law": "geometric"},
        "simulation.duration": 6.0,
        "simulation.record_timestep": 0.004,
        "initial.attitude": [0.2, -0.2, 0.6],
    }
)
vehicle = assumed.vehicle.resolve()
MOMENTS = np.array([vehicle.inertia_xx, vehicle.inertia_yy, vehicle.inertia_zz])
TRUE = {"mass": 1.12 * vehicle.mass, "inertia": MOMENTS * [1.25, 1.2, 1.2]}


def fly(mass: float, inertia: np.ndarray) -> tiltsim.Flight:
    """The real vehicle under a controller that assumes this mass (kg) and inertia (kg m^2)."""
    known = {"vehicle.mass": mass, "vehicle.inertia": [*inertia]}
    error = {"mass": TRUE["mass"] / mass, "inertia": [*(TRUE["inertia"] / inertia)]}
    return tiltsim.simulate(assumed.replace({**known, "model_error": error}))


def logged(flight: tiltsim.Flight) -> tiltsim.Log:
    """The flight as its sensors tell it."""
    rng, columns = np.random.default_rng(0), dict(flight.columns)
    for name, size in NOISE.items():
        columns[name] = columns[name] + size * rng.standard_normal(len(flight))
    return tiltsim.Log("the first flight", columns, flight.units)


before = fly(vehicle.mass, MOMENTS)
found = tiltsim.identify(logged(before), assumed, ["vehicle.mass", "vehicle.inertia"])
for name, value in found.values.items():
    print(f"{name}: {value:.5g} ± {found.sigma[name]:.1g} {found.units[name]}")
print(f"chi2: {found.chi2:.2f}")
after = fly(found.values["vehicle.mass"], np.array(found.overrides()["vehicle.inertia"]))
for label, flight in (("assumed", before), ("identified", after)):
    print(f"{label}: rms position error {flight.metrics()['rms_position_error']:.4f} m")
