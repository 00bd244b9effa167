"""Run i of a study as a scenario, and the plant that it meets."""

import copy
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from ac_common.errors import UserError
from ac_common.faults import BY_KIND
from ac_experiments.drives import drive
from ac_experiments.scenario import check, load, put_value
from ac_experiments.scenario_schema import Scenario
from ac_experiments.study.plants import SIGMAS, plant_off_by
from ac_experiments.study.sampling import Sampler
from ac_experiments.study.schema import FAULT, NO_FAULT, PLANT, Study
from ac_plant_node.parameters.values import Parameters

#: How many runs are looked at before any begins.
LOOKED_AT = 5


@dataclass(frozen=True)
class Case:
    """A run of a study.

    Attributes
    ----------
    run : int
    drawn : dict
        What varies, by key.
    scenario : Scenario
    parameters : Parameters or None
        The plant, where it is not the one in use.
    drive : int or None
        Seed of the drive, where the scenario is of the random family.
    """

    run: int
    drawn: Mapping[str, Any]
    scenario: Scenario
    parameters: Parameters | None
    drive: int | None


class Cases:
    """The runs of a study as cases.

    Parameters
    ----------
    study : Study
        As `load_study` gives it.
    """

    def __init__(self, study: Study) -> None:
        self.study = study
        self.sampler = Sampler(study)

    @cached_property
    def _base(self) -> dict[str, Any]:
        """The scenario that is varied, with all its keys; none of the random family, where each run has its own."""
        given = self.study.scenario
        scenario = load(given) if isinstance(given, str) else check({"name": self.study.name, **given})
        return scenario.model_dump(mode="json")

    def __getitem__(self, run: int) -> Case:
        return self.with_values(run, self.sampler.values(run))

    def with_values(self, run: int, drawn: Mapping[str, Any]) -> Case:
        """Return the case of a run with other values of what varies.

        Raises
        ------
        UserError
            One line: the run, and what of its scenario cannot be.
        """
        study, sampler = self.study, self.sampler
        seed = sampler.drive(run) if study.is_family else None
        content = copy.deepcopy(self._base) if seed is None else drive(seed)
        fault: dict[str, Any] = {}
        plant: dict[str, float] = {}
        seeded = seed is not None
        where = f"study {study.name}, run {run}"
        for key, value in {**study.set, **drawn}.items():
            top, _, rest = key.partition(".")
            if top == FAULT:
                fault.update({rest: value} if rest else _whole_fault(value, where))
            elif top == PLANT:
                plant.update(dict.fromkeys(SIGMAS, value) if not rest else {rest: value})
            else:
                put_value(content, key, copy.deepcopy(value), f"{where}: {key}")
                seeded |= key in ("noise.seed", "noise")
        if not seeded:
            put_value(content, "noise.seed", sampler.noise_seed(run), where)
        content["name"] = f"{study.name}-{run}"
        content["description"] = f"Run {run} of the study {study.name}."
        if fault and fault.get("kind") != NO_FAULT:
            content["faults"] = [*(content.get("faults") or []), _fault(fault, where)]
        if isinstance(content.get("duration_s"), int | float):
            cut(content, float(content["duration_s"]))
        return Case(run, drawn, check(content, where), plant_off_by(plant), seed)

    def look(self) -> None:
        """See that the first runs, and those at either bound of each value that varies, are scenarios that can be.

        Raises
        ------
        UserError
            One line about the first that is none.
        """
        usual = self.sampler.values(0)
        for key, one in self.study.distributions.items():
            for value in one.bounds:
                self.with_values(0, {**usual, key: value})
        for run in range(min(LOOKED_AT, self.study.runs)):
            self[run]


def cut(content: dict[str, Any], duration_s: float) -> None:
    """Leave out of a drive what begins after its end: a family of 1500 s serves shorter runs, too."""
    for part in ("references", "air"):
        for key, changes in (content.get(part) or {}).items():
            if isinstance(changes, list):
                content[part][key] = [one for one in changes if not _after(one, duration_s)]


def _after(change: Any, duration_s: float) -> bool:
    return isinstance(change, Mapping) and isinstance(change.get("at_s"), int | float) and change["at_s"] >= duration_s


def _whole_fault(value: Any, where: str) -> dict[str, Any]:
    """Return the keys of a fault that one value describes: a mapping, a kind, or none."""
    if isinstance(value, Mapping):
        return dict(value)
    if isinstance(value, str):
        return {"kind": value}
    msg = f"{where}: fault: must be a kind, {NO_FAULT}, or keys such as {{kind: compressor_speed, size: 40}}"
    raise UserError(msg)


def _fault(given: Mapping[str, Any], where: str) -> dict[str, Any]:
    """Return a fault as a scenario file has it."""
    fault = {key: value for key, value in given.items() if key not in ("size", "typical", "sign")}
    registered = BY_KIND.get(str(fault.get("kind")))
    if registered is None:
        return fault  # the scenario's schema says what is wrong with it
    fault.setdefault("onset_s", 0.0)
    size = given.get("size")
    if "typical" in given:
        if size is not None:
            msg = f"{where}: fault.size and fault.typical both say how large it is; give one of them"
            raise UserError(msg)
        size = float(given["typical"]) * registered.typical
    if size is not None:
        sign = 1.0 if registered.is_loss else float(given.get("sign", 1.0))
        fault[registered.size_key] = sign * float(size)
    return fault
