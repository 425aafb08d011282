"""The same vehicle and circle under four control laws, in one figure."""

import tiltsim

base = tiltsim.load_scenario("fleet/hexarotor#circle", {"simulation.duration": 12.0})
laws = {
    "feedback linearization": base,
    **{law: base.replace({"controller": {"law": law}}) for law in ("geometric", "pid", "indi")},
}
results = list(tiltsim.fly(laws.values(), keep_samples=True))
for name, result in zip(laws, results, strict=True):
    flight = result.flight
    error = abs(flight["position"] - flight["reference_position"])[flight["time"] > 6.0]
    print(f"{name}: {flight.end.kind}, at most {1e3 * error.max():.1f} mm off after 6 s")
figure = tiltsim.plot(
    [result.flight for result in results], labels=list(laws), panels=["position_error", "path"]
)
figure.savefig("controllers.png")
