"""Poles, and gain, phase and delay margins, of a closed loop at rest."""

import tiltsim

scenario = tiltsim.load_scenario("ch04_tracking/setpoint#rho_065_modified")

found = tiltsim.stability(scenario)
print(f"stable: {found.stable}")
for mode in found.modes[:4]:  # the slowest
    print(f"  {mode.name}: {mode.frequency:.3f} rad/s, damping {mode.damping:.2f}")

for margin in tiltsim.margins(scenario)[:6]:
    low, high = margin.gain
    print(
        f"  {margin.place}: gain from {low:.2f} to {high:.2f}, phase {margin.phase:.2f} rad, "
        f"delay {1e3 * margin.delay:.1f} ms"
    )
