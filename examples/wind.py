"""A gust from the side: a planar hexarotor leans into it, a canted one stays level."""

import tiltsim

for vehicle in ("hexarotor", "cant_hexarotor"):
    scenario = tiltsim.load_scenario(
        f"fleet/{vehicle}#hover",
        {
            "simulation.duration": 10.0,
            "reference.position": [0.0, 0.0, 0.0],
            "air.drag.linear": [0.2, 0.2, 0.1],  # N s/m
            "air.gust": {"velocity": [0.0, 4.0, 0.0], "start": 2.0, "rise": 0.5, "duration": 3.0},
        },
    )
    flight = tiltsim.simulate(scenario)
    drift, lean = abs(flight["y"]).max(), abs(flight["attitude"][:, 0]).max()
    print(f"{vehicle}: {flight.end.kind}, blown {drift:.3f} m aside, leans by {lean:.4f} rad")
