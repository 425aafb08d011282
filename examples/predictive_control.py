"""Fly a step by nonlinear model predictive control, beside the law that needs no solver."""

from pathlib import Path
from runpy import run_path
from time import process_time

import numpy as np

import tiltsim

plan = run_path(str(Path(__file__).with_name("optimal_control.py")))
SAMPLE = 0.02  # s
WORLD = {
    **plan["WORLD"],
    "simulation.duration": 3.0,
    "simulation.control_timestep": SAMPLE,
    "simulation.control_latency": 0.0,
}
MODEL = {"simulation.plant": "rigid_body", "controller": {"law": "geometric"}}


class Predictive:
    """Plans at each sample from the measured state, and commands the speeds of the first step."""

    def __init__(self):
        model = tiltsim.symbolic(tiltsim.load_scenario("fleet/hexarotor#hover", {**WORLD, **MODEL}))
        self.plan, self.rest, self.time = plan["planner"](model), np.array(model.initial), 0.0
        self.rotors = [i for i, name in enumerate(model.states) if name.startswith("rotor_speed")]
        self.states = np.tile(self.rest[:, np.newaxis], plan["INTERVALS"] + 1)
        self.change = np.zeros((len(self.rotors), plan["INTERVALS"]))

    def __call__(self, seen):
        """The command at a sample."""
        begun, spins = process_time(), np.sign(self.rest[self.rotors])
        motion = seen.position, seen.quaternion, seen.velocity, seen.body_rates
        state = np.concatenate((*motion, spins * seen.rotor_speeds))
        found = self.plan(state, self.states, self.change)
        self.states, self.change = (np.array(part) for part in found)
        self.time += process_time() - begun
        now, then = (spins * self.states[self.rotors, column] for column in (0, 1))
        return tiltsim.Command(rotor_speeds=now + SAMPLE / plan["STEP"] * (then - now))


def show(name, flight, seconds):
    """Print the root mean square of the position error, and the time of a sample."""
    error = flight.metrics()["rms_position_error"]
    print(f"{name}: rms position error {error:.3f} m, {1e3 * seconds:.2g} ms a sample")


if __name__ == "__main__":
    flown = tiltsim.load_scenario("fleet/hexarotor#hover", WORLD)
    predictive = Predictive()
    flight = tiltsim.simulate(flown, controller=predictive)
    show("predictive", flight, predictive.time * SAMPLE / 3.0)
    law = tiltsim.load_scenario(flown, {"controller": {"law": "vectoring"}})
    tiltsim.simulate(law)  # compiles
    began = process_time()
    flight = tiltsim.simulate(law)
    show("vectoring", flight, (process_time() - began) * SAMPLE / 3.0)
