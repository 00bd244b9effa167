"""Drive cycles: vehicle speed over time from a file, and the compressor speed it stands for.

The product ships no schedule. The SC03 (air-conditioning) schedule of 40 CFR Part 86, Appendix I is published by the
US EPA as two-column text under "Dynamometer Drive Schedules".

Engine and pulley (a compact car with a belt-driven compressor that is always engaged): the engine turns with the
wheels in the gear that belongs to the speed, never below idle,

``N_engine = max(N_idle, 60 v / (2 pi r_wheel) * i_gear * i_final)``, ``N_compressor = i_pulley * N_engine``.
"""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ac_common.errors import UserError, shortened
from ac_common.units import RPM
from ac_plant_node.condenser_air import LOW, FrontEnd, condenser_air_flow, fan_stage
from ac_plant_node.inputs import INPUT

EPA_PAGE = "https://www.epa.gov/vehicle-and-fuel-emissions-testing/dynamometer-drive-schedules"
"""Where the EPA publishes its schedules."""

MPH = 0.44704
"""m/s in one mile per hour."""
_UNITS = tuple(
    (re.compile(rf"(?<![a-z])(?:{spellings})(?![a-z])"), factor)
    for spellings, factor in (
        (r"km ?[/_p]? ?h|kph|kilomet(?:er|re)s? per hour|km h-1", 1.0 / 3.6),
        (r"mph|mi ?[/_] ?h|miles?(?: per hour)?", MPH),
        (r"m ?[/_] ?s|mps|met(?:er|re)s? per second|m s-1", 1.0),
    )
)
_SOME_UNIT = re.compile(r"(?<![a-z])(?:per|kn|kt|knots?|ft|feet)(?![a-z])|/ ?[hs](?![a-z])|h-1|s-1")
"""Looks like a unit of a speed, but is none of those."""


@dataclass(frozen=True)
class DriveCycle:
    """Vehicle speed over time.

    Attributes
    ----------
    time_s : (n,) array
        Increasing, starts at 0.
    speed_m_s : (n,) array
    """

    time_s: NDArray[np.float64]
    speed_m_s: NDArray[np.float64]


@dataclass(frozen=True)
class Driveline:
    """Engine, gearbox and pulley of a compact car.

    Attributes
    ----------
    idle_rpm : float
        Engine speed at standstill, air conditioning on.
    gear_ratios, final_drive : tuple of float, float
        A five-speed gearbox.
    shift_speeds_m_s : tuple of float
        Speeds above which the next gear is in: 15, 25, 40, 45 mph, customary on the EPA's dynamometers.
    wheel_radius_m : float
        Rolling radius.
    pulley_ratio : float
        Compressor over engine speed.
    """

    idle_rpm: float = 750.0
    gear_ratios: tuple[float, ...] = (3.55, 1.95, 1.28, 0.95, 0.76)
    final_drive: float = 3.9
    shift_speeds_m_s: tuple[float, ...] = (15 * MPH, 25 * MPH, 40 * MPH, 45 * MPH)
    wheel_radius_m: float = 0.30
    pulley_ratio: float = 1.2


def load_drive_cycle(path: str | Path) -> DriveCycle:
    """Read a schedule: comma-, tab- or blank-separated columns time and speed.

    The speed's unit is taken from the header (``mph``, ``km/h``, ``m/s`` in any common spelling); where it names none
    it is miles per hour, as in the EPA's files. Lines that start with ``#`` are skipped.

    Raises
    ------
    UserError
        One line: no such file (and where the EPA publishes it), no data, a header with another unit, a line that is
        not two numbers, times that do not increase, a negative or absurd speed.
    """
    file = Path(path)
    shown = f"drive cycle {shortened(file, 200)}"
    try:
        lines = file.read_text(encoding="utf-8-sig", errors="replace").splitlines()
    except OSError as error:
        reason = "no such file" if isinstance(error, FileNotFoundError) else error.strerror
        raise UserError(f"{shown}: {reason}; the EPA publishes SC03 and others at {EPA_PAGE}") from error
    unit = MPH
    rows: list[tuple[float, float]] = []
    for number, line in enumerate(lines, 1):
        text = line.strip()
        if not text or text.startswith("#"):
            continue
        cells = [cell for cell in re.split(r"[,;\t ]+", text) if cell]
        try:
            time, speed = (float(cell) for cell in cells)
        except ValueError:
            if rows:
                raise UserError(f"{shown}: line {number} is not two numbers: {text[:40]!r}") from None
            unit = _unit(text, unit, f"{shown}: line {number}")
            continue
        if not (np.isfinite(time) and 0.0 <= speed * unit <= 100.0):
            raise UserError(f"{shown}: line {number} has speed {speed:g}, allowed are 0 to 100 m/s")
        if rows and time <= rows[-1][0]:
            raise UserError(f"{shown}: time does not increase at line {number}")
        rows.append((time, speed * unit))
    if len(rows) < 2:
        raise UserError(f"{shown}: fewer than two lines of data")
    table = np.array(rows)
    return DriveCycle(table[:, 0] - table[0, 0], table[:, 1])


def _unit(header: str, otherwise: float, where: str) -> float:
    """Return the unit of the speed [m/s] that a header names; `otherwise` when it names none."""
    found = next((factor for pattern, factor in _UNITS if pattern.search(header.lower())), None)
    if found is None and _SOME_UNIT.search(header.lower()):
        raise UserError(f"{where} names no unit that is known: {header[:40]!r}; allowed: mph, km/h, m/s")
    return otherwise if found is None else found


def compressor_speed(cycle: DriveCycle, time_s: float, driveline: Driveline | None = None) -> float:
    """Return the compressor speed (rad/s) at a time into the cycle; past its end the last speed stays."""
    return float(belt_speed(np.interp(time_s, cycle.time_s, cycle.speed_m_s), driveline))


def belt_speed(vehicle_m_s: ArrayLike, driveline: Driveline | None = None) -> NDArray[np.float64]:
    """Return the speed (rad/s) of a compressor on the belt at these vehicle speeds, of the same shape."""
    d, speed = driveline or Driveline(), np.asarray(vehicle_m_s, dtype=np.float64)
    gear = np.searchsorted(d.shift_speeds_m_s, speed, side="left")  # of a shift speed itself the lower one
    wheels = speed / d.wheel_radius_m * np.array(d.gear_ratios)[gear] * d.final_drive
    return np.asarray(d.pulley_ratio * np.maximum(wheels, d.idle_rpm * RPM))


def fastest_belt_speed(lowest_m_s: float, highest_m_s: float, driveline: Driveline | None = None) -> float:
    """Return the highest speed (rad/s) of a compressor on the belt while the vehicle passes all speeds between two.

    In each gear it rises with the vehicle's speed, so it is highest at the end or where a gear is left.
    """
    d = driveline or Driveline()
    left = [speed for speed in d.shift_speeds_m_s if lowest_m_s <= speed <= highest_m_s]
    return float(belt_speed([*left, highest_m_s], d).max())


@dataclass(frozen=True)
class DriveCycleRun:
    """Sampled outputs of the plant driven open loop through a cycle.

    Attributes
    ----------
    time_s, vehicle_speed_m_s, compressor_speed_rad_s : (n,) array
    outputs : (n, 4) array
        p_e Pa, SH K, T_w degC, p_c Pa at the end of each sample.
    mass_drift, energy_imbalance : float
        Relative change of the refrigerant mass; stored energy against heat and work, over the heat moved.
    """

    time_s: NDArray[np.float64]
    vehicle_speed_m_s: NDArray[np.float64]
    compressor_speed_rad_s: NDArray[np.float64]
    outputs: NDArray[np.float64]
    mass_drift: float
    energy_imbalance: float


def run_drive_cycle(
    cycle: DriveCycle,
    point: str = "med",
    sample_time_s: float = 0.1,
    driveline: Driveline | None = None,
    front: FrontEnd | None = None,
) -> DriveCycleRun:
    """Simulate the plant through a cycle from an operating point, its valve held, the compressor on the belt.

    With a `front` the condenser gets ram air over the vehicle's speed and its fan's; otherwise its air is held too.
    """
    from ac_plant_node.plant import Plant

    plant = Plant.at(point)
    mass, energy, w = plant.refrigerant_mass_kg, plant.stored_energy_j, plant.inputs
    time = np.arange(0.0, cycle.time_s[-1], sample_time_s)
    speed = np.array([compressor_speed(cycle, float(t), driveline) for t in time])
    outputs = np.empty((len(time), 4))
    vehicle, stage = np.interp(time, cycle.time_s, cycle.speed_m_s), LOW
    for k, omega in enumerate(speed):
        w[0] = omega
        if front is not None:
            stage = fan_stage(stage, plant.outputs.condenser_pressure_pa, compressor_on=True, front=front)
            w[INPUT["condenser_air_mass_flow"]] = condenser_air_flow(float(vehicle[k]), stage, front=front)
        outputs[k] = plant.step(w, sample_time_s)
    return DriveCycleRun(
        time,
        vehicle,
        speed,
        outputs,
        plant.refrigerant_mass_kg / mass - 1.0,
        (plant.stored_energy_j - energy - plant.heat_in_j) / plant.heat_moved_j,
    )
