"""The learning tasks by name: arguments of `tiltsim.env.TiltrotorEnv`, registered with Gymnasium.

The controller of their scenarios is the built-in one that policies are compared with.
"""

from importlib.util import find_spec
from math import pi
from typing import Any, Final

from tiltsim.env.environment import HOVER

EPISODE_STEPS: Final = 500  # control steps of an episode: 10 s at 50 Hz

SIMULATION: Final = {
    "duration": 10.0,
    "timestep": 0.004,
    "control_timestep": 0.02,
    "integrator": "implicitfast",
}

CONTROLLER: Final = {
    "law": "attitude_altitude",
    "decoupling": "exact",
    "decoupler": "exact",
    "gait_rate_feedforward": True,
    "max_angular_acceleration": 40.0,
    "gains": {
        "attitude": {"bandwidth": 10.0},
        "yaw": {"bandwidth": 5.0},
        "altitude": {"bandwidth": 5.0, "integral": 0.5},
        "position": {"bandwidth": 2.0, "damping": 0.8, "integral": 0.5},
    },
}
"""Feedback linearization with integral action, slow enough for thrusts that are held for 20 ms."""

OBSERVATIONS: Final = {
    "position_error_body": 3.0,  # m
    "velocity_error_body": 5.0,  # m/s
    "up_body": 1.0,
    "body_rates": 10.0,  # rad/s
}
"""Observations and their bounds. Along the body's axes one policy serves every heading."""


def _uniform(key: str, *bounds: float) -> list[dict[str, Any]]:
    """An axis for each entry of a vector, drawn from -bound to bound."""
    return [
        {"key": f"{key}[{entry}]", "type": "uniform", "low": -bound, "high": bound}
        for entry, bound in enumerate(bounds)
    ]


def _task(
    title: str,
    domain: list[dict[str, Any]],
    max_position_error: float,
    observations: dict[str, float] = OBSERVATIONS,
    **tables: Any,
) -> dict[str, Any]:
    """A task in which the vehicle starts in hover at the origin, unless ``tables`` differ."""
    scenario = {"simulation": SIMULATION, "initial": HOVER["initial"], "controller": CONTROLLER}
    return {
        "scenario": {"title": title, **scenario, **tables},
        "domain": domain,
        "observations": observations,
        "max_position_error": max_position_error,
        "max_tilt_angle": 0.5,
    }


TASKS: Final[dict[str, dict[str, Any]]] = {
    "Hover": _task(
        "Recover hover at the origin from a random state",
        [
            *_uniform("initial.position", 1.0, 1.0, 1.0),
            *_uniform("initial.velocity", 1.0, 1.0, 1.0),
            *_uniform("initial.attitude", 0.5, 0.5, pi),
            *_uniform("initial.angular_velocity", 1.0, 1.0, 1.0),
        ],
        max_position_error=4.0,
    ),
    "SetPoint": _task(
        "Fly to a random set point in an unknown wind",
        [*_uniform("reference.position", 1.5, 1.5, 1.5), *_uniform("air.wind", 5.0, 5.0, 1.0)],
        max_position_error=6.0,
        air={"drag": {"linear": [0.1, 0.1, 0.1]}},
    ),
    "Circle": _task(
        "Track a circle, either way around, from hover near its beginning",
        [
            *_uniform("initial.position", 0.5, 0.5, 0.5),
            {"key": "reference.angular_frequency", "type": "list", "values": [-1.0, 1.0]},
        ],
        max_position_error=2.5,
        observations={**OBSERVATIONS, "reference_acceleration_body": 3.0},
        reference={
            "type": "circle",
            "position": [-1.5, 0.0, 0.0],
            "radius": 1.5,
            "angular_frequency": 1.0,
        },
    ),
    "Push": {
        "scenario": "interaction/push#held",
        "domain": [
            *_uniform("initial.position", 0.1),
            {"key": "initial.position[1]", "type": "uniform", "low": 0.3, "high": 0.45},
            {"key": "initial.position[2]", "type": "uniform", "low": -0.1, "high": 0.1},
            {"key": "reference.force", "type": "uniform", "low": 2.0, "high": 8.0},
        ],
        "observations": {**OBSERVATIONS, "contact_force_body": 20.0, "force_error_body": 20.0},
        "max_position_error": 2.0,
        "max_tilt_angle": 1.0,
    },
    "Carry": {
        "scenario": "interaction/carry#held",
        "domain": [
            *_uniform("reference.position", 1.0, 1.0, 1.0),
            {"key": "payload.swing", "type": "uniform", "low": -0.3, "high": 0.3},
        ],
        "observations": {**OBSERVATIONS, "swing_body": 1.0},
        "max_position_error": 4.0,
        "max_tilt_angle": 1.0,
    },
}

IN_MUJOCO: Final = frozenset({"Push", "Carry"})
"""Tasks with objects or loads, which the equations of `tiltsim.env.VectorEnv` do not have."""

ID: Final = "tiltsim/Tiltrotor-v0"
"""Name of `tiltsim.env.TiltrotorEnv` with its defaults; the tasks are ``tiltsim/NAME-v0``."""

ENTRY_POINT: Final = "tiltsim.env.gymnasium:GymnasiumEnv"
VECTOR_ENTRY_POINT: Final = "tiltsim.env.vector:task_of_registry"


def register() -> None:
    """Register the tasks with ``gymnasium.make``, where Gymnasium is installed."""
    if find_spec("gymnasium") is None:
        return
    import gymnasium

    if ID in gymnasium.registry:
        return
    gymnasium.register(ID, entry_point=ENTRY_POINT)
    with_jax = find_spec("jax") is not None
    for name, arguments in TASKS.items():
        gymnasium.register(
            f"tiltsim/{name}-v0",
            entry_point=ENTRY_POINT,
            vector_entry_point=VECTOR_ENTRY_POINT if with_jax and name not in IN_MUJOCO else None,
            kwargs={**arguments, "flat": True},
            max_episode_steps=EPISODE_STEPS,
        )
