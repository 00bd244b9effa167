"""What a scenario says of a car, what becomes of it, and what is refused."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ac_common.errors import UserError
from ac_common.signals import AirSide, CarSide
from ac_common.units import RPM
from ac_experiments.car_schema import over_time
from ac_experiments.scenario import cabin_of, check, load, schedule, to_yaml
from ac_plant_node.drive_cycle import DriveCycle, Driveline, belt_speed, compressor_speed

INPUTS = np.array([1000.0 * RPM, 0.40, 0.13, 30.0, 0.55, 30.0, 0.0])
OUTPUTS = np.array([251.2e3, 20.0, 15.0, 1.33e6])
BASE = {"name": "c", "duration_s": 20.0, "passive": True}


def made(**car: object) -> dict[str, object]:
    return {**BASE, "car": car}


def test_curves_are_played_to_the_car() -> None:
    scenario = check(
        made(
            outside_temperature_c=[[5, 30], [15, 40]], outside_humidity_percent=55, sun_w_m2=[[0, 0], [10, 800]],
            people=2, recirculation_percent=25, blower_kg_s=0.2, vehicle_speed_km_h=[[0, 0], [10, 72]],
        )
    )  # fmt: skip
    plan = schedule(scenario, INPUTS, OUTPUTS)
    k = round(10.0 / 0.1)
    air, car = AirSide(*plan.air[k]), CarSide(*plan.car[k])
    assert (air.mass_flow, air.condenser_inlet_temperature, air.humidity) == pytest.approx((0.2, 35.0, 0.55))
    assert (air.inlet_temperature, air.condenser_mass_flow) == (30.0, 0.55)
    assert car == pytest.approx((20.0, 800.0, 2.0, 0.25, 0.0))
    assert plan.air[0, 3] == 30.0
    assert plan.air[-1, 3] == 40.0
    assert schedule(check(BASE), INPUTS, OUTPUTS).car.shape == (200, 0)


def test_the_belt_follows_engine_and_gears() -> None:
    scenario = check(
        made(compressor_drive="belt", vehicle_speed_km_h=[[0, 0], [20, 100]], idle_rpm=800, pulley_ratio=1.5)
    )
    speed = schedule(scenario, INPUTS, OUTPUTS).car[:, 4]
    assert speed[0] == pytest.approx(1.5 * 800 * RPM)
    at = round(0.5 * 20 / 0.1)  # 50 km/h: third gear, from 25 to 40 mph
    assert speed[at] == pytest.approx(1.5 * 50 / 3.6 / 0.30 * 1.28 * 3.9)


def test_the_belt_s_driveline_is_the_drive_cycle_s_where_nothing_is_said() -> None:
    car = check(made(compressor_drive="belt", vehicle_speed_km_h=[[0, 0], [20, 100]])).car
    assert car is not None
    assert car.driveline == Driveline()


@given(st.lists(st.floats(0.0, 40.0), min_size=2, max_size=20))
def test_belt_speed_is_that_of_a_drive_cycle(speeds: list[float]) -> None:
    cycle = DriveCycle(np.arange(len(speeds), dtype=np.float64), np.array(speeds))
    one_by_one = [compressor_speed(cycle, float(t)) for t in cycle.time_s]
    np.testing.assert_array_equal(belt_speed(cycle.speed_m_s), one_by_one)


@given(st.lists(st.floats(0.0, 250.0), min_size=1, max_size=5), st.floats(0.5, 3.0), st.floats(400.0, 1500.0))
def test_the_belt_keeps_within_the_plant_wherever_a_drive_passes(
    speeds: list[float], ratio: float, idle_rpm: float
) -> None:
    """Against the speeds passed one by one, those at which a gear is left among them."""
    line = Driveline(idle_rpm=idle_rpm, pulley_ratio=ratio)
    lowest, highest = min(speeds) / 3.6, max(speeds) / 3.6
    passed = np.unique(np.clip([*np.linspace(lowest, highest, 500), *line.shift_speeds_m_s], lowest, highest))
    fastest = belt_speed(passed, line).max()
    curve = [[float(10 * k), speed] for k, speed in enumerate(speeds)]
    content = made(compressor_drive="belt", vehicle_speed_km_h=curve, pulley_ratio=ratio, idle_rpm=idle_rpm)
    if fastest <= 6000.0 * RPM:
        assert check(content).has_belt
    else:
        with pytest.raises(UserError, match=f"car: the belt turns the compressor at {np.ceil(fastest / RPM):.0f} rpm"):
            check(content)


def test_a_drive_cycle_too_fast_for_the_belt_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "drive.csv"
    file.write_text("time_s,speed_m_s\n0,0\n5,0\n60,65\n")
    assert check(made(drive_cycle=str(file))).car is not None
    with pytest.raises(UserError, match="car: the belt turns the compressor at 7360 rpm; allowed: 6000; lower pulley"):
        check(made(drive_cycle=str(file), compressor_drive="belt"))


@given(
    st.lists(st.tuples(st.floats(0.0, 100.0), st.floats(0.0, 50.0)), min_size=1, max_size=8, unique_by=lambda p: p[0])
)
def test_curves_pass_through_their_points_and_stay_beyond_them(points: list[tuple[float, float]]) -> None:
    curve = [list(point) for point in sorted(points)]
    t, values = np.array(curve).T
    np.testing.assert_array_equal(over_time(curve, t), values)
    assert over_time(curve, np.array([t[0] - 1.0, t[-1] + 1.0])).tolist() == [values[0], values[-1]]
    assert check(made(outside_temperature_c=curve)).car.outside_temperature_c == curve  # type: ignore[union-attr]


def test_a_drive_cycle_becomes_points_that_need_no_file(tmp_path: Path) -> None:
    file = tmp_path / "drive.csv"
    file.write_text("time_s,speed_m_s\n0,0\n5,0\n10,10\n")
    scenario = load("sc03", [f"car.drive_cycle={file}"])
    assert scenario.car is not None
    assert scenario.car.vehicle_speed_km_h == [[0.0, 0.0], [5.0, 0.0], [10.0, 36.0]]
    assert check(scenario.model_dump(mode="json")) == scenario
    copy = tmp_path / "copy.yaml"
    copy.write_text(to_yaml(scenario))
    assert load(copy) == scenario


def test_the_cabin_is_soaked_or_as_it_is_given() -> None:
    car = check(made(outside_temperature_c=40, outside_humidity_percent=30, sun_w_m2=1000)).car
    assert car is not None
    soaked = cabin_of(car)
    assert 58.0 < soaked.air_c < 62.0 < soaked.interior_c
    cool = cabin_of(car.model_copy(update={"cabin": 5.0}))
    assert cool.air_c == cool.interior_c == 5.0
    assert cool.humidity_ratio < soaked.humidity_ratio  # air of 5 degC does not hold the water outside


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (made(blower_kg_s=0.5), "car.blower_kg_s: given 0.5; allowed: 0.02 to 0.3"),
        (made(sun_w_m2="bright"), "car.sun_w_m2: given 'bright'; must be a number, or a list of points [s, value]"),
        (made(sun_w_m2=[]), "car.sun_w_m2: given []; must be a number, or a list of points [s, value]"),
        (made(sun_w_m2=[[0, 1, 2]]), "car.sun_w_m2: given [0, 1, ...]; must be a number, or a list of points"),
        (made(people=[[3, 1], [3, 2]]), "car.people: the point at 3 s does not come after the one before"),
        (made(cabin="hot"), "car.cabin: given 'hot'; allowed: soaked, or 0 to 70 (degC)"),
        (made(compressor_drive="chain"), "car.compressor_drive: given 'chain'; allowed: 'electric' or 'belt'"),
        (made(blower=0.1), "car: unknown key 'blower', did you mean 'blower_kg_s'? allowed: outside_temperature_c"),
        (made(drive_cycle="a.csv", vehicle_speed_km_h=3), "both say how the car moves; give one of them"),
        (
            made(compressor_drive="belt", vehicle_speed_km_h=250),
            "car: the belt turns the compressor at 7863 rpm; allowed: 6000; lower pulley_ratio or the vehicle's speed",
        ),
        (
            # 2nd gear at the end, but 15 mph in the 1st on the way there
            made(compressor_drive="belt", vehicle_speed_km_h=[[0, 0], [10, 30]], pulley_ratio=2.1),
            "car: the belt turns the compressor at 6206 rpm; allowed: 6000; lower pulley_ratio or the vehicle's speed",
        ),
        (made(drive_cycle="no.csv"), "car.drive_cycle: drive cycle no.csv: no such file; the EPA publishes SC03"),
        (
            {**made(), "air": {"humidity_percent": [{"at_s": 0, "to": 5}]}},
            "air and car both say what the air does; give one of them",
        ),
        (
            {**made(compressor_drive="belt"), "passive": False},
            "car.compressor_drive: belt needs passive: true, since the compensators move the compressor, too",
        ),
        (
            {**made(compressor_drive="belt"), "design": "envelope"},
            "design: envelope moves the compressor; car.compressor_drive: belt needs design: paper",
        ),
        (
            {**made(compressor_drive="belt"), "references": {"evaporator_pressure_kpa": [{"at_s": 1, "to": 5}]}},
            "references.evaporator_pressure_kpa does nothing with car.compressor_drive: belt, where the valve alone",
        ),
        (
            {**made(compressor_drive="belt"), "controller": "paper"},
            "controller: paper moves the compressor, which with car.compressor_drive: belt only the engine does",
        ),
        (
            {
                **made(compressor_drive="belt"),
                "faults": [{"kind": "compressor_speed", "size_rpm": 40, "onset_s": 1}],
            },
            "faults.0: there is no compressor_speed fault with car.compressor_drive: belt",
        ),
    ],
    ids=lambda value: value[:24] if isinstance(value, str) else "",
)
def test_what_does_not_fit_is_refused_in_one_line(content: dict[str, object], said: str) -> None:
    with pytest.raises(UserError) as caught:
        check(content)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)
