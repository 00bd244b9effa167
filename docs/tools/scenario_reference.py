"""Write the page `docs/scenarios.md` from the schema.

``python -m docs.tools.scenario_reference`` writes it anew; a test compares it with the code.
"""

from inspect import signature
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Literal, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from ac_common.fault_profiles import PROFILE_KEYS, unit_profile
from ac_common.faults import FAULTS, UNKNOWN, Fault, Place
from ac_experiments.car_schema import CabinStart, Car, CurveWithin
from ac_experiments.drives import DURATION_S, FAMILY
from ac_experiments.scenario import built_in_scenarios, load
from ac_experiments.scenario_schema import (
    FAULT_MODELS,
    Air,
    Change,
    ControllerName,
    Noise,
    RamAir,
    References,
    Scenario,
    SensorChoice,
    TargetsWithin,
)
from ac_plant_node.inputs import INPUT, INPUTS

_PROFILE_DEFAULTS = {
    name: parameter.default
    for name, parameter in signature(unit_profile).parameters.items()
    if parameter.kind is parameter.KEYWORD_ONLY
}

PAGE = Path(__file__).parents[2] / "docs" / "scenarios.md"

#: Meaning of each key; a key of the schema that is missing here is an error.
MEANING = {
    "name": "what the run is called",
    "description": "one sentence for people",
    "operating_point": "where the run starts from; with `design: paper` also whose designs it uses",
    "duration_s": "simulated time",
    "sample_time_s": "sample time of the loop",
    "passive": "true: K0 alone, the compensator stays silent",
    "sensors": "which the designs use: 4: p_e, superheat, T_w and p_c; 3, 2: the first of these; a list: by name. "
    "The detector of `design: paper` has no use for p_c, K0's protection does; and without T_w K0 alone (`passive: "
    "true`)",
    "superheat_sensor": "direct: superheat is measured; derived: from an outlet thermocouple and the measured pressure",
    "air_flow_sensor": "what the observer of `design: envelope` is told of the air flow through the evaporator: none; "
    "blower: the flow that the blower is set to, which it takes for right within some per cent",
    "design": "envelope: one for all loads; paper: those of the operating point, after the paper. With a compressor on "
    "the belt there is only paper, and it is the default",
    "controller": "tracking: K0 holds both references; paper: K0 after the paper's passive case, which leaves SH "
    "alone; a class of yours: see [your own controller](how-to/own-controller.md)",
    "references": "references of the controller; its protection raises those below 175 kPa or 8 K to that value",
    "air": "the air at both heat exchangers",
    "car": "the car around the air conditioner; its air is a result then, and `air` must be left out",
    "outside_temperature_c": "outside air, which the condenser breathes",
    "outside_humidity_percent": "its relative humidity",
    "sun_w_m2": "sun on the car",
    "people": "people in the car",
    "recirculation_percent": "share of cabin air in what the evaporator breathes; the rest is outside air",
    "blower_kg_s": "dry air through the evaporator into the cabin",
    "vehicle_speed_km_h": "how the car moves: it makes ram air on the condenser, beside a fan, and the engine's speed",
    "cabin": "air and interior of the cabin at the start, degC; soaked: as after a long stand in the sun",
    "compressor_drive": "electric: K0 moves compressor and valve; belt: the engine turns the compressor, and a K0 of "
    "its own has the valve alone; needs `passive: true`, and there is no fault of the compressor's speed",
    "idle_rpm": "belt: slowest speed of the engine; above it turns with the wheels, in five gears",
    "pulley_ratio": "belt: compressor over engine speed",
    "faults": "a list of faults; the sum of those of one kind that overlap must stay within the limits of one",
    "noise": "the sensors' noise",
    "at_s": "when the change begins",
    "to": "where it ends, in the unit of the list's key",
    "ramp_s": "how long it takes, in a straight line; 0: a step",
    "evaporator_pressure_kpa": "evaporator pressure",
    "superheat_k": "superheat",
    "mass_flow_percent": "air mass flow, per cent of the operating point's",
    "inlet_temperature_k": "air inlet temperature",
    "condenser_mass_flow_percent": "air mass flow through the condenser, per cent of the operating point's",
    "condenser_inlet_temperature_k": "temperature of the air into the condenser",
    "humidity_percent": "relative humidity of the air into the evaporator, as it is; 0 to begin with",
    "drive_cycle": "a drive, whose ram air changes the air mass flow",
    "file": "vehicle speed over time: EPA's two columns, or CSV; the EPA publishes SC03 and others",
    "percent_at_top_speed": "ram air at the cycle's top speed; with the square of the speed below it",
    "condenser": "true: ram air by the vehicle's speed on the condenser too, beside a fan at its high stage",
    "wall_temperature_k": "wall temperature",
    "condenser_pressure_kpa": "condenser pressure",
    "kind": "which fault",
    "onset_s": "when it begins",
    "end_s": "when it goes away; left out: never",
    "profile": "how it grows",
    "rise_s": "ramp: time to full size",
    "period_s": "sine, intermittent: period",
    "time_constant_s": "drift: time constant; random_walk: time after which its standard deviation is the size",
    "duty_percent": "intermittent: share of the period in which it is there",
    "seed": "makes the random numbers repeatable",
}


def text() -> str:
    """Return the content of the page."""
    parts = [
        "# Scenarios",
        "",
        "<!-- Written by `python -m docs.tools.scenario_reference`; edit `ac_experiments/scenario_schema.py`. -->",
        "",
        "A scenario is a YAML file. Every quantity has its unit in its key; references and air are changes from the",
        "operating point, so one file serves all three. `acftc run FILE` and `acftc simulate FILE` take it, and `--set",
        "KEY=VALUE` changes one value: `--set faults.0.size_rpm=60`.",
        "",
        "```yaml",
        built_in_scenarios()["actuator_fault"].read_text(encoding="utf-8").rstrip(),
        "```",
        "",
        "## Built-in scenarios",
        "",
        "| name | duration | what happens |",
        "|---|---|---|",
    ]
    known = {name: load(name, whole=False) for name in built_in_scenarios()}
    parts += [f"| `{name}` | {item.duration_s:g} s | {item.description} |" for name, item in known.items()]
    parts.append(f"| `{FAMILY}:SEED` | {DURATION_S:g} s | A random drive over a moving load, such as `{FAMILY}:123`. |")
    sections: tuple[tuple[str, str, type[BaseModel]], ...] = (
        ("Top level", "", Scenario),
        ("references", "Lists of changes from the operating point, each a mapping as below.", References),
        ("air", "Lists of changes from the operating point; the humidity is no change but a value.", Air),
        ("air: drive cycle", "`{file: sc03.csv}`: a drive in place of changes of the air mass flows.", RamAir),
        ("car", _CAR, Car),
        ("A change", "`{at_s: 100, to: 5.0, ramp_s: 60}`", Change),
        *((f"faults: {fault.kind.replace('_', ' ')}", _remark(fault), FAULT_MODELS[fault.kind]) for fault in FAULTS),
        ("noise", "Standard deviations of Gaussian noise.", Noise),
    )
    for title, remark, model in sections:
        parts += ["", f"## {title}", ""] + ([remark, ""] if remark else [])
        parts += ["| key | allowed | default | meaning |", "|---|---|---|---|"]
        parts += [
            f"| `{key}` | {_allowed(field)} | {_default(key, field)} | {_meaning(key, model)} |"
            for key, field in model.model_fields.items()
        ]
    parts += ["", "## Profiles of a fault", "", "| profile | takes besides onset and end |", "|---|---|"]
    parts += [f"| `{name}` | {', '.join(f'`{key}`' for key in keys) or '–'} |" for name, keys in PROFILE_KEYS.items()]
    return "\n".join([*parts, ""])


_INLET = INPUTS[INPUT["air_inlet_temperature"]]
_CAR = f"""What is around an air conditioner in a car. Temperature and humidity of the air into the evaporator, the flow
through the condenser and the cabin follow from it ([the plant](plant.md#11-in-a-car)). A curve is a number, or a list
of points `[s, value]` that straight lines join: `vehicle_speed_km_h: [[0, 0], [10, 0], [20, 50]]`.
The evaporator breathes air of at least {_INLET.low:g} and at most {_INLET.high:g} degC: what is colder or
hotter acts as air of that temperature."""

_PLACES = {Place.ACTUATOR: "an actuator", Place.SENSOR: "a sensor", Place.PLANT: "the plant"}


def _remark(fault: Fault) -> str:
    """Return what the section of a kind of fault begins with."""
    remark = f"{fault.symbol}, a fault of {_PLACES[fault.place]}."
    return remark if fault.has_filter else f"{remark} No filter is for it: it is isolated as `{UNKNOWN}`, if at all."


def _meaning(key: str, model: type[BaseModel]) -> str:
    """Return what a key means; the size of a fault is said in the registry."""
    sizes: dict[type[BaseModel], tuple[str, str]] = {
        FAULT_MODELS[fault.kind]: (fault.size_key, fault.adds) for fault in FAULTS
    }
    size_key, adds = sizes.get(model, ("", ""))
    if model is Car and key == "drive_cycle":
        return "file of a drive in place of `vehicle_speed_km_h`: EPA's two columns, or CSV"
    return adds if key == size_key else MEANING[key]


def _allowed(field: FieldInfo) -> str:
    """Return the allowed values of a key: type, and range where there is one."""
    kind: Any = field.annotation
    options = [option for option in get_args(kind) if option is not NoneType]
    if isinstance(kind, UnionType) and len(options) == 1:
        kind = options[0]
    if get_origin(kind) is Literal:
        return ", ".join(f"`{value}`" for value in get_args(kind))
    for constraint in field.metadata:
        name = getattr(constraint, "func", None)
        if isinstance(name, ControllerName):
            return ", ".join([*(f"`{known}`" for known in name.names), name.otherwise])
        if isinstance(name, CurveWithin):
            return f"a curve, {name.lowest:g} to {name.highest:g}"
        if isinstance(name, CabinStart):
            return f"`soaked`, or a number, {name.lowest:g} to {name.highest:g}"
        if isinstance(name, SensorChoice):
            return f"`2`, `3`, `4`, or a list out of {', '.join(f'`{known}`' for known in name.names)}"
    if get_origin(kind) is list:
        return ", ".join(["a list", *_bounds(field)])
    names: dict[Any, str] = {float: "a number", int: "a whole number", bool: "true or false", str: "a text"}
    return ", ".join([names.get(kind, "a mapping"), *_bounds(field)])


def _bounds(field: FieldInfo) -> list[str]:
    signs = {"ge": "≥", "gt": ">", "le": "≤", "lt": "<"}
    found = []
    for constraint in field.metadata:
        if isinstance(getattr(constraint, "func", None), TargetsWithin):
            found.append(f"targets from {constraint.func.lowest:g} to {constraint.func.highest:g}")
        found += [f"{sign} {getattr(constraint, name):g}" for name, sign in signs.items() if hasattr(constraint, name)]
    return found


def _default(key: str, field: FieldInfo) -> str:
    if key == "name":
        return "the file's name"
    if field.is_required():
        return "required"
    if field.default is None and key in _PROFILE_DEFAULTS:
        return f"`{_PROFILE_DEFAULTS[key]:g}`, where the profile takes it"
    if field.default is None or isinstance(field.default, BaseModel | list) or field.default == "":
        return "none"
    return f"`{str(field.default).lower() if isinstance(field.default, bool) else field.default}`"


if __name__ == "__main__":
    PAGE.write_text(text(), encoding="utf-8")
