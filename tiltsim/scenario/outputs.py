"""Checks that a vehicle can control the outputs of its law, with its gait and without a rotor."""

from tiltsim.models.rotor_table import Multirotor
from tiltsim.scenario.linearizing_controllers import AttitudeForceController, FullPoseController
from tiltsim.scenario.scenario_tables import ScenarioTables
from tiltsim_controllers.gaits.plans import Gait, fixed
from tiltsim_controllers.laws.full_pose import pose_rank


def check_decoupler(scenario: ScenarioTables, decoupler: str) -> None:
    """Refuse a decoupler of positions without a position to track, and the reverse."""
    needs_none = scenario.reference.kind == "attitude_altitude"
    if needs_none != (decoupler == "none"):
        needs = "none" if needs_none else "conventional, modified or exact"
        reason = f"reference.type = {scenario.reference.type!r} needs {needs}"
        raise scenario.mistake("controller.decoupler", reason)


def check_full_pose(scenario: ScenarioTables, controller: FullPoseController, gait: Gait) -> None:
    """Refuse a failed rotor that is not there, and inputs that do not move six outputs."""
    vehicle, failed = scenario.vehicle.resolve(), controller.failed_rotor
    controller.check_failed_rotor(scenario.vehicle.rotor_count)
    if isinstance(vehicle, Multirotor):
        w = [spin * (rotor != failed) for rotor, spin in enumerate(vehicle.spins, start=1)]
        rank = pose_rank(vehicle.table, gait.angles(0.0).tolist(), w)
        if rank < 6:
            reason = f"at the initial tilt angles the inputs move {rank} of six outputs"
            raise scenario.mistake("controller.law", reason)


def _check_scaling(
    controller: AttitudeForceController, vehicle: Multirotor, dimension: int
) -> None:
    """Refuse to scale a gait toward angles without the force that is controlled."""
    supervisor = controller.supervision
    if supervisor is None or supervisor.strategy != "scale":
        return
    supervisor.resolve(vehicle)  # refuses a vehicle that has no lift there with all its rotors
    untilted, where = controller.least_dimension(vehicle, fixed((0.0,) * vehicle.tilts))
    if untilted < dimension:
        or_less = f", or set controller.dimension = {untilted}" if untilted else ""
        raise supervisor.mistake(
            "strategy",
            f"the vehicle has {untilted} of the {dimension} components of force {where}; choose "
            f"hold{or_less}",
        )


def check_dimension(
    scenario: ScenarioTables, controller: AttitudeForceController, gait: Gait
) -> None:
    """Refuse more components of force than a multirotor has, and a pose that it cannot take."""
    controller.check_failed_rotor(scenario.vehicle.rotor_count)
    vehicle = scenario.vehicle.resolve()
    assert isinstance(vehicle, Multirotor)
    dimension = controller.resolve_force(vehicle, gait).dimension
    _check_scaling(controller, vehicle, dimension)
    check_decoupler(scenario, controller.decoupler)
    reference = scenario.reference
    if reference.turns:
        controller.require_defaults(
            ("attitude_error", "turn_time"), "not supported where roll, pitch and yaw vary"
        )
    if reference.kind == "pose" and dimension < 3:
        key = "type" if reference.turns else "roll" if reference.roll else "pitch"
        reason = (
            f"roll and pitch are no outputs: a vehicle that controls {dimension} of 3 components "
            "of force leans to move; leave them out, or take a vehicle with 3"
        )
        raise scenario.mistake(f"reference.{key}", reason)
    for key in ("decoupling", "decoupler"):
        value = getattr(controller, key)
        if dimension > 1 and value != "exact":
            raise scenario.mistake(
                "controller.dimension",
                f"the vehicle has {dimension}; controller.{key} = {value!r} needs 1",
            )
