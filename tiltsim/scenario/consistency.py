"""What must hold between the tables of a scenario, which by themselves are valid."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, get_args

from tiltsim.scenario.controller import Controller
from tiltsim.scenario.controller_table import ANY_ROTORCRAFT, ControllerTable
from tiltsim.scenario.gait import FixedGait
from tiltsim.scenario.messages import InvalidValueError
from tiltsim.scenario.tiltrotor_controllers import AttitudeAltitudeController
from tiltsim.scenario.time_steps import check_time_steps
from tiltsim.scenario.vehicle import ModelErrorTable, PodTable, TiltServoTable, VehicleTable

if TYPE_CHECKING:
    from tiltsim.scenario.scenario import Scenario

MAX_TABLE: Final = 1500
"""Numbers in the table of a gait and a reference, which every evaluation of the law reads."""


def check_scenario(scenario: Scenario) -> None:
    """Refuse a scenario whose tables do not go together.

    Raises `InvalidValueError` for the first that does not, with the key and what is allowed.
    """
    _check_law(scenario)
    _check_actuators(scenario)
    _check_model_error(scenario)
    _check_gait(scenario)
    _check_reference(scenario)
    _check_rotor_limits(scenario)
    _check_ground(scenario)
    check_time_steps(scenario)


def _check_law(scenario: Scenario) -> None:
    law, model = scenario.controller.law, scenario.vehicle.model
    if not _flies(scenario.controller, model):
        raise InvalidValueError(
            "controller.law",
            law,
            f"flies the {scenario.controller.vehicle_model}, and vehicle.model = {model!r}; "
            f"choose {', '.join(_laws_of(model))}",
        )
    rotors = 2 if model == "tilt_car" else 4
    speed = scenario.initial.rotor_speed
    if isinstance(speed, tuple) and len(speed) != rotors:
        raise InvalidValueError(
            "initial.rotor_speed", speed, f"the {model} has {rotors} rotors; give one or all"
        )
    if model == "tilt_car":
        _check_plane(scenario)
    elif law == "python":
        _check_own_law(scenario)
    else:
        _check_layout(scenario)
    if model != "quadrotor":
        return
    vehicle = scenario.rotorcraft
    of_tilts = [
        ("gait.type", scenario.gait.type, "fixed"),
        ("gait", scenario.gait.model_dump(), FixedGait().model_dump()),
        ("vehicle.tilt_servo", vehicle.tilt_servo.model_dump(), TiltServoTable().model_dump()),
        ("vehicle.pod", vehicle.pod.model_dump(), PodTable().model_dump()),
    ]
    of_rotors = [
        ("vehicle.min_rotor_speed", vehicle.min_rotor_speed, None),
        ("vehicle.max_rotor_speed", vehicle.max_rotor_speed, None),
        ("initial.rotor_speed", scenario.initial.rotor_speed, type(scenario.initial)().rotor_speed),
    ]
    # Commands from outside reach rotors with a speed, limits and all.
    for key, value, default in of_tilts if law == "python" else [*of_tilts, *of_rotors]:
        if value != default:
            raise InvalidValueError(
                key,
                value,
                "the quadrotor has no use for it: its rotors do not tilt, and "
                "make the thrust that its law asks for at once",
            )


def _check_actuators(scenario: Scenario) -> None:
    if scenario.has_air and not isinstance(scenario.vehicle, VehicleTable):
        raise InvalidValueError(
            "vehicle.model", scenario.vehicle.model, "has no air around it; leave air out"
        )
    for key, value, ideal in scenario.real_actuators():
        if value != ideal and scenario.vehicle.model != "tiltrotor":
            raise InvalidValueError(
                key, value, f"the {scenario.vehicle.model} flies without; leave it out"
            )
    kinds = [(f.rotor, f.type == "stuck_servo") for f in scenario.fault]
    for fault, kind in zip(scenario.fault, kinds, strict=True):
        if kinds.count(kind) > 1:
            raise InvalidValueError(
                "fault.rotor",
                fault.rotor,
                f"has more than one {'stuck servo' if kind[1] else 'loss of thrust'}",
            )
    controller = scenario.controller
    prioritized = getattr(controller, "allocation", "inversion") == "prioritized"
    if (
        prioritized
        and scenario.rotorcraft.min_rotor_speed is None
        and scenario.rotorcraft.max_rotor_speed is None
    ):
        raise InvalidValueError(
            "controller.allocation",
            "prioritized",
            "nothing limits the rotors; give vehicle.min_rotor_speed or max_rotor_speed",
        )


def _check_layout(scenario: Scenario) -> None:
    own = scenario.rotorcraft.user_vehicle
    if own is not None and own.layout_mismatch:
        raise InvalidValueError(
            "vehicle.mjcf",
            scenario.rotorcraft.mjcf,
            f"{own.layout_mismatch}; the {scenario.controller.law} law is for four equal "
            "arms at right angles; a controller of your own flies any",
        )


def _check_own_law(scenario: Scenario) -> None:
    for key, asked, flown in (("plant", "thesis", "mujoco"), ("engine", "native", "python")):
        if getattr(scenario.simulation, key) == asked:
            raise InvalidValueError(
                f"simulation.{key}", asked, f"a controller of your own flies on {flown} alone"
            )


def _check_model_error(scenario: Scenario) -> None:
    error = scenario.model_error
    if error == ModelErrorTable():
        return
    if not isinstance(scenario.vehicle, VehicleTable):
        raise InvalidValueError(
            "vehicle.model", scenario.vehicle.model, "takes no [model_error]; use a rotorcraft"
        )
    if error.arm_length != 1.0 and scenario.rotorcraft.mjcf is not None:
        raise InvalidValueError(
            "model_error.arm_length", error.arm_length, "vehicle.mjcf has its own arms"
        )
    a, b, c = sorted(scenario.true_rotorcraft[1:4])
    if a + b < c:
        raise InvalidValueError(
            "model_error.inertia",
            list(error.inertia),
            "no body has it: two moments must exceed the third",
        )


def _check_plane(scenario: Scenario) -> None:
    """Refuse what would lift a tilt-car off its plane, or yaw it where yaw is no output."""
    initial, reference = scenario.initial, scenario.reference
    vectors: dict[str, tuple[tuple[float, ...], slice]] = {
        "initial.position": (initial.position, slice(2, 3)),
        "initial.velocity": (initial.velocity, slice(2, 3)),
        "initial.attitude": (initial.attitude, slice(0, 2)),
        "initial.angular_velocity": (initial.angular_velocity, slice(0, 2)),
    }
    for name in ("position", "velocity", "acceleration", "amplitude"):
        vector = getattr(reference, name, None)
        if vector is not None:
            vectors[f"reference.{name}"] = (vector, slice(2, 3))
    for key, (vector, upwards) in vectors.items():
        if any(vector[upwards]):
            raise InvalidValueError(
                key,
                vector,
                "the tilt_car stays on its plane: x, y and yaw alone may differ from 0",
            )
    if reference.yaw != 0.0:
        raise InvalidValueError(
            "reference.yaw", reference.yaw, "yaw is no output of the tilt_car's laws"
        )
    wanted = scenario.controller.gait_types
    if scenario.gait.type not in wanted:
        raise InvalidValueError(
            "gait.type",
            scenario.gait.type,
            f"the {scenario.controller.law} law takes none; leave the table out"
            if wanted == ("fixed",)
            else f"the {scenario.controller.law} law needs one of {', '.join(wanted)}",
        )
    if wanted == ("fixed",) and scenario.gait != FixedGait():
        raise InvalidValueError(
            "gait",
            scenario.gait.model_dump(mode="json"),
            f"the {scenario.controller.law} law moves the tilt itself; leave the table out",
        )


def _check_reference(scenario: Scenario) -> None:
    controller, reference = scenario.controller, scenario.reference
    kind = reference.kind
    # A pose of zero roll and pitch is written like a position.
    kinds = {*controller.reference_kinds}
    if "pose" in kinds:
        kinds.add("position")
    if kind not in kinds:
        if kind == "pose":
            key, value = ("roll", reference.roll) if reference.roll else ("pitch", reference.pitch)
            raise InvalidValueError(
                f"reference.{key}",
                value,
                f"roll and pitch are no outputs of the {controller.law} law",
            )
        raise InvalidValueError(
            "reference.type", reference.type, f"the {controller.law} law cannot follow it"
        )
    if reference.type == "waypoints" and scenario.vehicle.model == "tilt_car":
        raise InvalidValueError(
            "reference.type", reference.type, "the tilt_car's laws cannot follow it"
        )
    own = isinstance(controller, AttitudeAltitudeController)
    exact = isinstance(controller, AttitudeAltitudeController) and (
        controller.gait_rate_feedforward
    )
    if (not own or exact) and getattr(reference, "acceleration_feedforward", False):
        law = "attitude_altitude law with gait_rate_feedforward" if exact else controller.law
        raise InvalidValueError(
            "reference.acceleration_feedforward",
            True,
            f"the {law} follows all derivatives anyway; leave it out",
        )
    if not isinstance(controller, AttitudeAltitudeController):
        return
    decoupler = controller.decoupler
    free = kind == "attitude_altitude"
    if free and decoupler != "none":
        raise InvalidValueError(
            "controller.decoupler", decoupler, "reference.type = 'attitude_altitude' takes none"
        )
    if not free and decoupler == "none":
        raise InvalidValueError(
            "controller.decoupler",
            decoupler,
            f"reference.type = {reference.type!r} needs conventional, modified or exact",
        )


def _check_gait(scenario: Scenario) -> None:
    key, value = scenario.gait.size
    try:
        gait = scenario.gait.plan(scenario.vehicle.resolve())
    except ValueError as error:
        raise InvalidValueError(f"gait.{key}", value, str(error)) from None
    limit = getattr(scenario.vehicle.tilt_servo, "max_angle", None)
    if limit is not None and gait.amplitude > limit:
        raise InvalidValueError(
            f"gait.{key}",
            value,
            f"tilts by {gait.amplitude:.4g} rad, beyond the servo limit "
            f"vehicle.tilt_servo.max_angle = {limit}",
        )
    rows = len(gait.knots)
    if rows > MAX_TABLE:
        raise InvalidValueError(
            f"gait.{key}", value, f"too many keyframes: {rows} numbers, at most {MAX_TABLE}"
        )
    total = len(scenario.reference.placed(gait.knots)[1])
    if total > MAX_TABLE:
        raise InvalidValueError(
            "reference.times",
            len(getattr(scenario.reference, "times", ())),
            f"too many waypoints: {total} numbers with the gait's, at most {MAX_TABLE}",
        )
    if scenario.controller.law == "full_pose" and not gait.is_constant:
        raise InvalidValueError(
            "gait.type",
            scenario.gait.type,
            "the full_pose law moves the pods itself; give the angles at the start as fixed",
        )


def _check_ground(scenario: Scenario) -> None:
    if scenario.ground is None:
        return
    if scenario.vehicle.model == "tilt_car":
        raise InvalidValueError(
            "ground", scenario.ground.model_dump(), "the tilt_car moves in a plane without one"
        )
    if scenario.simulation.plant == "thesis":
        raise InvalidValueError(
            "simulation.plant",
            "thesis",
            "its equations know no contact with ground; use mujoco",
        )
    own = scenario.rotorcraft.user_vehicle
    if own is not None and not own.has_contact_geoms:
        raise InvalidValueError(
            "ground",
            scenario.ground.model_dump(),
            "vehicle.mjcf needs a geom 'ground', and geoms whose names end in 'collision'",
        )
    if scenario.initial.position[2] < scenario.ground.height:
        raise InvalidValueError(
            "initial.position",
            scenario.initial.position,
            f"below ground.height = {scenario.ground.height}",
        )


def _check_rotor_limits(scenario: Scenario) -> None:
    if not isinstance(scenario.vehicle, VehicleTable):
        return
    low, high = scenario.vehicle.min_rotor_speed, scenario.vehicle.max_rotor_speed
    for speed in scenario.initial.rotor_speeds(4):
        if (low is not None and speed < low) or (high is not None and speed > high):
            raise InvalidValueError(
                "initial.rotor_speed",
                speed,
                f"must lie within the rotor limits, {low or 0} to {high or 'any'} rad/s",
            )


def _laws_of(model: str) -> list[str]:
    union = get_args(get_args(Controller)[0])
    tables = [get_args(option)[0] for option in union]
    return [get_args(t.model_fields["law"].annotation)[0] for t in tables if _flies(t, model)]


def _flies(law: ControllerTable | type[ControllerTable], model: str) -> bool:
    either = law.vehicle_model == ANY_ROTORCRAFT and model in {"tiltrotor", "quadrotor"}
    return either or law.vehicle_model == model
