"""What a scenario file may hold: the schema, with what of it does not fit together.

In the file every quantity has its unit in its key (rpm, kPa, %, K); here and on the wire everything is SI. References
and the air side are given as changes from the operating point, so one scenario serves all three points.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import reduce
from operator import or_
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, Field, PlainValidator, create_model, model_validator

from ac_common.errors import UserError
from ac_common.fault_profiles import PROFILE_KEYS, PROFILES, SENSOR_PROFILES, STUCK, unit_profile
from ac_common.faults import BY_KIND, FAULTS, KINDS, Fault, Place
from ac_common.sample_time import DEFAULT_SAMPLE_TIME_S, LONGEST_SAMPLE_TIME_S, SHORTEST_SAMPLE_TIME_S
from ac_common.units import KPA
from ac_experiments.car_schema import Car
from ac_experiments.schema_part import Part, quoted, unknown

#: Shortest time that a profile may take, s: the shortest sample time.
SHORTEST_S = 0.01
#: By how much times that follow on each other may be off, s.
ROUNDING_S = 1e-9
#: Largest seed of random numbers: what a ROS parameter holds on every machine.
LARGEST_SEED = 2**31 - 1


class Change(Part):
    """At `at_s` the quantity starts to move from where it is to `to`, in a straight line that takes `ramp_s`."""

    at_s: float = Field(ge=0.0)
    to: float
    ramp_s: float = Field(default=0.0, ge=0.0)


@dataclass(frozen=True)
class TargetsWithin:
    """Limits the targets of a list of changes to [lowest, highest]."""

    lowest: float
    highest: float

    def __call__(self, changes: list[Change]) -> list[Change]:
        """Give `changes` back, or raise for the first target out of range."""
        for number, change in enumerate(changes):
            if not self.lowest <= change.to <= self.highest:
                msg = f"{number}.to: given {change.to:g}; allowed: {self.lowest:g} to {self.highest:g}"
                raise ValueError(msg)
        return changes


class References(Part):
    """References of the controller, as changes from the operating point."""

    evaporator_pressure_kpa: Annotated[list[Change], AfterValidator(TargetsWithin(-100.0, 150.0))] = Field(default=[])
    superheat_k: Annotated[list[Change], AfterValidator(TargetsWithin(-18.0, 30.0))] = Field(default=[])


Moves = list[dict[str, float]]


class RamAir(Part):
    """A drive: the faster the car, the more ram air on the evaporator, with the square of the speed.

    With `condenser` also on the condenser, beside a fan at its high stage, which alone makes the plant's usual flow.
    """

    file: str = Field(min_length=1)
    percent_at_top_speed: float = Field(default=10.0, ge=-90.0, le=300.0)
    condenser: bool = False

    def changes(self) -> dict[str, Moves]:
        """Return the drive as changes of the air flows, by key, one for each line of its file that changes something.

        Raises
        ------
        ValueError
            One line: what is wrong with the file, or where there is one.
        """
        from ac_plant_node.condenser_air import HIGH, condenser_air_flow
        from ac_plant_node.drive_cycle import load_drive_cycle

        cycle = load_drive_cycle(Path(self.file).expanduser())
        percent = self.percent_at_top_speed * (cycle.speed_m_s / max(float(cycle.speed_m_s.max()), 1e-9)) ** 2
        changes = {"mass_flow_percent": _moves_through(cycle.time_s, percent)}
        if self.condenser:
            at_rest = condenser_air_flow(0.0, HIGH)
            flow = np.array([condenser_air_flow(speed, HIGH) for speed in cycle.speed_m_s.tolist()])
            changes["condenser_mass_flow_percent"] = _moves_through(cycle.time_s, 100.0 * (flow / at_rest - 1.0))
        return changes


def _moves_through(time_s: NDArray[np.float64], targets: NDArray[np.float64]) -> Moves:
    """Return the changes that go through `targets`, (n,), at `time_s` in straight lines."""
    times, to = time_s.tolist(), targets.tolist()
    moves = [{"at_s": 0.0, "to": to[0]}] if to[0] else []
    for start_s, end_s, before, after in zip(times[:-1], times[1:], to[:-1], to[1:], strict=True):
        if after != before:
            moves.append({"at_s": start_s, "to": after, "ramp_s": end_s - start_s})
    return moves


#: What the condenser's air may change by: 0.1 to 1.5 kg/s of 0 to 50 degC at the shipped points' 0.55 kg/s of 30 degC,
#: which is what the plant takes.
_CONDENSER_FLOW, _CONDENSER_INLET = TargetsWithin(-80.0, 170.0), TargetsWithin(-30.0, 20.0)


class Air(Part):
    """Air at both heat exchangers: the humidity as it is, the others as changes from the operating point."""

    mass_flow_percent: Annotated[list[Change], AfterValidator(TargetsWithin(-90.0, 300.0))] = Field(default=[])
    inlet_temperature_k: Annotated[list[Change], AfterValidator(TargetsWithin(-30.0, 30.0))] = Field(default=[])
    condenser_mass_flow_percent: Annotated[list[Change], AfterValidator(_CONDENSER_FLOW)] = Field(default=[])
    condenser_inlet_temperature_k: Annotated[list[Change], AfterValidator(_CONDENSER_INLET)] = Field(default=[])
    humidity_percent: Annotated[list[Change], AfterValidator(TargetsWithin(0.0, 100.0))] = Field(default=[])
    drive_cycle: RamAir | None = None

    @model_validator(mode="after")
    def _one_air_flow(self) -> "Air":
        drive = self.drive_cycle
        doubled = "mass_flow_percent" if drive is not None and self.mass_flow_percent else ""
        if drive is not None and drive.condenser and self.condenser_mass_flow_percent:
            doubled = "condenser_mass_flow_percent"
        if doubled:
            msg = f"{doubled} and drive_cycle both say what the air flow does; give one of them"
            raise ValueError(msg)
        return self


def targets_within(part: type[Part], key: str) -> TargetsWithin:
    """Return the limits of the targets of one list of changes, such as `targets_within(References, "superheat_k")`."""
    limits = (getattr(constraint, "func", None) for constraint in part.model_fields[key].metadata)
    return next(limit for limit in limits if isinstance(limit, TargetsWithin))


class ScheduledFault(Part):
    """What all faults share: when, and how it grows. With its size, each kind has a model of its own."""

    onset_s: float = Field(ge=0.0)
    end_s: float | None = None
    profile: str = "step"
    rise_s: float | None = Field(default=None, ge=SHORTEST_S)
    period_s: float | None = Field(default=None, ge=SHORTEST_S)
    time_constant_s: float | None = Field(default=None, ge=SHORTEST_S)
    duty_percent: float | None = Field(default=None, gt=0.0, lt=100.0)
    seed: int | None = Field(default=None, ge=0, le=LARGEST_SEED)

    @model_validator(mode="before")
    @classmethod
    def _without_size(cls, given: Any) -> Any:
        """Spare a sensor that is stuck its size."""
        if isinstance(given, Mapping) and given.get("profile") == STUCK and given.get("kind") in KINDS:
            return {BY_KIND[given["kind"]].size_key: 0.0, **given}
        return given

    @model_validator(mode="after")
    def _consistent(self) -> "ScheduledFault":
        if self.profile == STUCK and self.size:
            msg = f"{self.fault.size_key} does not belong to the profile '{STUCK}': the reading stays what it is"
            raise ValueError(msg)
        if self.end_s is not None and self.end_s <= self.onset_s:
            msg = f"end_s {self.end_s:g} must come after onset_s {self.onset_s:g}"
            raise ValueError(msg)
        for key in ("rise_s", "period_s", "time_constant_s", "duty_percent", "seed"):
            if getattr(self, key) is not None and key not in PROFILE_KEYS[self.profile]:
                own = ", ".join(PROFILE_KEYS[self.profile]) or "no further key"
                msg = f"{key} does not belong to the profile {self.profile!r}, which takes {own}"
                raise ValueError(msg)
        return self

    @property
    def fault(self) -> Fault:
        """The fault that it is one of."""
        return BY_KIND[getattr(self, "kind")]  # noqa: B009

    @property
    def size(self) -> float:
        """Size in SI."""
        return float(getattr(self, self.fault.size_key)) * self.fault.si

    def over(self, time_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the fault over the ticks `time_s`, shape (K,), SI."""
        shape = {key: getattr(self, key) for key in PROFILE_KEYS[self.profile] if getattr(self, key) is not None}
        if self.profile == STUCK:
            return np.zeros_like(time_s)
        return self.size * unit_profile(time_s, self.profile, self.onset_s, self.end_s, **shape)

    def stuck(self, time_s: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return whether it makes its reading stand still at the ticks `time_s`, shape (K,)."""
        ends = np.inf if self.end_s is None else self.end_s
        return (self.profile == STUCK) & (time_s >= self.onset_s) & (time_s < ends)


def _model_of(fault: Fault) -> type[ScheduledFault]:
    """Return the part of a scenario file that describes a fault of this kind."""
    default = ... if fault.default is None else fault.default
    size = (float, Field(default=default, ge=fault.lowest, le=fault.largest))
    profiles = SENSOR_PROFILES if fault.can_stick else PROFILES
    fields: dict[str, Any] = {
        "kind": (Literal[fault.kind], ...),
        fault.size_key: size,
        "profile": (Literal[profiles], "step"),
    }
    return create_model(fault.kind, __base__=ScheduledFault, **fields)


#: The part of a scenario file for each kind of fault.
FAULT_MODELS: dict[str, type[ScheduledFault]] = {fault.kind: _model_of(fault) for fault in FAULTS}
if TYPE_CHECKING:
    AnyFault = ScheduledFault
else:
    AnyFault = Annotated[reduce(or_, FAULT_MODELS.values()), Field(discriminator="kind")]


class Noise(Part):
    """Gaussian sensor noise: standard deviations, and the seed that makes a run repeatable."""

    evaporator_pressure_kpa: float = Field(default=0.0, ge=0.0, le=50.0)
    superheat_k: float = Field(default=0.0, ge=0.0, le=20.0)
    wall_temperature_k: float = Field(default=0.0, ge=0.0, le=20.0)
    condenser_pressure_kpa: float = Field(default=0.0, ge=0.0, le=50.0)
    seed: int = Field(default=0, ge=0, le=LARGEST_SEED)

    @property
    def std(self) -> NDArray[np.float64]:
        """Standard deviations of (p_e, SH, T_w, p_c) in (Pa, K, K, Pa)."""
        pressures = self.evaporator_pressure_kpa * KPA, self.condenser_pressure_kpa * KPA
        return np.array([pressures[0], self.superheat_k, self.wall_temperature_k, pressures[1]])


#: Which K0: how its weights are called.
K0_WEIGHTS = ("tracking", "paper")
_PYTHON_PATH = re.compile(r"[^\W\d]\w*(\.[^\W\d]\w*)+")


@dataclass(frozen=True)
class ControllerName:
    """Allows the names of our K0 and the Python path of a class of the user's."""

    names: tuple[str, ...] = K0_WEIGHTS
    otherwise: str = "the Python path of a class of yours (`my_module.MyPi`)"

    def __call__(self, given: str) -> str:
        """Give `given` back, or raise when it is neither."""
        if given in self.names or _PYTHON_PATH.fullmatch(given):
            return given
        msg = f"{unknown('controller', given, list(self.names))}, or {self.otherwise}"
        raise ValueError(msg)


#: Sensors by the names that a scenario calls them; the first two are always there.
SENSORS = ("p_e", "superheat", "T_w", "p_c")


@dataclass(frozen=True)
class SensorChoice:
    """Allows the number of sensors that the designs use, from the first on, or a list of the sensors there are."""

    names: tuple[str, ...] = SENSORS

    def __call__(self, given: Any) -> int | list[str]:
        """Give `given` back, or raise when it is neither."""
        if type(given) is int and given in (2, 3, 4):
            return given
        if not isinstance(given, list):
            msg = f"given {quoted(given)}; allowed: 2, 3, 4 or a list out of {', '.join(self.names)}"
            raise ValueError(msg)
        for name in given:
            if name not in self.names:
                raise ValueError(unknown("sensor", name, list(self.names)))
        for name in self.names[:2]:
            if name not in given:
                msg = f"{quoted(given)} lacks {name}, which K0 controls"
                raise ValueError(msg)
        if len(set(given)) < len(given):
            msg = f"{quoted(given)} names a sensor twice"
            raise ValueError(msg)
        return given


class Scenario(Part):
    """A whole run. See `docs/` and the files in `ac_experiments/scenarios/` for examples."""

    name: str = Field(pattern=r"^[A-Za-z0-9_-]+$")
    description: str = ""
    operating_point: Literal["low", "med", "high"] = "med"
    duration_s: float = Field(gt=0.0, le=86400.0)
    sample_time_s: float = Field(default=DEFAULT_SAMPLE_TIME_S, ge=SHORTEST_SAMPLE_TIME_S, le=LONGEST_SAMPLE_TIME_S)
    passive: bool = False
    sensors: Annotated[int | list[str], PlainValidator(SensorChoice())] = 4
    superheat_sensor: Literal["direct", "derived"] = "direct"
    air_flow_sensor: Literal["none", "blower"] = "none"
    design: Literal["paper", "envelope"] = "envelope"
    controller: Annotated[str, AfterValidator(ControllerName())] = "tracking"
    references: References = References()
    air: Air = Air()
    car: Car | None = None
    faults: list[AnyFault] = Field(default=[])
    noise: Noise = Noise()

    @model_validator(mode="before")
    @classmethod
    def _design_for_a_belt(cls, given: Any) -> Any:
        """Take the one design there is with a compressor on the belt, where the scenario says nothing of it."""
        car = given.get("car") if isinstance(given, Mapping) else None
        is_belt = isinstance(car, Mapping) and car.get("compressor_drive") == "belt"
        return {"design": "paper", **given} if is_belt else given

    @model_validator(mode="after")
    def _within_the_run(self) -> "Scenario":
        for number, fault in enumerate(self.faults):
            if fault.onset_s >= self.duration_s:
                msg = f"faults.{number}.onset_s {fault.onset_s:g} must come before the end at {self.duration_s:g} s"
                raise ValueError(msg)
        for part in (self.references, self.air):
            for key in (name for name in type(part).model_fields if name != "drive_cycle"):
                for before, after in zip(getattr(part, key)[:-1], getattr(part, key)[1:], strict=True):
                    if after.at_s < before.at_s + before.ramp_s - ROUNDING_S:
                        msg = (
                            f"{key}: the change at {after.at_s:g} s starts before the one at {before.at_s:g} s is over"
                        )
                        raise ValueError(msg)
        return self

    @model_validator(mode="after")
    def _faults_together(self) -> "Scenario":
        for kind in FAULTS:
            moves = []
            for fault in self.faults:
                if fault.fault is kind:
                    moves.append((fault.onset_s, abs(fault.size)))
                    moves.append((self.duration_s if fault.end_s is None else fault.end_s, -abs(fault.size)))
            together = 0.0
            for at_s, more in sorted(moves):
                together += more
                if together > kind.largest_si * (1.0 + 1e-9):
                    msg = (
                        f"faults: those of {kind.kind} are {together / kind.si:g} {kind.unit} together at {at_s:g} s; "
                        f"allowed: {kind.largest_si / kind.si:g} {kind.unit}"
                    )
                    raise ValueError(msg)
        return self

    @model_validator(mode="after")
    def _car_fits(self) -> "Scenario":
        if self.car is not None and self.air != Air():
            msg = "air and car both say what the air does; give one of them"
            raise ValueError(msg)
        if self.car is None or not self.car.has_belt:
            return self
        if self.design == "envelope":
            msg = "design: envelope moves the compressor; car.compressor_drive: belt needs design: paper"
            raise ValueError(msg)
        if self.references.evaporator_pressure_kpa:
            msg = "references.evaporator_pressure_kpa does nothing with car.compressor_drive: belt, where the valve "
            raise ValueError(msg + "alone holds the superheat, and the evaporator pressure follows the engine's speed")
        if self.controller == "paper":
            msg = "controller: paper moves the compressor, which with car.compressor_drive: belt only the engine does"
            raise ValueError(msg)
        for number, fault in enumerate(self.faults):
            if fault.fault.place is Place.ACTUATOR:
                msg = f"faults.{number}: there is no {fault.fault.kind} fault with car.compressor_drive: belt"
                raise ValueError(msg + ", where the compressor turns as the engine makes it")
        return self

    @model_validator(mode="after")
    def _controller_fits(self) -> "Scenario":
        if self.design == "envelope" and self.controller == "paper":
            msg = "controller: paper needs design: paper; design: envelope has one K0 of its own"
            raise ValueError(msg)
        return self

    @model_validator(mode="after")
    def _observer_fits(self) -> "Scenario":
        if self.design == "paper" and self.air_flow_sensor != "none":
            msg = f"air_flow_sensor: {self.air_flow_sensor} needs design: envelope; the paper's detector is told no "
            raise ValueError(msg + "air flow")
        return self

    @model_validator(mode="after")
    def _compensator_fits(self) -> "Scenario":
        self.is_passive()
        return self

    def is_passive(self, instead: bool | None = None) -> bool:
        """Whether K0 is alone: as the scenario says, or as said here instead.

        Raises
        ------
        UserError
            When the compensator is to act with two sensors, or with a compressor on the belt.
        """
        passive = self.passive if instead is None else instead
        if self.design == "paper" and self.design_sensors == 2 and not passive:
            msg = f"sensors: {self.sensors} needs passive: true, since the compensators are designed for three sensors"
            raise UserError(msg)
        if self.has_belt and not passive:
            msg = "car.compressor_drive: belt needs passive: true, since the compensators move the compressor, too"
            raise UserError(msg)
        return passive

    @property
    def has_belt(self) -> bool:
        """Whether an engine turns the compressor."""
        return self.car is not None and self.car.has_belt

    @property
    def measures_head(self) -> bool:
        """Whether the condenser pressure is among the sensors."""
        return "p_c" in self.envelope_sensors

    @property
    def envelope_sensors(self) -> tuple[str, ...]:
        """The sensors that the envelope's design uses."""
        return tuple(self.sensors) if isinstance(self.sensors, list) else SENSORS[: self.sensors]

    @property
    def design_sensors(self) -> int:
        """How many sensors the paper's designs use: 3, or 2 without the wall thermocouple; they have no use for p_c."""
        return 3 if "T_w" in self.envelope_sensors else 2

    @property
    def controller_class(self) -> str:
        """Python path of the user's controller; empty: K0."""
        return "" if self.controller in K0_WEIGHTS else self.controller

    @property
    def controller_weights(self) -> str:
        """Which K0 the designs are for: limits and compensator of a controller of the user's are those of tracking."""
        if self.has_belt:
            return "belt"
        return self.controller if self.controller in K0_WEIGHTS else "tracking"

    @property
    def ticks(self) -> int:
        """Number of ticks K; tick k is at ``k * sample_time_s``, so the last one is one sample before the end."""
        return max(1, round(self.duration_s / self.sample_time_s))

    @property
    def tick_ns(self) -> int:
        """Sample time in whole nanoseconds, the unit of a ROS stamp."""
        return round(self.sample_time_s * 1e9)
