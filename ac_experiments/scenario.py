"""What happens in a run: a YAML file, read, checked against the schema, and turned into arrays over all ticks."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from ac_common.errors import UserError, nearest, one_line, shortened
from ac_common.faults import FAULTS, KINDS, STICKING, Fault
from ac_common.units import KPA
from ac_common.yaml_file import parsed, shipped, text_of, yaml_text
from ac_experiments.car_schema import Car, over_time
from ac_experiments.drives import drive, seed_of
from ac_experiments.scenario_schema import SHORTEST_S, Change, Scenario
from ac_experiments.schema_part import quoted, unknown

if TYPE_CHECKING:
    from ac_plant_node.cabin import CabinState

BUILT_IN = Path(__file__).parent / "scenarios"


@dataclass(frozen=True)
class Schedule:
    """A scenario as arrays over its K ticks, SI: what the loop and the scenario node play.

    Attributes
    ----------
    time_s
        (K,) exactly ``k * tick_ns / 1e9``, as a receiver computes it from a stamp.
    reference
        (K, 2) ``[p_e Pa, SH K]``.
    air
        (K, 5) the fields of `ac_common.signals.AirSide`.
    faults
        (K, F) size of each fault of `ac_common.faults.FAULTS`, SI.
    stuck
        (K, S) of each of `ac_common.faults.STICKING` 1 while its reading stands still, else 0.
    car
        (K, 5) the fields of `ac_common.signals.CarSide`; (K, 0) without a car.
    """

    time_s: NDArray[np.float64]
    reference: NDArray[np.float64]
    air: NDArray[np.float64]
    faults: NDArray[np.float64]
    stuck: NDArray[np.float64]
    car: NDArray[np.float64]


def schedule(scenario: Scenario, inputs: NDArray[np.float64], outputs: NDArray[np.float64]) -> Schedule:
    """Turn a scenario into arrays over all ticks.

    Parameters
    ----------
    scenario
        The checked scenario.
    inputs
        Inputs at the operating point, (7,) ``[rad/s, 0..1, kg/s, degC, kg/s, degC, 0..1]``: actuators, then the fields
        of `ac_common.signals.AirSide`.
    outputs
        Outputs at the operating point, (4,) ``[p_e Pa, SH K, T_w degC, p_c Pa]``.
    """
    time_s = np.arange(scenario.ticks) * scenario.tick_ns / 1e9
    references = scenario.references
    return Schedule(
        time_s=time_s,
        reference=np.column_stack(
            [
                outputs[0] + KPA * _moves(time_s, references.evaporator_pressure_kpa),
                outputs[1] + _moves(time_s, references.superheat_k),
            ]
        ),
        air=_air(scenario, time_s, inputs) if scenario.car is None else _outside(scenario.car, time_s, inputs),
        faults=np.column_stack([_of_kind(scenario, kind, time_s) for kind in FAULTS]),
        stuck=np.column_stack([_stuck(scenario, kind, time_s) for kind in STICKING]),
        car=np.empty((len(time_s), 0)) if scenario.car is None else _car_side(scenario.car, time_s),
    )


def _air(scenario: Scenario, time_s: NDArray[np.float64], inputs: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the air side over time, (K, 5), as changes from the operating point."""
    air = scenario.air
    return np.column_stack(
        [
            inputs[2] * (1.0 + _moves(time_s, air.mass_flow_percent) / 100.0),
            inputs[3] + _moves(time_s, air.inlet_temperature_k),
            inputs[4] * (1.0 + _moves(time_s, air.condenser_mass_flow_percent) / 100.0),
            inputs[5] + _moves(time_s, air.condenser_inlet_temperature_k),
            inputs[6] + _moves(time_s, air.humidity_percent) / 100.0,
        ]
    )


def _outside(car: Car, time_s: NDArray[np.float64], inputs: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return blower and outside air, (K, 5), in the places of the air side; what a car makes of them is a result."""
    return np.column_stack(
        [
            over_time(car.blower_kg_s, time_s),
            np.full_like(time_s, inputs[3]),
            np.full_like(time_s, inputs[4]),
            over_time(car.outside_temperature_c, time_s),
            over_time(car.outside_humidity_percent, time_s) / 100.0,
        ]
    )


def _car_side(car: Car, time_s: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the fields of `CarSide` over time, (K, 5)."""
    from ac_plant_node.drive_cycle import belt_speed

    vehicle_m_s = over_time(car.vehicle_speed_km_h, time_s) / 3.6
    return np.column_stack(
        [
            vehicle_m_s,
            over_time(car.sun_w_m2, time_s),
            over_time(car.people, time_s),
            over_time(car.recirculation_percent, time_s) / 100.0,
            belt_speed(vehicle_m_s, car.driveline) if car.has_belt else np.zeros_like(time_s),
        ]
    )


def cabin_of(car: Car) -> "CabinState":
    """Return the cabin of a scenario's car at the start."""
    from ac_plant_node.cabin import Surroundings
    from ac_plant_node.car import cabin_at_start

    (outside_c, humidity, sun) = (
        float(over_time(curve, np.zeros(1))[0])
        for curve in (car.outside_temperature_c, car.outside_humidity_percent, car.sun_w_m2)
    )
    around = Surroundings(outside_c, humidity / 100.0, sun)
    return cabin_at_start(around, None if isinstance(car.cabin, str) else car.cabin)


def _of_kind(scenario: Scenario, kind: Fault, time_s: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the sum of all faults of a kind over time, (K,), SI; limited, since a random walk goes anywhere."""
    faults = (fault.over(time_s) for fault in scenario.faults if fault.fault is kind)
    return np.clip(sum(faults, start=np.zeros_like(time_s)), kind.lowest_si, kind.largest_si)


def _stuck(scenario: Scenario, kind: Fault, time_s: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return 1 where a reading stands still, else 0, (K,)."""
    faults = [fault.stuck(time_s) for fault in scenario.faults if fault.fault is kind]
    return np.any([np.zeros_like(time_s, dtype=bool), *faults], axis=0).astype(np.float64)


def _moves(time_s: NDArray[np.float64], changes: Sequence[Change]) -> NDArray[np.float64]:
    """Return the offset over time, (K,): 0, then each change in turn from where the one before left it."""
    offset = np.zeros_like(time_s)
    start = 0.0
    for change in changes:
        progress = (time_s >= change.at_s).astype(np.float64)
        if change.ramp_s > SHORTEST_S:
            progress = np.clip((time_s - change.at_s) / change.ramp_s, 0.0, 1.0)
        offset += (change.to - start) * progress
        start = change.to
    return offset


def built_in_scenarios() -> dict[str, Path]:
    """Return the names of the built-in scenarios and where they are, in alphabetical order."""
    return {path.stem: path for path in sorted(BUILT_IN.glob("*.yaml"))}


def load(name_or_path: str | Path, overrides: Sequence[str] = (), *, whole: bool = True) -> Scenario:
    """Read a scenario by built-in name or by path, with ``KEY=VALUE`` overrides applied, and check it.

    A drive cycle becomes the changes of the air flows that it stands for, so the scenario then is all there is to know.

    Parameters
    ----------
    name_or_path
        A built-in name (``actuator_fault``), a random drive (``drive:123``), or the path of a YAML file.
    overrides
        ``dotted.key=value``; list items by number, as in ``faults.0.size_rpm=60``.
    whole
        False leaves the file of a drive cycle unread: enough to say what a scenario is about.

    Raises
    ------
    UserError
        One line naming the file, the key, what was given and what is allowed.
    """
    seed = seed_of(str(name_or_path))
    path = _find(name_or_path) if seed is None else Path(str(name_or_path))
    if seed is not None:
        content: Any = drive(seed)
    elif path.parent == BUILT_IN:
        content = shipped(path)
    else:
        content = parsed(text_of(path), f"{path}: not valid YAML")
    if not isinstance(content, dict):
        msg = f"{path}: must hold keys and values such as 'duration_s: 600', not {_kind(content)}"
        raise UserError(msg)
    content.setdefault("name", path.stem)
    for override in overrides:
        _override(content, override)
    source = f"{path.name} with --set" if overrides else str(path)
    scenario = _validated(content, source)
    return _driven(scenario, source) if whole else scenario


def check(content: Mapping[str, Any], source: str = "scenario") -> Scenario:
    """Check a mapping against the scenario schema; raises `UserError` as `load` does."""
    return _driven(_validated(dict(content), source), source)


def to_yaml(scenario: Scenario) -> str:
    """Return `scenario` as a YAML text that `load` reads back to an equal one."""
    return yaml_text(scenario.model_dump(mode="json", exclude_defaults=True))


# ---------------------------------------------------------------------------------------------------- reading


def _find(name_or_path: str | Path) -> Path:
    text = str(name_or_path)
    known = built_in_scenarios()
    if text in known:
        return known[text]
    path = Path(text)
    if path.is_dir():
        msg = f"{text}: is a folder, not a scenario file"
        raise UserError(msg)
    if path.exists():
        return path
    if path.suffix in (".yaml", ".yml") or "/" in text:
        msg = f"{text}: no such scenario file"
        raise UserError(msg)
    raise UserError(unknown("scenario", text, list(known)) + ", drive:SEED, or the path of a YAML file")


#: Characters of the problems that a complaint may have, besides the first.
LONGEST_COMPLAINT = 800

_LIST_EXAMPLES = (
    "for instance faults=[{kind: compressor_speed, size_rpm: 40, onset_s: 100}] "
    "or references.superheat_k=[{at_s: 100, to: -2.5}]"
)


def setting(text: str) -> tuple[str, Any, str]:
    """Return key and value of a ``dotted.key=value``, and how a complaint about it begins.

    Raises
    ------
    UserError
        When it is none, or its value is not valid YAML.
    """
    key, equals, value = text.partition("=")
    source = f"--set {shortened(text)}"
    if not equals or not key:
        msg = f"{source}: must be KEY=VALUE, for instance faults.0.size_rpm=60"
        raise UserError(msg)
    return key, parsed(value, f"{source}: the value {quoted(value)} is not valid YAML"), source


def _override(content: dict[str, Any], override: str) -> None:
    """Set one ``dotted.key=value`` in the raw content; the schema then judges it like any other value."""
    put_value(content, *setting(override))


def put_value(content: dict[str, Any], key: str, value: Any, source: str) -> None:
    """Set the value of a dotted key in the raw content of a scenario; `source` begins the complaint about a bad key."""
    target: Any = content
    *parents, last = key.split(".")
    for depth, part in enumerate(parents):
        where = ".".join(parents[: depth + 1])
        if isinstance(target, list):
            target = target[_index(part, target, source, where)]
        else:
            if target.get(part) is None:
                target[part] = [] if key.split(".")[depth + 1].isdecimal() else {}
            target = target[part]
        if not isinstance(target, dict | list):
            msg = f"{source}: {shortened(where)} is {_kind(target)} and has nothing below it"
            raise UserError(msg)
    if isinstance(target, list):
        target[_index(last, target, source, key)] = value
    else:
        target[last] = value


def _index(part: str, items: list[Any], source: str, where: str) -> int:
    if part.isdecimal() and len(part) < 10 and int(part) < len(items):
        return int(part)
    allowed = f"0 to {len(items) - 1}" if items else f"none, the list is empty; give a whole one, {_LIST_EXAMPLES}"
    msg = f"{source}: {shortened(where)} is not an item of the list; allowed: {allowed}"
    raise UserError(msg)


# --------------------------------------------------------------------------------------------- error messages


def _validated(content: dict[str, Any], source: str) -> Scenario:
    try:
        return Scenario.model_validate(content)
    except ValidationError as error:
        raise UserError(complaint(error, source)) from None


def complaint(error: ValidationError, source: str) -> str:
    """Return in one line what a schema found wrong with a file, the first three of its problems or as many as fit."""
    lines = [_line(problem) for problem in error.errors(include_url=False)]
    told = [line for at, line in enumerate(lines[:3]) if at == 0 or sum(map(len, lines[: at + 1])) < LONGEST_COMPLAINT]
    more = f" (and {len(lines) - len(told)} more)" if len(lines) > len(told) else ""
    return f"{source}: {'; '.join(told)}{more}"


def _driven(scenario: Scenario, source: str) -> Scenario:
    """Return the scenario with the drive cycle, if there is one, as what it stands for."""
    content = scenario.model_dump(mode="json")
    try:
        if scenario.air.drive_cycle is not None:
            where = "air.drive_cycle.file"
            content["air"] |= {**scenario.air.drive_cycle.changes(), "drive_cycle": None}
        elif scenario.car is not None and scenario.car.drive_cycle is not None:
            where = "car.drive_cycle"
            content["car"] |= {"vehicle_speed_km_h": scenario.car.points(), "drive_cycle": None}
        else:
            return scenario
    except ValueError as problem:
        msg = f"{source}: {where}: {problem}"
        raise UserError(msg) from None
    return _validated(content, source)


def _line(problem: Any) -> str:
    """Return one pydantic problem as ``key: what was given, what is allowed``."""
    # Where a fault's kind chooses its model, pydantic names it after the fault's number.
    place = problem["loc"]
    if place[:1] == ("faults",) and place[2:3] and place[2] in KINDS:
        place = (*place[:2], *place[3:])
    where = ".".join(str(part) for part in place)
    prefix = f"{where}: " if where else ""
    kind, given, context = problem["type"], problem.get("input"), problem.get("ctx", {})
    if kind == "value_error":
        return prefix + str(context["error"])
    if kind == "missing":
        return f"{prefix}is missing"
    if kind == "union_tag_not_found":
        return f"{prefix}kind is missing; allowed: {', '.join(sorted(KINDS))}"
    if kind == "union_tag_invalid":
        return f"{prefix}{unknown('kind', context['tag'], sorted(KINDS))}"
    if kind == "literal_error":
        hint = nearest(given, re.findall(r"'(.*?)'", context["expected"]))
        return f"{prefix}given {quoted(given)}{hint} allowed: {context['expected']}"
    if kind == "list_type":
        return f"{prefix}given {quoted(given)}; must be a list, {_LIST_EXAMPLES}"
    allowed = one_line(problem["msg"]).replace("Input should be", "must be")
    return f"{prefix}given {quoted(given)}; {allowed}"


def _kind(value: object) -> str:
    names = {
        dict: "a mapping",
        list: "a list",
        str: "a text",
        int: "a number",
        float: "a number",
        type(None): "nothing",
    }
    return names.get(type(value), f"a {type(value).__name__}")
