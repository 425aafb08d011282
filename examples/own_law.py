"""A law of NumPy arrays, compiled, that hovers any vehicle whose rotors push upward."""

import tiltsim
from tiltsim import xp  # NumPy, also for numbers that are compiled


@tiltsim.law
def hover(observed):
    """Lean against the position error; PD control of the attitude, as for a plain quadrotor."""
    body, error = observed.vehicle, observed.reference.position - observed.position  # m
    demand = xp.array([1.0, 1.0, 4.0]) * error - xp.array([1.4, 1.4, 4.0]) * observed.velocity
    lift = body.mass * (body.gravity + demand[2])  # N
    attitude = xp.array([-demand[1], demand[0], 0.0]) / body.gravity  # rad
    stiffness, damping = xp.array([100.0, 100.0, 25.0]), xp.array([20.0, 20.0, 10.0])
    angular = stiffness * (attitude - observed.attitude) - damping * observed.body_rates
    torque = observed.inertia @ angular  # N m
    # Rows of force and torque per newton of thrust are orthogonal for rotors around a center.
    rows = xp.vstack([observed.force[2], observed.torque])  # (4, N)
    thrusts = rows.T @ (xp.hstack([lift, torque]) / (rows * rows).sum(axis=1))  # (N,), N
    return tiltsim.Command(thrusts=thrusts)


changes = {
    "reference": {"type": "setpoint", "position": [0.3, 0.2, 0.5]},
    "simulation.duration": 10.0,
}
for address in ("ch04_tracking/setpoint#rho_0_modified", "fleet/hexarotor#hover"):
    flight = tiltsim.simulate(tiltsim.load_scenario(address, changes, controller=hover))
    distance = ((flight["position"] - flight["reference_position"])[-1] ** 2).sum() ** 0.5
    print(f"{address}: {flight.engine} engine, {1e3 * distance:.2f} mm from the set point")
