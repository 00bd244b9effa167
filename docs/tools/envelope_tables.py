"""Tables of docs/control.md about random drives, from studies that have been played.

    acftc study envelope_healthy --runs 1000 --seed 50000 --set duration_s=1000 --out healthy
    acftc study envelope_faults --runs 4000 --seed 50000 --set duration_s=1000 --set fault.onset_s=600 --out faults
    python -m docs.tools.envelope_tables healthy faults

A row is a kind of fault of one size. Right is its name, of a fault that no estimate is for `unknown`.
"""

import argparse
from pathlib import Path

import numpy as np

from ac_common.faults import BY_KIND
from ac_experiments.study import intervals
from ac_experiments.study.finish import read_runs
from ac_experiments.study.outcomes import CORRECT, MISDIAGNOSED
from ac_experiments.study.results import Store
from ac_experiments.study.schema import NO_FAULT
from ac_experiments.study.summary import Runs, false_alarms

HEADS = (
    "fault",
    "right first",
    "median, 95 %, last, s",
    "within 60 s",
    "wrong first; a wrong name at any time",
    "off the drive without the fault from 60 s on: p_e kPa, SH K (95 %, worst)",
    "command, rpm",
    "peak over the drive's own, kPa (95 %, worst)",
    "peak over K0 alone's, worst: of the error, of what the fault does, kPa",
    "IAE over K0 alone's: p_e, SH (median, worst)",
)
_IAE = ("iae_pressure_kpa_s", "iae_superheat_k_s")


def healthy_words(runs: Runs) -> str:
    """Return what fault-free runs and the time before the onsets show."""
    alarms, fault_free = false_alarms(runs), runs.where(runs["fault_kind"] == NO_FAULT)
    rate = alarms["per_hour"]
    some = "1 false alarm" if alarms["count"] == 1 else f"{alarms['count']} false alarms"
    words = (
        f"{some} in {alarms['hours']:.1f} h without a fault: {rate.value:.3g} an hour "
        f"({rate.low:.2g} to {rate.high:.2g}, 95 %, Poisson)."
    )
    if len(fault_free):
        ratio = [fault_free[name] / fault_free[f"k0_{name}"] for name in _IAE]
        words += (
            f" {len(fault_free)} runs without a fault, IAE over that of K0 alone, the worst: p_e {ratio[0].max():.4f}"
        )
        words += f", SH {ratio[1].max():.4f}."
    return words


def fault_cells(name: str, runs: Runs) -> list[str]:
    """Return the cells of a fault's row."""
    right = runs["outcome"] == CORRECT
    delays = np.where(right, runs["isolation_delay_s"], np.inf)
    late = np.quantile(delays, 0.95, method="higher")
    wrong = int((runs["outcome"] == MISDIAGNOSED).sum())
    change = {key: runs[f"late_change_{key}"] for key in ("pressure_kpa", "superheat_k", "speed_rpm")}
    more = runs["peak_pressure_error_kpa"] - runs["fault_free_peak_pressure_error_kpa"]
    over = [runs[key] - runs[f"k0_{key}"] for key in ("peak_pressure_error_kpa", "change_pressure_kpa")]
    ratio = [runs[key] / runs[f"k0_{key}"] for key in _IAE]
    least = 100.0 * intervals.share(int(right.sum()), len(runs)).low
    return [
        name,
        f"{int(right.sum())} of {len(runs)} (at least {least:.1f} %)",
        f"{np.median(delays):.1f}, {late:.1f}, {delays.max():.1f}",
        str(int((delays <= 60.0).sum())),
        f"{wrong}; {int((runs['wrong_name_s'] > 0.0).sum())}",
        f"{_worst(change['pressure_kpa'])}; {_worst(change['superheat_k'])}",
        f"{change['speed_rpm'].min():.1f} to {change['speed_rpm'].max():.1f}",
        _worst(more),
        ", ".join(f"{one.max():.2f}" for one in over),
        "; ".join(f"{np.median(one):.2f}, {one.max():.2f}" for one in ratio),
    ]


def _worst(values: np.ndarray) -> str:
    """Return the 95 % quantile and the largest of some values."""
    return f"{np.quantile(values, 0.95):.2f}, {values.max():.2f}"


def table(runs: Runs) -> str:
    """Return a study as Markdown: a sentence about what is healthy, a row for each fault and size."""
    parts = [healthy_words(runs)]
    rows = []
    for kind in runs.kinds:
        of = runs.of_kind(kind)
        for size in sorted(set(of["fault_size"].tolist()), key=abs, reverse=True):
            unit = BY_KIND[kind].unit
            rows.append(fault_cells(f"{kind}, {size:g} {unit}", of.where(of["fault_size"] == size)))
    if rows:
        parts.append("\n".join("| " + " | ".join(row) + " |" for row in (HEADS, ["---"] * len(HEADS), *rows)))
    return "\n\n".join(parts)


def main() -> None:
    """Print the tables of some studies."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("studies", type=Path, nargs="+", metavar="DIR")
    for folder in parser.parse_args().studies:
        runs = read_runs(Store(str(folder)))
        if not runs.study.k0_alone or not (runs.study.fault_free or not runs.kinds):
            parser.error(f"{folder}: has no K0 alone beside, or no runs without their faults (fault_free: true)")
        print(table(runs), end="\n\n")


if __name__ == "__main__":
    main()
