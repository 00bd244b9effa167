"""Numbers that the paper's prose gives for its experiments: the only place that holds them.

"Fault Tolerant Control of Automotive Air Conditioning Systems using a GIMC Structure". Signs: a pressure error is
actual minus reference, so a sensor that reads 5 kPa too high pulls the actual pressure 5 kPa down.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class PaperFigures:
    """What the paper says of one accommodation experiment; keys are those of ``metrics`` in the summary."""

    experiment: str
    passive: Mapping[str, float]
    active: Mapping[str, float]
    remark: str


ACCOMMODATION: dict[str, PaperFigures] = {
    "actuator_fault": PaperFigures(
        experiment="E5",
        passive={"command_change_rpm": -20.0},
        active={"command_change_rpm": -40.0, "steady_pressure_error_kpa": 0.0},
        remark=(
            "The paper's passive controller takes back only half of the 40 rpm: its K0 holds p_e and leaves SH alone "
            "(controller: paper in a scenario). The tracking K0 holds both references and brings the passive loop to "
            "rest at about -40 rpm as well; what accommodation buys there is the transient of the evaporator pressure. "
            "acftc reproduce shows both."
        ),
    ),
    "sensor_fault": PaperFigures(
        experiment="E6",
        passive={"command_change_rpm": 50.0, "steady_pressure_error_kpa": -5.0},
        active={"command_change_rpm": 10.0, "steady_pressure_error_kpa": -1.0},
        remark=(
            "Passive control trusts the faulty reading and drives the actual pressure away by the size of the fault. "
            "The paper's compensator takes back 80 % of that."
        ),
    ),
}


def figures_for(scenario: Mapping[str, Any]) -> PaperFigures | None:
    """Give the paper's numbers for a scenario (as a plain dict), None when it is not one of the paper's experiments.

    A changed fault or operating point makes the comparison void, so the whole scenario but its noise and the controller
    must be the built-in one.
    """
    from ac_experiments.scenario import built_in_scenarios, load

    name = scenario.get("name")
    if name not in ACCOMMODATION or name not in built_in_scenarios():
        return None
    own = load(name).model_dump(mode="json")
    same = all(
        scenario.get(key) == own[key] for key in ("operating_point", "references", "air", "faults", "duration_s")
    )
    return ACCOMMODATION[name] if same else None
