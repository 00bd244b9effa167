"""How far p_e moves in E5 on the nonlinear plant, beside what no sampled controller can do better.

``python -m ac_experiments.paper.reached_peak`` prints the table of `docs/control.md`.
"""

from dataclasses import replace

from ac_common.units import KPA, RPM
from ac_design import CompensatorWeights, design_compensator
from ac_design.analysis.performance_bounds import attainable_peak_pa, smallest_peak_pa
from ac_design.weights import QUICK_GUARD, MatchingWeights
from ac_experiments.designs import designs_at
from ac_experiments.metrics import summarise
from ac_experiments.scenario import load
from ac_experiments.simulate import simulate


def reached_peak_pa(point: str, sample_time_s: float, guard: MatchingWeights | None = None) -> float:
    """Return the peak [Pa] of |p_e - p_e,r| in E5 on the nonlinear plant, with the guard in use or with another one."""
    overrides = [f"operating_point={point}", f"sample_time_s={sample_time_s:g}", "duration_s=620"]
    designs = designs_at(point, sample_time_s)
    if guard is not None:
        weights = replace(CompensatorWeights(), guard=guard)
        designs = replace(designs, compensator=design_compensator(point, sample_time_s, weights))
    metrics = summarise(simulate(load("actuator_fault", overrides), designs=designs))["metrics"]
    return float(metrics["peak_pressure_error_kpa"]) * KPA


def main() -> None:
    """Print the table."""
    print("| point | rate, Hz | bound, kPa | with all known, kPa | reached, kPa | with the quick guard, kPa |")
    print("|---|---|---|---|---|---|")
    for point in ("low", "med", "high"):
        for rate_hz in (10, 20, 50, 100):
            found = [
                smallest_peak_pa(point, 1.0 / rate_hz, 40.0 * RPM),
                attainable_peak_pa(point, 1.0 / rate_hz, 40.0 * RPM),
                reached_peak_pa(point, 1.0 / rate_hz),
                reached_peak_pa(point, 1.0 / rate_hz, QUICK_GUARD),
            ]
            cells = " | ".join(f"{peak / 1e3:.2f}" for peak in found)
            print(f"| {point} | {rate_hz} | {cells} |", flush=True)


if __name__ == "__main__":
    main()
