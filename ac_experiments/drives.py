"""Random drives over a moving load, `drive:SEED`: a built-in family of scenarios.

1500 s from any of the three points, with ramps of the inlet air (20 to 43 degC), of the condenser's air (20 to 45 degC,
-50 to +100 % of flow as a vehicle's speed makes it) and of both references (205 to 300 kPa, -8 to +4 K), and steps of
the blower (-35 to +45 %). The seed of the noise is that of the drive.
"""

import re
from collections.abc import Callable
from typing import Any

import numpy as np

DURATION_S, _TICK_S = 1500.0, 0.1
FAMILY = "drive"
_NAME = re.compile(rf"{FAMILY}:(\d{{1,10}})")
_RUN = re.compile(rf"{FAMILY}-(\d{{1,10}})")
_Changes = list[dict[str, float]]
_Draws = tuple[float, float]


def seed_of(name: str) -> int | None:
    """Return the seed in a name such as `drive:123`; None for another name."""
    found = _NAME.fullmatch(name)
    return int(found[1]) if found else None


def name_of(run: str) -> str:
    """Return the name by which the scenario of a run is loaded: `drive:123` for the run `drive-123`, else as it is."""
    return _RUN.sub(rf"{FAMILY}:\1", run) if _RUN.fullmatch(run) else run


def drive(seed: int) -> dict[str, Any]:
    """Return the content of a scenario file: the drive with this seed."""
    from ac_plant_node import operating_point
    from ac_plant_node.dynamics.drive import AIR_C, held_inputs
    from ac_plant_node.inputs import INPUT
    from ac_plant_node.parameters.file import load_parameters

    rng = np.random.default_rng(seed)
    point = str(rng.choice(["low", "med", "high"]))
    at = operating_point(point)
    inputs = held_inputs(at.inputs, load_parameters())
    air_c, condenser_c = float(inputs[AIR_C]), float(inputs[INPUT["condenser_air_inlet_temperature"]])
    pressure = float(at.outputs[0])
    # The order of the draws is what a seed stands for.
    inlet = _ramps(rng, (20.0, 43.0), lambda to: to - air_c)
    blower = _steps(rng, (-0.35, 0.45), lambda to: 100.0 * to)
    condenser_air = _ramps(rng, (-0.5, 1.0), lambda to: 100.0 * to, pause=(10.0, 80.0), length=(3.0, 30.0))
    condenser_inlet = _ramps(rng, (20.0, 45.0), lambda to: to - condenser_c)
    pressures = _ramps(rng, (205e3, 300e3), lambda to: (to - pressure) / 1e3, length=(10.0, 60.0))
    superheats = _ramps(rng, (-8.0, 4.0), lambda to: to, length=(10.0, 60.0))
    return {
        "name": f"{FAMILY}-{seed}",
        "description": f"A random drive over a moving load, seed {seed}.",
        "operating_point": point,
        "duration_s": DURATION_S,
        "sensors": ["p_e", "superheat", "T_w", "p_c"],
        "references": {"evaporator_pressure_kpa": pressures, "superheat_k": superheats},
        "air": {
            "inlet_temperature_k": inlet,
            "mass_flow_percent": blower,
            "condenser_mass_flow_percent": condenser_air,
            "condenser_inlet_temperature_k": condenser_inlet,
        },
        "noise": {
            "evaporator_pressure_kpa": 0.2,
            "superheat_k": 0.1,
            "wall_temperature_k": 0.05,
            "condenser_pressure_kpa": 2.0,
            "seed": seed,
        },
    }


def _ramps(
    rng: np.random.Generator,
    targets: _Draws,
    unit: Callable[[float], float],
    pause: _Draws = (60.0, 200.0),
    length: _Draws = (20.0, 150.0),
) -> _Changes:
    """Return ramps of random length to random targets, with pauses between them."""
    changes, now = [], 0.0
    while (now := now + rng.uniform(*pause)) < DURATION_S:
        to, takes = rng.uniform(*targets), rng.uniform(*length)
        ramp_s = (int(takes / _TICK_S) - 1) * _TICK_S  # from the first to the last of its ticks
        changes.append({"at_s": _at(now), "to": float(unit(to)), "ramp_s": round(ramp_s, 9)})
        now += takes
    return changes


def _steps(rng: np.random.Generator, targets: _Draws, unit: Callable[[float], float]) -> _Changes:
    """Return steps to random targets."""
    changes, now = [], 0.0
    while (now := now + rng.uniform(60.0, 200.0)) < DURATION_S:
        changes.append({"at_s": _at(now), "to": float(unit(rng.uniform(*targets)))})
    return changes


def _at(now: float) -> float:
    return round(int(now / _TICK_S) * _TICK_S, 9)
