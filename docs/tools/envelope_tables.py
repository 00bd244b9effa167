"""Tables of docs/control.md about the whole envelope: random drives, healthy and with faults, K0 alone beside.

    python -m docs.tools.envelope_tables 10000 100            # drives 10000 to 10099, 2 processes
    python -m docs.tools.envelope_tables 10000 100 --rows rows.json
    python -m docs.tools.envelope_tables 200 6 --plant-off 1 --parameters estimated

Each drive (`drive:SEED`) runs without a fault and with each of `FAULTS` from 900 s on, with accommodation and, where it
is compared, with K0 alone. With ``--plant-off`` every drive has a plant of its own, each uncertain parameter of which
(`fdi_node.envelope.unknowns.PARAMETERS`) is one standard deviation above or below what the designs are made for.
"""

import argparse
import json
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import beta, chi2

from ac_common.faults import ISOLABLE_KINDS, UNKNOWN
from ac_common.units import KPA, RPM
from ac_design.envelope import IF_NEEDED, PARAMETER_CHOICES, design_envelope_fdi
from ac_experiments.designs import EnvelopeDesigns, designs_of
from ac_experiments.metrics import summarise
from ac_experiments.recording import Recording
from ac_experiments.scenario import check, load
from ac_experiments.scenario_schema import Scenario
from ac_experiments.simulate import simulate
from ac_experiments.study.plants import SIGMAS, plant_off_by
from ac_plant_node.parameters.file import another_plant
from ac_plant_node.parameters.values import Parameters

ONSET_S = 900.0
#: Name, the fault, whether K0 alone runs beside it.
FAULTS: dict[str, tuple[dict[str, Any], bool]] = {
    "40 rpm": ({"kind": "compressor_speed", "size_rpm": 40.0}, True),
    "5 kPa": ({"kind": "evaporator_pressure", "size_kpa": 5.0}, True),
    "6 rpm": ({"kind": "compressor_speed", "size_rpm": 6.0}, False),
    "0.4 kPa": ({"kind": "evaporator_pressure", "size_kpa": 0.4}, False),
}
#: Faults that are in no model of the observer.
UNMODELLED: dict[str, tuple[dict[str, Any], bool]] = {
    "valve stuck": ({"kind": "valve_stuck"}, True),
    "SH sensor 3 K": ({"kind": "superheat_sensor", "size_k": 3.0}, True),
    "T_w sensor 2 K": ({"kind": "wall_temperature_sensor", "size_k": 2.0}, True),
    "air inlet sensor 2 K": ({"kind": "air_inlet_sensor", "size_k": 2.0}, True),
}


def _errors(run: Recording) -> tuple[np.ndarray, np.ndarray]:
    """Return the actual errors of p_e, kPa, and SH, K."""
    series = run.series
    pressure = (series["plant/evaporator_pressure"] - series["reference/evaporator_pressure"]) / KPA
    return pressure, series["plant/superheat"] - series["reference/superheat"]


def _iae(run: Recording, since_s: float = 0.0) -> list[float]:
    """Return the integrals of the absolute errors of p_e, kPa s, and SH, K s."""
    step_s = float(run.time_s[1] - run.time_s[0])
    return [float(np.abs(error[run.time_s >= since_s]).sum()) * step_s for error in _errors(run)]


def _alarms(run: Recording, until_s: float) -> float:
    """Return for how long something was detected before `until_s`, s."""
    step_s = float(run.time_s[1] - run.time_s[0])
    return sum(row.detected for row in run.status if row.time_s < until_s) * step_s


def plant_off(seed: Sequence[int]) -> Parameters | None:
    """Return a plant whose uncertain parameters are one standard deviation off, each up or down at random."""
    signs = np.random.default_rng(seed).choice([-1.0, 1.0], size=len(SIGMAS))
    return plant_off_by(dict(zip(SIGMAS, signs.tolist(), strict=True)))


def run_drive(
    seed: int,
    design: str,
    faults: dict[str, tuple[dict[str, Any], bool]],
    off: int | None = None,
    parameters: str = IF_NEEDED,
    changes: Sequence[str] = (),
) -> dict[str, Any]:
    """Return the figures of one drive; `off`: seed of a plant that is another one than the designs are for."""
    base = load(f"drive:{seed}", [f"design={design}", *changes])
    designs = designs_of(base)
    if parameters != IF_NEEDED:
        assert isinstance(designs, EnvelopeDesigns)
        observer = design_envelope_fdi(base.sample_time_s, base.envelope_sensors, parameters=parameters)
        designs = replace(designs, fdi=observer)
    other = None if off is None else plant_off((off, seed))

    def run_with(scenario: Scenario, passive: bool) -> Recording:
        with another_plant(other):
            return simulate(scenario, passive, designs=designs)

    healthy, alone = (run_with(base, passive) for passive in (False, True))
    found = summarise(healthy)
    row: dict[str, Any] = {
        "seed": seed,
        "hours": base.duration_s / 3600.0,
        "false_alarms": found["false_alarms"],
        "detected_s": _alarms(healthy, np.inf),
        "iae": _iae(healthy),
        "iae_alone": _iae(alone),
    }
    for name, (fault, beside) in faults.items():
        scenario = check({**base.model_dump(mode="json"), "faults": [{**fault, "onset_s": ONSET_S}]})
        run = run_with(scenario, False)
        row[name] = _with_fault(run, healthy)
        if beside:
            passive = run_with(scenario, True)
            peak_off = float(_off(passive, alone, "plant/evaporator_pressure", ONSET_S).max()) / KPA
            row[name] |= {"peak_alone": _peak(passive), "peak_off_alone": peak_off, "iae_alone": _iae(passive, ONSET_S)}
    return row


def _off(run: Recording, healthy: Recording, key: str, since_s: float) -> np.ndarray:
    """Return how far a signal is from that of the drive without the fault, from a time on."""
    return np.abs(run.series[key] - healthy.series[key])[run.time_s >= since_s]


def k0_ratios(seed: int) -> list[float]:
    """Return integrals of absolute errors, p_e and SH, in a healthy drive with K0 alone, over those of the paper's K0.

    The paper's is that of the operating point from which the drive starts.
    """
    ours, papers = (_iae(simulate(load(f"drive:{seed}", [f"design={one}"]), True)) for one in ("envelope", "paper"))
    return [one / other for one, other in zip(ours, papers, strict=True)]


def _peak(run: Recording) -> float:
    """Return the largest error of p_e from the onset on, kPa."""
    return float(np.abs(_errors(run)[0][run.time_s >= ONSET_S]).max())


def _with_fault(run: Recording, healthy: Recording) -> dict[str, Any]:
    summary = summarise(run)
    (fault,) = summary["faults"]
    rows = [row for row in run.status if row.time_s >= ONSET_S]
    first = next((row for row in rows if row.isolated is not None), None)
    names = sorted({name for row in rows for name in (row.isolated, row.also_isolated) if name})
    late_s = ONSET_S + 60.0
    speed = run.series["controller/command:compressor"] - healthy.series["controller/command:compressor"]
    return {
        "kind": fault["kind"],
        "alarms_before": _alarms(run, ONSET_S),
        "first": None if first is None else first.isolated,
        "first_s": None if first is None else first.time_s - ONSET_S,
        "names": names,
        "isolated_as": fault["isolated_as"],
        "wrong_s": 0.1 * sum(row.isolated not in (None, fault["kind"]) for row in rows),
        "pressure_off": float(_off(run, healthy, "plant/evaporator_pressure", late_s).max()) / KPA,
        "superheat_off": float(_off(run, healthy, "plant/superheat", late_s).max()),
        "speed_change": float(speed[run.time_s >= late_s].mean()) / RPM,
        "peak": _peak(run),
        "peak_healthy": _peak(healthy),
        "peak_off": float(_off(run, healthy, "plant/evaporator_pressure", ONSET_S).max()) / KPA,
        "iae": _iae(run, ONSET_S),
    }


def _share(good: int, of: int) -> str:
    """Return a share with its exact 95 % interval (Clopper-Pearson)."""
    low = beta.ppf(0.025, good, of - good + 1) if good else 0.0
    return f"{good} of {of} (at least {100.0 * low:.1f} %)"


def tables(rows: list[dict[str, Any]], faults: dict[str, tuple[dict[str, Any], bool]]) -> str:
    """Return the figures of all drives as Markdown."""
    alarms, hours = sum(row["false_alarms"] for row in rows), sum(row["hours"] for row in rows)
    most = chi2.ppf(0.975, 2 * alarms + 2) / 2.0 / hours
    ratio = np.array([np.divide(row["iae"], row["iae_alone"]) for row in rows])
    lines = [
        f"Healthy: {alarms} false alarms in {hours:.1f} h, at most {most:.3f} an hour (95 %, Poisson). IAE over that "
        f"of K0 alone, the worst drive: p_e {ratio[:, 0].max():.4f}, SH {ratio[:, 1].max():.4f}.",
        "",
        "| fault | right first | median, 95 %, last, s | within 60 s | drives with a wrong name "
        "| off healthy from 60 s on: p_e kPa, SH K (95 %, worst) | command, rpm "
        "| peak over the drive's own, kPa (95 %, worst) "
        "| peak over K0 alone's: of the error, of what the fault does "
        "| IAE over K0 alone's: p_e, SH (median, worst) |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    lines += ["| " + " | ".join(_cells(name, [row[name] for row in rows])) + " |" for name in faults]
    return "\n".join(lines)


def _cells(name: str, got: list[dict[str, Any]]) -> list[str]:
    """Return the cells of a fault's row."""
    right = got[0]["kind"] if got[0]["kind"] in ISOLABLE_KINDS else UNKNOWN
    delays = np.array([one["first_s"] if one["first"] == right else np.inf for one in got])
    late = np.quantile(delays, 0.95, method="higher")
    wrong: dict[str, int] = {}
    for one in got:
        for other in {*one["names"]} - {right}:
            wrong[other] = wrong.get(other, 0) + 1
    pressure, superheat = ([one[key] for one in got] for key in ("pressure_off", "superheat_off"))
    speed, peak = [one["speed_change"] for one in got], [one["peak"] - one["peak_healthy"] for one in got]
    cells = [
        name,
        _share(int(np.isfinite(delays).sum()), len(got)),
        f"{np.median(delays):.1f}, {late:.1f}, {delays.max():.1f}",
        str(int((delays <= 60.0).sum())),
        ", ".join(f"{other} {count}" for other, count in sorted(wrong.items())) or "none",
        f"{_worst(pressure)}; {_worst(superheat)}",
        f"{min(speed):.1f} to {max(speed):.1f}",
        _worst(peak),
    ]
    if "peak_alone" not in got[0]:
        return [*cells, "", ""]
    iae = np.array([np.divide(one["iae"], one["iae_alone"]) for one in got])
    more = [max(one[key] - one[f"{key}_alone"] for one in got) for key in ("peak", "peak_off")]
    medians, most = np.median(iae, axis=0), iae.max(axis=0)
    return [
        *cells,
        f"{more[0]:.2f}, {more[1]:.2f}",
        f"{medians[0]:.2f}, {most[0]:.2f}; {medians[1]:.2f}, {most[1]:.2f}",
    ]


def _worst(values: list[float]) -> str:
    """Return the 95 % quantile and the largest of some values."""
    return f"{np.quantile(values, 0.95):.2f}, {max(values):.2f}"


def main() -> None:
    """Run the drives and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("first", type=int)
    parser.add_argument("count", type=int)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--design", default="envelope")
    parser.add_argument("--unmodelled", action="store_true")
    parser.add_argument("--rows", type=Path)
    parser.add_argument("--plant-off", type=int, metavar="SEED")
    parser.add_argument("--parameters", choices=PARAMETER_CHOICES, default=IF_NEEDED)
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", dest="changes")
    parser.add_argument("--k0", action="store_true", help="K0 alone over K0 of the starting point, healthy drives only")
    given = parser.parse_args()
    faults = UNMODELLED if given.unmodelled else FAULTS
    if given.plant_off is not None:  # the small ones cannot be told from what is off
        faults = {name: fault for name, fault in faults.items() if fault[1]}
    seeds = range(given.first, given.first + given.count)
    if given.k0:
        with ProcessPoolExecutor(given.jobs) as pool:
            p_e, sh = zip(*pool.map(k0_ratios, seeds), strict=True)
        print(f"p_e: mean {np.mean(p_e):.2f}, worst {max(p_e):.2f}; SH: mean {np.mean(sh):.2f}, worst {max(sh):.2f}")
        return
    with ProcessPoolExecutor(given.jobs) as pool:
        run = partial(
            run_drive,
            design=given.design,
            faults=faults,
            off=given.plant_off,
            parameters=given.parameters,
            changes=given.changes,
        )
        rows = list(pool.map(run, seeds))
    if given.rows:
        given.rows.write_text(json.dumps(rows))
    print(tables(rows, faults))


if __name__ == "__main__":
    main()
