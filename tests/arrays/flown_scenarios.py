"""Scenarios that fly on arrays: controllers inside layers, references, multirotors."""

from tests.laws.layers.test_actuation import EVERYTHING
from tests.laws.layers.test_air import STORM
from tests.laws.test_laws import LAWS
from tests.laws.test_multirotor import ASIDE, CLIMB, HELD, PRIORITIZED, TILTS, WEAK, document
from tests.simulation.test_batch import EXACT
from tiltsim.scenario.loading import merge

LATE = {"control_timestep": 0.004, "control_latency": 0.008}
SUPERVISED = {
    strategy: {
        "controller": {**EXACT, "supervisor": {"strategy": strategy, "min_margin": 1.2}},
        "gait": {"type": "trot_continuous", "amplitude": 0.9, "period": 1.0},
    }
    for strategy in ("scale", "hold", "return_to_red")
}
HINGED = {"vehicle": {"rotor_inertia": 1e-5}}
HEAVY = {"rotor_time_constant": 0.02, "rotor_inertia": 1e-5}
MEASURED = {"angular_acceleration": "measured"}
MODEL = {"angular_acceleration": "model"}
LAYERED = {
    "yaw_position in air": {**LAWS["yaw_position"], "air": STORM},
    "full_pose in air": {**LAWS["full_pose"], "air": STORM},
    "full_pose without rotor 2": merge(
        LAWS["full_pose"], {"controller": {"failed_rotor": 2}, "vehicle": HEAVY}
    ),
} | {
    f"{kind} {name}": merge(LAWS[name], tables)
    for name in ("attitude_altitude", "gait_feedforward")
    for kind, tables in {
        "everything": {**EVERYTHING, "air": STORM},
        "heavy": {"vehicle": HEAVY},
        "measured": {"vehicle": HEAVY, "controller": MEASURED},
    }.items()
}
"""Controllers inside layers."""

REFERENCES = {
    "line": {"velocity": [0.5, 0.0, 0.1]},
    "circle": {"radius": 1.0, "angular_frequency": 0.5},
    "attitude_altitude": {"roll": 0.1, "altitude": 0.2},
    "lissajous": {"amplitude": [1.0, 0.5, 0.1], "angular_frequency": [0.5, 0.7, 0.2]},
    "figure_eight": {"length": 1.0, "width": 0.5, "angular_frequency": 0.6},
    "waypoints": {"positions": [[0, 0, 0], [1, 0, 0], [1, 1, 0.2]], "times": [0.0, 2.0, 4.0]},
    "table": {"rows": [[0, 0, 0, 0], [1, 0.2, 0, 0], [2, 0.3, 0.1, 0], [3, 0.3, 0.2, 0.1]]},
}
"""References by type."""


MULTIROTORS = {
    "leaning": document("hexarotor"),
    "euler angles": document(
        "hexarotor", controller={"law": "attitude_force", "attitude_error": "euler_angles"}
    ),
    "tilting": document("tilt_hexarotor", gait=TILTS),
    "supervised": document("tilt_hexarotor", gait=ASIDE, controller={**HELD, **MODEL}),
    "within limits": document("hexarotor", WEAK, controller=PRIORITIZED, **CLIMB),
    "by thrust": document(
        "cant_hexarotor", controller={"law": "attitude_force", "norm": "thrust", "failed_rotor": 1}
    ),
    "heavy rotors": merge(document("tilt_hexarotor", gait=TILTS), {"vehicle": HEAVY}),
    "turning over": document(
        "omni_octorotor",
        controller={"law": "attitude_force", "norm": "thrust", "turn_time": 2.0},
        reference={"type": "setpoint", "roll": 0.5},
    ),
}
for _tables in MULTIROTORS.values():
    _tables.pop("simulation", None)
"""The controller of multirotors."""
