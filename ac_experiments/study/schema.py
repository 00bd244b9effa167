"""What a study file may hold: the scenario, what of it varies and how it is drawn, how many runs."""

import math
from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, PlainValidator, ValidationError, model_validator

from ac_common.cache import fingerprint
from ac_common.errors import UserError
from ac_common.faults import KINDS
from ac_common.yaml_file import parsed, text_of, yaml_text
from ac_experiments.drives import FAMILY
from ac_experiments.scenario import complaint, load, setting
from ac_experiments.scenario_schema import LARGEST_SEED, ScheduledFault
from ac_experiments.schema_part import Part, quoted, unknown
from ac_experiments.study.distributions import Distribution, distribution

BUILT_IN = Path(__file__).parents[1] / "studies"
#: In place of a kind of fault: there is none.
NO_FAULT = "none"
FAULT, PLANT = "fault", "plant"
#: What may be said of the fault that a study adds to its scenario; the rest is as in a scenario file.
FAULT_KEYS = ("kind", "size", "typical", "sign", *ScheduledFault.model_fields)
SAMPLINGS = ("random", "latin_hypercube", "sobol", "saltelli")


def _scenario_or_name(given: Any) -> Any:
    """Return the name, the path or the content of the scenario that is varied."""
    if isinstance(given, str | Mapping) and given:
        return given
    msg = f"given {quoted(given)}; must be {FAMILY}, a built-in scenario, a path, or a scenario's keys"
    raise ValueError(msg)


def _described(given: Any) -> Any:
    """Check what varies, and leave it as the file has it."""
    if not isinstance(given, Mapping):
        msg = f"given {quoted(given)}; must be keys with distributions"
        raise ValueError(msg)
    for key, one in given.items():
        try:
            distribution(one)
            check_key(key)
        except ValueError as problem:
            msg = f"{key}: {problem}"
            raise ValueError(msg) from None
    return dict(given)


def _fixed(given: Any) -> Any:
    if not isinstance(given, Mapping):
        msg = f"given {quoted(given)}; must be keys with values"
        raise ValueError(msg)
    for key in given:
        check_key(key)
    return dict(given)


def check_key(key: Any) -> None:
    """Refuse a key of the study's own that there is not; those of the scenario are checked by its schema.

    Raises
    ------
    ValueError
        One line.
    """
    if not isinstance(key, str) or not key:
        msg = f"given the key {quoted(key)}; must be a text"
        raise ValueError(msg)
    top, _, rest = key.partition(".")
    if top == FAULT and rest and rest not in FAULT_KEYS:
        raise ValueError(unknown("key of the fault", rest, list(FAULT_KEYS)))
    if top == PLANT and rest and rest not in _sigmas():
        raise ValueError(unknown("plant parameter", rest, list(_sigmas())))


def _sigmas() -> dict[str, float]:
    from ac_experiments.study.plants import SIGMAS  # stands on the observer, which takes a while to load

    return SIGMAS


class Study(Part):
    """A study. See `ac_experiments/studies/` for examples, docs/studies.md for what the keys mean."""

    name: str = Field(pattern=r"^[A-Za-z0-9_-]+$")
    description: str = ""
    scenario: Annotated[Any, PlainValidator(_scenario_or_name)] = FAMILY
    set: Annotated[dict[str, Any], PlainValidator(_fixed)] = Field(default={})
    vary: Annotated[dict[str, Any], PlainValidator(_described)] = Field(default={})
    runs: int = Field(default=100, ge=1, le=10_000_000)
    seed: int = Field(default=0, ge=0, le=LARGEST_SEED // 2)
    sampling: Literal["random", "latin_hypercube", "sobol", "saltelli"] = "random"
    k0_alone: bool = False
    fault_free: bool = False

    @model_validator(mode="after")
    def _fits(self) -> "Study":
        both = sorted({*self.set} & {*self.vary})
        if both:
            msg = f"{both[0]} is both set and varied; give one of them"
            raise ValueError(msg)
        if self.is_family and self.seed + self.runs > LARGEST_SEED:
            msg = f"seed {self.seed} and {self.runs} runs: the last drive's seed is too large; allowed: {LARGEST_SEED}"
            raise ValueError(msg)
        if self.sampling == "saltelli":
            self._check_saltelli()
        return self

    def _check_saltelli(self) -> None:
        if self.grids or not self.drawn:
            msg = "sampling: saltelli needs something that varies, and no grid"
            raise ValueError(msg)
        block = len(self.drawn) + 2
        base = self.runs // block
        if base * block != self.runs or base & (base - 1) or base < 2:
            near = 2 ** max(1, round(math.log2(max(self.runs / block, 2))))
            msg = f"runs {self.runs}: saltelli needs a power of two times {block} (what varies, and 2), such as "
            raise ValueError(msg + str(near * block))

    @property
    def is_family(self) -> bool:
        """Whether run after run is another drive of the random family."""
        return isinstance(self.scenario, str) and self.scenario == FAMILY

    @cached_property
    def distributions(self) -> dict[str, Distribution]:
        """What varies, by key; `plant` stands for each parameter that may be off, drawn by itself."""
        found: dict[str, Distribution] = {}
        for key, given in self.vary.items():
            names = [f"{PLANT}.{name}" for name in _sigmas()] if key == PLANT else [key]
            found |= dict.fromkeys(names, distribution(given))
        return found

    @cached_property
    def grids(self) -> dict[str, Distribution]:
        """What of it is gone through."""
        return {key: one for key, one in self.distributions.items() if one.is_grid}

    @cached_property
    def drawn(self) -> dict[str, Distribution]:
        """What of it is drawn."""
        return {key: one for key, one in self.distributions.items() if not one.is_grid}

    @property
    def cells(self) -> int:
        """Number of combinations of the grids: run i is in number i modulo this."""
        return math.prod(len(one.values) for one in self.grids.values())

    @cached_property
    def identity(self) -> str:
        """Hash of all that it says."""
        return fingerprint(self.model_dump(mode="json"))


def built_in_studies() -> dict[str, Path]:
    """Return the names of the built-in studies and where they are, in alphabetical order."""
    return {path.stem: path for path in sorted(BUILT_IN.glob("*.yaml"))}


def load_study(
    name_or_path: str | Path, changes: Mapping[str, Any] | None = None, settings: Sequence[str] = ()
) -> Study:
    """Read a study by built-in name or by path, check it, and put its scenario into it: then it says all.

    Parameters
    ----------
    name_or_path
        A built-in name (``small_faults``), or the path of a YAML file.
    changes
        Keys to replace, for instance ``{"runs": 20}``.
    settings
        ``KEY=VALUE`` of what is to be the same in all runs, beside the file's `set`.

    Raises
    ------
    UserError
        One line naming the file, the key, what was given and what is allowed.
    """
    known, text = built_in_studies(), str(name_or_path)
    path = known.get(text, Path(text))
    if text not in known and path.suffix not in (".yaml", ".yml") and not path.exists():
        raise UserError(unknown("study", text, list(known)) + ", or the path of a YAML file")
    content = parsed(text_of(path), f"{path}: not valid YAML")
    if not isinstance(content, dict):
        msg = f"{path}: must hold keys and values such as 'runs: 200'"
        raise UserError(msg)
    content.setdefault("name", path.stem)
    content |= changes or {}
    same = dict(setting(text)[:2] for text in settings)
    if same and isinstance(content.get("set", {}), dict):  # what is none is complained of below
        content["set"] = {**content.get("set", {}), **same}
    study = check_study(content, f"{path.name} with --set" if settings else str(path))
    if study.is_family or isinstance(study.scenario, Mapping):
        return study
    beside = path.parent / study.scenario
    scenario = load(beside if beside.suffix in (".yaml", ".yml") and beside.exists() else study.scenario)
    return study.model_copy(update={"scenario": scenario.model_dump(mode="json", exclude_defaults=True)})


def check_study(content: Mapping[str, Any], source: str = "study") -> Study:
    """Check a mapping against the schema of studies; raises `UserError` as `load_study` does."""
    try:
        study = Study.model_validate(dict(content))
    except ValidationError as error:
        raise UserError(complaint(error, source)) from None
    named = [*_kinds_in(study.set.get("fault.kind")), *_kinds_of(study.distributions.get("fault.kind"))]
    for kind in named:
        if kind not in (*KINDS, NO_FAULT):
            raise UserError(f"{source}: fault.kind: {unknown('kind', kind, [NO_FAULT, *KINDS])}")
    return study


def _kinds_in(given: Any) -> list[Any]:
    return [] if given is None else [given]


def _kinds_of(given: Distribution | None) -> list[Any]:
    return [] if given is None else list(given.values)


def study_yaml(study: Study) -> str:
    """Return a study as a YAML text that `load_study` reads back to an equal one."""
    return yaml_text(study.model_dump(mode="json", exclude_defaults=True))
