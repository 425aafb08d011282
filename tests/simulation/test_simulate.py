"""Flights on both plants: published results, engines, restarts, and losses that leave a log."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import tiltsim
from tests.statics import setpoint_error
from tiltsim.laws.assembling import assemble
from tiltsim.plants.mujoco_plant import MujocoPlant
from tiltsim.simulation.simulate import make_plant
from tiltsim.system import arguments
from tiltsim.vehicles.rotorcraft import COLUMNS
from tiltsim_controllers.laws.feedback import DECOUPLERS
from tiltsim_controllers.laws.gains import GAIN_SETS
from tiltsim_controllers.vehicle.body import TILTROTOR_FIELDS
from tiltsim_controllers.vehicle.parameters import PRESETS

PLANTS = ("mujoco", "thesis")
ENGINES = ("python", "native")
GAITS = {
    "fixed": {"type": "fixed", "angles": [-0.3, 0.2, 0.4, 0.1]},
    "trot_instant": {"type": "trot_instant", "amplitude": 0.5, "period": 0.2},
    "trot_continuous": {"type": "trot_continuous", "amplitude": 0.5, "period": 0.4},
}
REFERENCES = {
    "setpoint": {"type": "setpoint", "position": [0.5, -0.3, 0.2], "yaw": 0.3},
    "line": {"type": "line", "velocity": [1.0, -0.5, 0.2]},
    "circle": {
        "type": "circle",
        "radius": 2.0,
        "angular_frequency": 0.7,
        "acceleration_feedforward": True,
    },
}

# The published matrix closes the attitude loops at 2 |varpi| ~ 720 rad/s, too fast to be sampled
# at a few milliseconds; the exact one closes them where its gains say.
EXACT = {"decoupling": "exact", "gains": "exact"}


def scenario(**tables):
    """A short flight; tables as in a scenario file."""
    tables["simulation"] = {"duration": 0.5, **tables.get("simulation", {})}
    return tiltsim.parse_scenario(tables)


def both_engines(**tables):
    simulation = tables.pop("simulation", {})
    return [
        tiltsim.simulate(scenario(simulation={**simulation, "engine": engine}, **tables))
        for engine in ENGINES
    ]


# --- published results -------------------------------------------------------------------------


@cache
def steady_errors(plant, rho, decoupler):
    flight = tiltsim.simulate(
        tiltsim.load_scenario(
            "ch04_tracking/setpoint",
            {
                "simulation.plant": plant,
                "simulation.engine": "native",
                "simulation.duration": 40.0,  # the slowest transients decay with exp(-t / 2)
                "simulation.timestep": 0.002,  # the fastest, with exp(-720 t), which RK4 damps
                "gait.angles": [-rho, -rho, rho, rho],
                "controller.decoupler": decoupler,
            },
        )
    )
    assert flight.end.kind == "completed"
    metrics = flight.metrics()
    return np.array([metrics["final_position_error_x"], metrics["final_position_error_y"]])


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize(
    ("rho", "decoupler"),
    [
        *((0.65, "conventional"), (0.65, "modified")),  # as published
        *((-0.65, "modified"), (0.325, "conventional")),
    ],
)
def test_setpoint_flights_come_to_rest_where_statics_say(plant, rho, decoupler):
    tilts = (-rho, -rho, rho, rho)
    predicted = setpoint_error(
        tilts, PRESETS["ar_drone_2"], GAIN_SETS["ch04"], DECOUPLERS[decoupler]
    )
    np.testing.assert_allclose(steady_errors(plant, rho, decoupler), predicted, atol=1e-4)


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize(
    ("decoupler", "published"), [("conventional", (3.35, -3.56)), ("modified", (-0.38, 0.17))]
)
def test_setpoint_error_is_the_published_one(plant, decoupler, published):
    # Fig. 4 prints two digits after the point.
    np.testing.assert_allclose(steady_errors(plant, 0.65, decoupler), published, atol=0.005)


@pytest.mark.parametrize(("plant", "bound"), [("mujoco", 1e-3), ("thesis", 1e-6)])
@pytest.mark.parametrize("rho", [0.65, -0.45])
def test_exact_decoupler_leaves_no_steady_error(plant, rho, bound):
    assert np.abs(steady_errors(plant, rho, "exact")).max() < bound


@pytest.mark.parametrize("plant", PLANTS)
def test_untilted_vehicle_has_no_steady_error(plant):
    assert np.abs(steady_errors(plant, 0.0, "conventional")).max() < 1e-6


# --- engines -----------------------------------------------------------------------------------


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize("gait", GAITS)
@pytest.mark.parametrize("decoupler", ["conventional", "modified", "exact"])
def test_engines_fly_the_same_flight_for_every_gait_and_decoupler(plant, gait, decoupler):
    python, native = both_engines(
        gait=GAITS[gait],
        controller={"decoupler": decoupler},
        simulation={"plant": plant, "duration": 0.21},
    )
    assert (python.engine, native.engine) == ENGINES
    np.testing.assert_array_equal(python.samples, native.samples)


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize("reference", REFERENCES)
def test_engines_fly_the_same_flight_for_every_reference(plant, reference):
    python, native = both_engines(
        reference=REFERENCES[reference],
        controller=EXACT,
        simulation={"plant": plant, "duration": 0.21},
    )
    np.testing.assert_array_equal(python.samples, native.samples)


@pytest.mark.parametrize("plant", PLANTS)
def test_engines_fly_the_same_flight_under_sample_and_hold(plant):
    python, native = both_engines(
        gait=GAITS["trot_continuous"],
        controller=EXACT,
        # 7 ms do not divide the recording interval: the held command must survive it.
        simulation={"plant": plant, "control_timestep": 0.007, "duration": 0.49},
    )
    assert python.end.kind == "completed"
    np.testing.assert_array_equal(python.samples, native.samples)


@pytest.mark.parametrize("plant", PLANTS)
def test_attitude_altitude_reference_is_flown_by_both_engines(plant):
    python, native = both_engines(
        reference={"type": "attitude_altitude", "roll": 0.1, "altitude": 0.2},
        controller={"decoupler": "none", "gains": "ch03"},
        simulation={"plant": plant},
    )
    np.testing.assert_array_equal(python.samples, native.samples)


def test_sample_and_hold_is_coarser_than_continuous_control_but_converges_to_it():
    def end_state(control_timestep):
        flight = tiltsim.simulate(
            scenario(simulation={"control_timestep": control_timestep, "engine": "native"})
        )
        return flight.samples[-1, 1:]

    exact = end_state(0.0)
    errors = [np.abs(end_state(period) - exact).max() for period in (0.002, 0.001)]
    assert 0.0 < errors[1] < errors[0]


# --- determinism and restart -------------------------------------------------------------------


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize("engine", ENGINES)
def test_two_runs_are_bit_identical(plant, engine):
    simulation = {"plant": plant, "engine": engine, "duration": 0.2}
    flown = scenario(gait=GAITS["trot_continuous"], simulation=simulation)
    first, second = tiltsim.simulate(flown), tiltsim.simulate(flown)
    np.testing.assert_array_equal(first.samples, second.samples)
    assert first.to_arrow().equals(second.to_arrow())


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("control_timestep", [0.0, 0.004])
def test_saved_state_restarts_bit_identically(plant, engine, control_timestep):
    flown = scenario(
        gait=GAITS["trot_instant"],
        controller=EXACT,
        simulation={"plant": plant, "engine": engine, "control_timestep": control_timestep},
    )
    straight = make_plant(assemble(flown))
    straight.advance(60)
    saved = straight.state
    straight.advance(60)

    restarted = make_plant(assemble(flown))
    restarted.advance(13)  # somewhere else, so that the state has to do all the work
    restarted.state = saved
    restarted.advance(60)
    assert not np.isnan(straight.state).any()  # a limit may be infinite
    assert restarted.time == straight.time
    np.testing.assert_array_equal(restarted.state, straight.state)
    assert restarted.observe() == straight.observe()


def test_plants_agree_where_they_model_the_same():
    """Without tilt, roll and pitch moves stay gyroscopically uncoupled: the plants must agree."""
    flights = [
        tiltsim.simulate(scenario(simulation={"plant": plant, "engine": "native", "duration": 5.0}))
        for plant in PLANTS
    ]
    states = [flight.samples[-1, 1 : 1 + len(TILTROTOR_FIELDS)] for flight in flights]
    np.testing.assert_allclose(states[0], states[1], rtol=1e-9, atol=1e-8)


def test_plants_differ_by_the_gyroscopic_torque_once_the_body_rolls_and_yaws():
    tables = {"initial": {"angular_velocity": [3.0, 2.0, 1.0]}}
    mujoco, thesis = (
        tiltsim.simulate(scenario(simulation={"plant": p, "duration": 0.01}, **tables))
        for p in PLANTS
    )
    names = list(COLUMNS)
    assert names.index("p") > 0
    inertia = np.array(PRESETS["ar_drone_2"][1:4])
    omega = np.array([3.0, 2.0, 1.0])
    expected = -np.cross(omega, inertia * omega) / inertia * 0.01
    measured = [mujoco[name][-1] - thesis[name][-1] for name in ("p", "q", "r")]
    # The attitude loop answers within the 10 ms, so only the leading order is compared.
    np.testing.assert_allclose(measured, expected, rtol=0.1)


# --- flights that end early --------------------------------------------------------------------


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize("engine", ENGINES)
def test_upside_down_start_diverges_with_cause_time_and_complete_log(plant, engine):
    flight = tiltsim.simulate(
        scenario(
            initial={"attitude": [np.pi, 0.0, 0.0], "rotor_speed": 300.0},
            simulation={"plant": plant, "engine": engine, "duration": 40.0},
        )
    )
    assert flight.end.kind in {"diverged", "singular"}
    assert flight.end.cause
    assert 0.0 < flight.end.time < 40.0
    assert flight["time"][-1] == pytest.approx(flight.end.time, abs=1e-12)
    assert np.isfinite(flight.samples).all()
    gaps = np.diff(flight["time"])
    assert gaps.max() < 0.01 + 1e-9, "a gap in the log"
    assert flight.metrics()["diverged"] is True


@pytest.mark.parametrize("engine", ENGINES)
def test_states_that_grow_to_infinity_raise_no_warnings_and_leave_one_log(engine):
    """Flown on to the end of the recording interval before the very step is looked for."""
    tables = tiltsim.load_scenario("ch09_input_limits/circle#omega_20").model_dump()
    simulation = {"plant": "thesis", "engine": engine, "timestep": 0.002, "duration": 8.0}
    flight = tiltsim.simulate(tiltsim.parse_scenario({**tables, "simulation": simulation}))
    assert flight.end.kind == "diverged"
    assert flight.samples[-1, 0] == flight.end.time < 8.0
    assert np.isfinite(flight.samples).all()


def test_end_time_is_found_to_one_physics_step():
    """The loss falls between two recorded samples; its time must not depend on the recording."""
    ends = []
    for record in (0.001, 0.05):
        flight = tiltsim.simulate(
            scenario(
                initial={"attitude": [np.pi, 0.0, 0.0]},
                simulation={"duration": 5.0, "record_timestep": record, "engine": "native"},
            )
        )
        ends.append(flight.end)
    assert ends[0] == ends[1]


def test_blue_gait_is_singular_from_the_start():
    """Columns 1, 3 and 2, 4 of tau cancel, so that no inputs make force without torque."""
    delta = float(np.arctan(2.423e-7 / (0.1785 * 8.048e-6)))
    alpha_1, alpha_2 = 0.3, -0.2
    angles = [alpha_1, alpha_2, 2 * delta - alpha_1, -2 * delta - alpha_2]
    flight = tiltsim.simulate(scenario(gait={"type": "fixed", "angles": angles}))
    assert flight.end.kind == "singular"
    assert flight.end.time == 0.0


def test_the_end_of_a_step_that_would_reverse_a_rotor_says_what_helps():
    step = {"reference.position": [2.0, 0.0, 0.0], "simulation.duration": 0.1, "expect": []}
    lost = tiltsim.load_scenario("fleet/cant_hexarotor#hover", step)
    assert tiltsim.simulate(lost).end.cause.endswith(
        "rotor 2 came to a stop; vehicle.min_rotor_speed = 100, controller.norm = "
        '"thrust", with which rotors reverse, or a smaller step of the reference may help'
    )
    for remedy in (
        {"vehicle.min_rotor_speed": 100.0},
        {"controller.norm": "thrust"},
        {"reference.position": [0.3, 0.0, 0.0]},
    ):
        assert tiltsim.simulate(lost.replace(remedy)).end.kind == "completed"


def test_exact_decoupling_ends_when_a_rotor_stops():
    flight = tiltsim.simulate(
        scenario(
            controller=EXACT,
            initial={"rotor_speed": [20.0, 300.0, 300.0, 300.0], "angular_velocity": [0, 20, 0]},
            simulation={"duration": 5.0},
        )
    )
    assert flight.end.kind == "singular"
    assert "rotor 3 came to a stop" in flight.end.cause


def test_interrupt_keeps_the_samples_so_far():
    def stop_at_half_a_second(sample):
        if sample[0] >= 0.2:
            raise KeyboardInterrupt

    flight = tiltsim.simulate(scenario(), stop_at_half_a_second)
    assert flight.end.kind == "interrupted"
    assert flight["time"][-1] == pytest.approx(0.2)


# --- the flight as data ------------------------------------------------------------------------


def test_flight_table_has_every_column_with_its_unit_and_origin():
    flight = tiltsim.simulate(scenario())
    table = flight.to_arrow()
    assert table.column_names == list(COLUMNS)
    for field in table.schema:
        assert field.metadata == {b"unit": COLUMNS[field.name].unit.encode()}
    assert table.num_rows == len(flight) == 51
    metadata = table.schema.metadata
    assert {b"scenario", b"seed", b"mujoco_version", b"tiltsim_version"} <= set(metadata)


def test_thrust_column_carries_the_weight_in_hover():
    flight = tiltsim.simulate(scenario(simulation={"duration": 15.0, "engine": "native"}))
    total = sum(flight[f"thrust_{rotor}"][-1] for rotor in (1, 2, 3, 4))
    assert total == pytest.approx(0.429 * 9.8, rel=1e-3)


def test_servo_follows_the_moving_gait_closely():
    """The rate feed-forward removes the lag of 2 zeta / omega that a plain servo would have."""
    flight = tiltsim.simulate(scenario(gait={**GAITS["trot_continuous"], "period": 1.0}))
    lag = np.abs(flight["alpha_1"] - flight["alpha_ref_1"])
    rate = 4 * 0.5 / 1.0
    settled = flight["time"] > 0.1
    assert lag[settled].max() < 0.05 * rate * 2 / 300


def test_rotor_limits_hold_and_are_counted():
    flight = tiltsim.simulate(
        scenario(
            vehicle={"max_rotor_speed": 340.0, "min_rotor_speed": 290.0},
            simulation={"duration": 1.0},
        )
    )
    metrics = flight.metrics()
    assert metrics["max_rotor_speed"] <= 340.0
    assert metrics["min_rotor_speed"] >= 290.0
    assert metrics["saturated_fraction"] > 0.1


@pytest.mark.parametrize("userdata", [3, 80, 5000])
def test_foreign_model_is_left_alone_by_the_callbacks(userdata):
    """MuJoCo's callback is global: stepping another model under it must not crash or write."""
    import mujoco

    from tiltsim.engines.control import control_callback, make_callback

    assembly = assemble(scenario())
    plant = MujocoPlant(assembly)
    other = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><body><freejoint/><geom size='1'/><site name='s'/></body></worldbody>"
        "<actuator><general name='a' site='s'/></actuator>"
        f"<size nuserdata='{userdata}'/></mujoco>"
    )
    data = mujoco.MjData(other)
    for name in ENGINES:
        callback = make_callback(name, assembly, plant.model, plant.data)
        with control_callback(callback):
            mujoco.mj_step(other, data)
        assert data.ctrl.tolist() == [0.0]
    assert data.time == pytest.approx(2 * other.opt.timestep)
    assert mujoco.get_mjcb_control() is None


def test_state_of_another_flight_brings_its_parameters_along():
    """Parameters are part of MuJoCo's state, whichever engine reads them."""
    ends = []
    for engine in ENGINES:
        plants = [
            make_plant(
                assemble(
                    scenario(
                        reference={"type": "setpoint", "position": [x, 0.0, 0.0]},
                        simulation={"engine": engine},
                    )
                )
            )
            for x in (0.0, 1.0)
        ]
        plants[0].state = plants[1].state
        for plant in plants:
            plant.advance(100)
        np.testing.assert_array_equal(plants[0].state, plants[1].state)
        ends.append(plants[0].state)
    np.testing.assert_array_equal(*ends)


def test_samples_cannot_be_changed_behind_the_columns():
    flight = tiltsim.simulate(scenario(simulation={"duration": 0.02}))
    with pytest.raises(ValueError, match="read-only"):
        flight.samples[0, 0] = 1.0


def test_a_flight_has_a_one_line_repr_and_lists_its_columns():
    flown = tiltsim.simulate(
        tiltsim.parse_scenario({"simulation": {"duration": 0.1, "engine": "python"}})
    )
    line = "<Flight of scenario: completed at 0.1 s, 11 samples of 41 columns>"
    assert repr(flown) == line
    with pytest.raises(KeyError, match=r"'rol': no column of this flight; did you mean roll\?"):
        flown["rol"]


def test_progress_is_reported_now_and_then_and_at_the_end(monkeypatch):
    monkeypatch.setattr(arguments, "INTERVAL", 1e9)
    times = []
    flight = tiltsim.simulate({"simulation": {"duration": 0.2}}, progress=times.append)
    assert times[-1] == flight["time"][-1] == pytest.approx(0.2)
    assert len(times) <= 2


def test_progress_may_be_a_bar(capsys):
    tiltsim.simulate({"simulation": {"duration": 0.01}}, progress=True)
    assert capsys.readouterr().out == ""
