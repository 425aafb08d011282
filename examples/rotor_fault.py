"""A hexarotor with tilting arms loses a rotor; the law excludes it after 20 ms or after 0.2 s."""

import tiltsim

for delay in (0.02, 0.2):  # s
    scenario = tiltsim.load_scenario(
        "fleet/lost_rotor",
        {"controller.failure_known_from": 2.0 + delay, "simulation.duration": 8.0},
    )
    flight = tiltsim.simulate(scenario)
    error = abs(flight["position"] - flight["reference_position"])[flight["time"] > 2.0]
    print(
        f"known after {delay:g} s: {flight.end.kind}, up to {error.max():.3f} m off, "
        f"{error[-1].max():.4f} m at the end; it leans by up to "
        f"{abs(flight['attitude'][:, :2]).max():.3f} rad"
    )
