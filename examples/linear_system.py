"""The linear system of a vehicle in hover, and a regulator for it from SciPy's Riccati equation."""

import numpy as np
from scipy.linalg import solve_continuous_are

import tiltsim

system = tiltsim.linearize("fleet/cant_hexarotor#hover", loop="open")
print("states:", *[signal.text for signal in system.states])
print("inputs:", *[signal.text for signal in system.inputs])

weights = np.eye(len(system.A))
riccati = solve_continuous_are(system.A, system.B, weights, 1e-3 * np.eye(system.B.shape[1]))
gain = 1e3 * system.B.T @ riccati
poles = np.linalg.eigvals(system.A - system.B @ gain)
print(f"poles with the regulator: real parts from {poles.real.min():.2f} to {poles.real.max():.2f}")
