"""What a scenario file may say of the car around the air conditioner."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PlainValidator, model_validator

from ac_common.units import RPM
from ac_experiments.schema_part import Part, quoted
from ac_plant_node.drive_cycle import Driveline, fastest_belt_speed, load_drive_cycle
from ac_plant_node.inputs import INPUT, INPUT_HIGH


@dataclass(frozen=True)
class CabinStart:
    """Allows the cabin's temperature at the start, degC, or "soaked"."""

    lowest: float = 0.0
    highest: float = 70.0

    def __call__(self, given: Any) -> float | str:
        """Return `given`, or raise when it is neither."""
        if given == "soaked":
            return "soaked"
        if type(given) in (int, float) and self.lowest <= given <= self.highest:
            return float(given)
        msg = f"given {quoted(given)}; allowed: soaked, or {self.lowest:g} to {self.highest:g} (degC)"
        raise ValueError(msg)


@dataclass(frozen=True)
class CurveWithin:
    """Allows a number, or points [s, value] that straight lines join; all values within [lowest, highest]."""

    lowest: float
    highest: float

    _MUST: ClassVar[str] = "must be a number, or a list of points [s, value]"

    def __call__(self, given: Any) -> float | list[list[float]]:
        """Return `given` in floats, or raise for what is no curve, or out of range."""
        points = given if isinstance(given, list) else [[0.0, given]]
        last_s = -np.inf
        for point in points:
            match point:
                case [int() | float() as at_s, int() | float() as value]:
                    pass
                case _:
                    msg = f"given {quoted(point if isinstance(given, list) else given)}; {self._MUST}"
                    raise ValueError(msg)
            if not self.lowest <= value <= self.highest:
                msg = f"given {value:g}; allowed: {self.lowest:g} to {self.highest:g}"
                raise ValueError(msg)
            if not last_s < at_s < np.inf:
                msg = f"the point at {at_s:g} s does not come after the one before"
                raise ValueError(msg)
            last_s = at_s
        if not points:
            msg = f"given []; {self._MUST}"
            raise ValueError(msg)
        return [[float(at_s), float(value)] for at_s, value in given] if isinstance(given, list) else float(given)


def over_time(curve: float | list[list[float]], time_s: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a curve at these times; before its first point and after its last it stays."""
    points = _points(curve)
    return np.interp(time_s, points[:, 0], points[:, 1])


def _points(curve: float | list[list[float]]) -> NDArray[np.float64]:
    return np.array(curve if isinstance(curve, list) else [[0.0, curve]], dtype=np.float64)


Curve = float | list[list[float]]


class Car(Part):
    """The car around the air conditioner: then its air is a result, and `air` has nothing to say."""

    outside_temperature_c: Annotated[Curve, PlainValidator(CurveWithin(0.0, 50.0))] = 30.0
    outside_humidity_percent: Annotated[Curve, PlainValidator(CurveWithin(0.0, 100.0))] = 40.0
    sun_w_m2: Annotated[Curve, PlainValidator(CurveWithin(0.0, 1400.0))] = 0.0
    people: Annotated[Curve, PlainValidator(CurveWithin(0.0, 9.0))] = 1.0
    recirculation_percent: Annotated[Curve, PlainValidator(CurveWithin(0.0, 100.0))] = 100.0
    blower_kg_s: Annotated[Curve, PlainValidator(CurveWithin(0.02, 0.3))] = 0.13
    vehicle_speed_km_h: Annotated[Curve, PlainValidator(CurveWithin(0.0, 250.0))] = 0.0
    drive_cycle: str | None = Field(default=None, min_length=1)
    cabin: Annotated[float | Literal["soaked"], PlainValidator(CabinStart())] = "soaked"
    compressor_drive: Literal["electric", "belt"] = "electric"
    idle_rpm: float = Field(default=Driveline.idle_rpm, ge=400.0, le=1500.0)
    pulley_ratio: float = Field(default=Driveline.pulley_ratio, ge=0.5, le=3.0)

    @model_validator(mode="after")
    def _one_drive(self) -> "Car":
        if self.drive_cycle is not None and self.vehicle_speed_km_h != 0.0:
            msg = "drive_cycle and vehicle_speed_km_h both say how the car moves; give one of them"
            raise ValueError(msg)
        return self

    @model_validator(mode="after")
    def _belt_within_the_plant(self) -> "Car":
        if not self.has_belt:
            return self
        # Straight lines join the points, so every speed between the lowest and the highest of them is passed.
        speeds_m_s = _points(self.vehicle_speed_km_h)[:, 1] / 3.6
        fastest = fastest_belt_speed(speeds_m_s.min(), speeds_m_s.max(), self.driveline)
        allowed = INPUT_HIGH[INPUT["compressor_speed"]]
        if fastest > allowed:
            msg = (
                f"the belt turns the compressor at {math.ceil(fastest / RPM)} rpm; allowed: {allowed / RPM:.0f}; "
                "lower pulley_ratio or the vehicle's speed"
            )
            raise ValueError(msg)
        return self

    @property
    def driveline(self) -> Driveline:
        """Engine, gears and pulley."""
        return Driveline(idle_rpm=self.idle_rpm, pulley_ratio=self.pulley_ratio)

    @property
    def has_belt(self) -> bool:
        """Whether the engine turns the compressor."""
        return self.compressor_drive == "belt"

    def points(self) -> list[list[float]]:
        """Return the drive cycle as points of `vehicle_speed_km_h`.

        Raises
        ------
        ValueError
            One line: what is wrong with the file, or where there is one.
        """
        cycle = load_drive_cycle(Path(self.drive_cycle or "").expanduser())
        return np.column_stack([cycle.time_s, 3.6 * cycle.speed_m_s]).tolist()  # type: ignore[no-any-return]
