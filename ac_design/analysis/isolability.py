"""Which faults can be told apart at all: ``python -m ac_design.analysis.isolability`` prints docs/faults.md's tables.

A filter sees ``y = G_u u + G_d d + G_f f`` with the command u known. A fault whose column ``g_f`` lies, at every
frequency, in what the unknown disturbances d and another fault span can be explained by them, whatever f does over
time: then no filter on these readings tells the two apart. Both faults are taken as unknown functions of time. With
columns over the rational functions this is the rank condition

    rank [G_d g_other g_f] > rank [G_d g_other]

(Chen & Patton, Robust Model-Based Fault Diagnosis for Dynamic Systems, Kluwer 1999, ch. 2; for isolability of one fault
from another Frisk, Krysander & Aslund, Automatica 45 (2009) 364). Rank alone is yes or no, so the distance is given as
well: the share of the fault's effect that is left when d and the other fault explain as much as they can.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import control
import numpy as np
from numpy.typing import NDArray

from ac_common.faults import FAULTS, Place
from ac_common.units import KPA
from ac_plant_node import POINTS, linearize

Columns = NDArray[np.complex128]
Matrix = NDArray[np.float64]

READINGS = {"evaporator_pressure": KPA, "superheat": 1.0, "wall_temperature": 1.0, "condenser_pressure": 10.0 * KPA}
"""Readings, and how much of each counts as much as of the others: 1 kPa, 1 K, 1 K, 10 kPa."""

PLANT_FAULTS = {
    "compressor_speed": "compressor_speed",
    "valve_offset": "valve_opening",
    "valve_stuck": "valve_opening",
    "valve_slow": "valve_opening",
    "compressor_displacement": "compressor_displacement",
    "isentropic_efficiency": "isentropic_efficiency",
    "refrigerant_leak": "refrigerant_leak",
    "condenser_fouling": "condenser_fouling",
    "condenser_fan": "condenser_fan",
    "evaporator_fouling": "evaporator_fouling",
}
"""Faults of actuators and components, and the input of the linear plant through which each acts.

A valve that is stuck or slow is the offset that its command and its opening are apart."""

_SENSORS = {fault.kind: fault.signal for fault in FAULTS if fault.place is Place.SENSOR}
SENSOR_FAULTS = {kind: reading for kind, reading in _SENSORS.items() if reading in READINGS}
"""Faults of sensors, and their readings. Bias, drift, noise and a reading that stands still are one column."""
AIR_FAULTS = {kind: disturbance for kind, disturbance in _SENSORS.items() if disturbance not in READINGS}
"""Faults of the sensors of measured disturbances: what is subtracted for air that is not so warm."""

INLET, AMBIENT = "air_inlet_temperature", "condenser_air_inlet_temperature"
FREQUENCIES_RAD_S = np.geomspace(1.0e-4, 1.0, 13)
#: Less than this share of a fault's effect is nothing: what is zero comes out at 1e-10, the least that is not at 3e-4.
NOTHING_LEFT = 1.0e-6
#: A filter that has to live on less than this share sees noise and the plant's nonlinearity first.
LITTLE_LEFT = 0.05
_INPUTS = tuple(dict.fromkeys(("air_mass_flow", INLET, AMBIENT, *PLANT_FAULTS.values())))


@dataclass(frozen=True)
class SensorSet:
    """What a car measures.

    Attributes
    ----------
    name : str
    readings : tuple of str
        Out of `READINGS`.
    measured : tuple of str
        Disturbances that are measured, out of `INLET` and `AMBIENT`; the others, and the air flow, are unknown.
    """

    name: str
    readings: tuple[str, ...]
    measured: tuple[str, ...] = ()

    @property
    def unknown(self) -> tuple[str, ...]:
        """Disturbances that nothing measures."""
        return tuple(name for name in ("air_mass_flow", INLET, AMBIENT) if name not in self.measured)

    @property
    def faults(self) -> tuple[str, ...]:
        """Faults that there are: of a sensor only where there is the sensor."""
        sensors = (kind for kind, reading in SENSOR_FAULTS.items() if reading in self.readings)
        air = (kind for kind, disturbance in AIR_FAULTS.items() if disturbance in self.measured)
        return (*PLANT_FAULTS, *sensors, *air)


_THREE, _FOUR = tuple(READINGS)[:3], tuple(READINGS)
SENSOR_SETS = tuple(
    SensorSet(f"{len(readings)} readings{words}", readings, measured)
    for readings in (_THREE, _FOUR)
    for words, measured in (("", ()), (", inlet", (INLET,)), (", inlet and ambient", (INLET, AMBIENT)))
)
"""The sets of docs/faults.md: p_e, SH, T_w, then with p_c; each alone, with the evaporator's inlet air, with both."""
CONDITIONED: tuple[tuple[SensorSet, tuple[str, ...]], ...] = (
    (SENSOR_SETS[2], ("compressor_speed", "evaporator_pressure")),
    (SENSOR_SETS[4], ("compressor_speed", "evaporator_pressure")),
    (SENSOR_SETS[5], ("compressor_speed", "evaporator_pressure")),
    (SENSOR_SETS[5], ("compressor_speed", "evaporator_pressure", "condenser_fouling")),
    (SENSOR_SETS[5], ("compressor_speed", "valve_offset", "condenser_fouling")),
    (SENSOR_SETS[5], ("valve_offset", "refrigerant_leak", "condenser_fouling")),
)
"""Faults that are to be estimated together, for each as many as the rank allows."""


@dataclass(frozen=True)
class Isolability:
    """Result for one set of sensors.

    Attributes
    ----------
    sensors : SensorSet
    left : ndarray, shape (faults, faults)
        Row: the fault that is there; column: the one that is blamed. Share of the effect that stays unexplained, at the
        best of the frequencies and the worst of the loads. On the diagonal nothing is blamed but the disturbances.
    rank : ndarray, shape (loads, 2)
        Rank of the disturbances' columns, and of those with all faults, the largest over the frequencies.
    """

    sensors: SensorSet
    left: Matrix
    rank: NDArray[np.int_] = field(repr=False)

    @property
    def unseen(self) -> tuple[str, ...]:
        """Faults that the unknown disturbances alone explain."""
        return tuple(k for k, share in zip(self.sensors.faults, np.diag(self.left), strict=True) if not _shows(share))

    def groups(self, limit: float) -> list[list[str]]:
        """Return the other faults in groups: within one they cannot be told apart with at most `limit` unexplained.

        A fault belongs to a group when it and one of its members explain each other, or one the other.
        """
        kinds = self.sensors.faults
        apart = np.minimum(self.left, self.left.T) > limit
        groups: list[list[str]] = []
        for i, kind in enumerate(kinds):
            if kind in self.unseen:
                continue
            alike = [group for group in groups if any(not apart[i, kinds.index(other)] for other in group)]
            groups = [group for group in groups if group not in alike]
            groups.append([*(other for group in alike for other in group), kind])
        return groups


def responses(point: str, sensors: SensorSet, frequencies_rad_s: Matrix) -> tuple[Columns, Columns]:
    """Return the columns of unknown disturbances and of faults over frequency, readings scaled by `READINGS`.

    Returns
    -------
    tuple of ndarray
        Shapes (frequencies, readings, disturbances) and (frequencies, readings, faults).

    Raises
    ------
    ValueError
        For an unknown operating point.
    """
    plant = linearize(point, inputs=_INPUTS, outputs=tuple(READINGS))
    rows = [tuple(READINGS).index(reading) for reading in sensors.readings]
    scale = np.array([READINGS[reading] for reading in sensors.readings])
    gains = np.moveaxis(np.asarray(control.frequency_response(plant, frequencies_rad_s).frdata), 2, 0)
    gains = gains[:, rows] / scale[:, None]

    def column(kind: str) -> Columns:
        if kind in PLANT_FAULTS:
            return np.asarray(gains[:, :, _INPUTS.index(PLANT_FAULTS[kind])])
        if kind in AIR_FAULTS:
            return np.asarray(-gains[:, :, _INPUTS.index(AIR_FAULTS[kind])])
        unit = np.equal(sensors.readings, SENSOR_FAULTS[kind]) / scale
        return np.broadcast_to(unit, gains.shape[:2]).astype(np.complex128)

    disturbances = gains[:, :, [_INPUTS.index(name) for name in sensors.unknown]]
    return disturbances, np.stack([column(kind) for kind in sensors.faults], axis=2)


def unexplained(effect: Columns, causes: Columns) -> float:
    """Return the share of a column (n,) that lies outside the span of the columns (n, k); 0 where k of them span all.

    Columns are normalised first; a direction that is only rounding beside the others spans nothing.
    """
    norms = np.linalg.norm(causes, axis=0)
    left, sizes, _ = np.linalg.svd(causes[:, norms > 0.0] / norms[norms > 0.0], full_matrices=False)
    basis = left[:, sizes > NOTHING_LEFT]
    rest = effect - basis @ (basis.conj().T @ effect)
    return float(np.linalg.norm(rest) / np.linalg.norm(effect))


def isolability(
    sensors: SensorSet, points: Sequence[str] = POINTS, frequencies_rad_s: Matrix = FREQUENCIES_RAD_S
) -> Isolability:
    """Return which faults a set of sensors can tell apart; see `Isolability`."""
    count = len(sensors.faults)
    left = np.ones((count, count))
    ranks = []
    for point in points:
        known, faults = responses(point, sensors, frequencies_rad_s)
        best = np.zeros((count, count))
        for d, f in zip(known, faults, strict=True):
            for j in range(count):
                best[j, j] = max(best[j, j], unexplained(f[:, j], d))
                rivals = np.column_stack([d, f[:, j]])
                for i in set(range(count)) - {j}:
                    best[i, j] = max(best[i, j], unexplained(f[:, i], rivals))
        left = np.minimum(left, best)
        together = np.concatenate([known, faults], axis=2)
        ranks.append([max(_rank(m) for m in known), max(_rank(m) for m in together)])
    return Isolability(sensors, left, np.array(ranks))


def conditions(point: str, sensors: SensorSet, faults: Sequence[str], frequencies_rad_s: Matrix) -> Matrix:
    """Return the condition number of unknown disturbances and some faults together, columns of length 1.

    Infinite, or very large, where they cannot all be told apart.
    """
    known, columns = responses(point, sensors, frequencies_rad_s)
    chosen = columns[:, :, [sensors.faults.index(kind) for kind in faults]]
    together = np.concatenate([known, chosen], axis=2)
    if together.shape[2] > together.shape[1]:
        return np.full(len(frequencies_rad_s), np.inf)
    return np.asarray(np.linalg.cond(together / np.linalg.norm(together, axis=1, keepdims=True)))


def _shows(share: float) -> bool:
    return share > NOTHING_LEFT


def _rank(columns: Columns) -> int:
    norms = np.linalg.norm(columns, axis=0)
    return int(np.linalg.matrix_rank(columns / norms, NOTHING_LEFT))


def table(result: Isolability) -> str:
    """Return the matrix as Markdown, in per cent: rows the fault that is there, columns what is blamed instead."""
    kinds = result.sensors.faults
    lines = ["| | " + " | ".join(str(number) for number in range(1, len(kinds) + 1)) + " |"]
    lines.append("|---" * (len(kinds) + 1) + "|")
    for number, (kind, row) in enumerate(zip(kinds, result.left, strict=True), start=1):
        lines.append(f"| {number} `{kind}` | " + " | ".join(map(_percent, row)) + " |")
    return "\n".join(lines)


def summary(result: Isolability) -> str:
    """Return one row of Markdown: the set, ranks, what is not seen, and groups by rank and in practice."""
    known, together = result.rank.min(axis=0)
    groups = [_groups(result.groups(limit)) for limit in (NOTHING_LEFT, LITTLE_LEFT)]
    cells = [result.sensors.name, str(known), str(together - known), _listed(result.unseen), *groups]
    return f"| {' | '.join(cells)} |"


def _listed(kinds: Sequence[str]) -> str:
    everything = len(kinds) > len(PLANT_FAULTS)
    return "all" if everything else ", ".join(f"`{kind}`" for kind in kinds) or "none"


def _groups(groups: list[list[str]]) -> str:
    """Return groups of more than one fault, since the others are told apart from all."""
    together = [f"({_listed(group)})" for group in groups if len(group) > 1]
    return ", ".join(together) if together else ("–" if not groups else "none")


def _percent(share: float) -> str:
    if not _shows(share):
        return "–"
    return "<1" if share < 0.01 else f"{100.0 * share:.0f}"


def condition_rows() -> str:
    """Return, as Markdown, the condition over frequency of disturbances and the faults of `CONDITIONED` together."""
    lines = ["| sensors | faults | " + " | ".join(POINTS) + " |", "|---" * (2 + len(POINTS)) + "|"]
    for sensors, faults in CONDITIONED:
        ranges = (conditions(point, sensors, faults, FREQUENCIES_RAD_S) for point in POINTS)
        cells = [f"{found.min():.0f} to {found.max():.0f}" for found in ranges]
        lines.append(f"| {sensors.name} | {_listed(faults)} | {' | '.join(cells)} |")
    return "\n".join(lines)


def tables() -> dict[str, str]:
    """Return the tables of docs/faults.md as Markdown: ``groups``, ``matrices`` and ``conditions``."""
    results = [isolability(sensors) for sensors in SENSOR_SETS]
    head = [
        "| sensors | unknown disturbances | faults at a time | not seen at all | alike by rank | within 5 % |",
        "|---|---|---|---|---|---|",
    ]
    matrices = [f"**{result.sensors.name}**\n\n{table(result)}" for result in reversed(results)]
    return {
        "groups": "\n".join([*head, *map(summary, results)]),
        "matrices": "\n\n".join(matrices),
        "conditions": condition_rows(),
    }


def main() -> None:
    """Print the tables of docs/faults.md."""
    print("\n\n".join(tables().values()))


if __name__ == "__main__":
    main()
