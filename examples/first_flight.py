"""A tiltrotor flies a figure eight while its rotors swing; print the error and draw the flight."""

import tiltsim

flight = tiltsim.simulate("beyond/references#figure_eight")

error = flight.metrics()["sup_position_error_after_20s"]
print(f"{flight.end.kind} after {flight.end.time:g} s, at most {1e3 * error:.1f} mm from the path")
flight.plot().savefig("first_flight.png")
