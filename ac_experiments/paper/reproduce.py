"""The paper's experiments E1-E8 run again: what its prose says of each, what comes out here, and a verdict."""

import json
import math
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ac_common.errors import UserError
from ac_common.files import write_whole
from ac_common.sample_time import DEFAULT_SAMPLE_TIME_S
from ac_common.units import KPA, RPM
from ac_experiments.designs import Designs, designs_at
from ac_experiments.metrics import summarise
from ac_experiments.paper.judgement import AGREES, DIFFERS, Experiment, Finding, at_least, at_most, near, noted, toward
from ac_experiments.paper.page import page
from ac_experiments.recording import Recording
from ac_experiments.report.charts import BLUE, GREEN, VERMILION, Chart, Curve
from ac_experiments.report.matplotlib_charts import draw
from ac_experiments.report.panels import charts_of
from ac_experiments.report.paper_figures import ACCOMMODATION
from ac_experiments.scenario import load
from ac_experiments.scenario_schema import Air, Scenario
from ac_experiments.simulate import simulate

POINTS = ("low", "med", "high")
#: A residual has this long to arrive at its fault, s.
SETTLING_S = 60.0

_RESIDUALS = ("r_N", "r_p")
_LOOP = ("p_e", "SH", "N", "valve")


def reproduce(out_dir: Path, cycle: Path | None = None, say: Callable[[str], None] | None = None) -> list[Experiment]:
    """Run every experiment, and write its picture, ``paper.json`` and ``index.html`` into `out_dir`.

    Parameters
    ----------
    out_dir
        An existing folder.
    cycle
        Drive cycle for E8; without it E8 is left out, and says so.
    say
        Called with one line before each experiment.

    Returns
    -------
    list of Experiment
        E1 to E8 in order.

    Raises
    ------
    ValueError
        When the drive cycle cannot be read.
    """
    if cycle is not None:
        from ac_plant_node.drive_cycle import load_drive_cycle

        load_drive_cycle(cycle)  # a file that cannot be read is known now, not after seven experiments
    steps: list[tuple[str, Callable[[], Experiment]]] = [
        ("E1 operating points", operating_points),
        ("E2 isolation", isolation),
        ("E3 isolation with two sensors", isolation_two_sensors),
        ("E4 isolation under disturbance", isolation_disturbed),
        ("E5 actuator fault", actuator_fault),
        ("E6 sensor fault", sensor_fault),
        ("E7 compensators over the operating points", compensators),
        ("E8 drive cycle", lambda: drive_cycle(cycle)),
    ]
    experiments = []
    for name, step in steps:
        if say is not None:
            say(name)
        experiments.append(step())
    content = {}
    for experiment in experiments:
        picture = None
        if experiment.picture:
            picture = f"{experiment.id.lower()}.svg"
            write_whole(out_dir / picture, experiment.picture)
        content[experiment.id] = {
            "title": experiment.title,
            "verdict": experiment.verdict,
            "findings": [_finite(asdict(finding)) for finding in experiment.findings],
            "remark": experiment.remark,
            "figure": picture,
        }
    write_whole(out_dir / "paper.json", json.dumps(content, indent=2, allow_nan=False) + "\n")
    write_whole(out_dir / "index.html", page(experiments))
    return experiments


# --------------------------------------------------------------------------------------------- the experiments


def operating_points() -> Experiment:
    """E1: Table I as equilibria of the nonlinear plant."""
    from ac_plant_node import TABLE_I, operating_point

    findings = []
    for row in TABLE_I:
        outputs = operating_point(row.name).outputs
        findings.append(near(f"p_e at {row.name}", "kPa", float(outputs[0]) / KPA, row.evaporator_pressure_kpa, 0.05))
        findings.append(near(f"SH at {row.name}", "K", float(outputs[1]), row.superheat_k, 0.02))
    remark = "Found by the equilibrium solver; the maps of compressor and valve are calibrated to these points."
    return Experiment("E1", "Operating points of Table I", findings, remark)


def isolation() -> Experiment:
    """E2: each residual answers its own fault only, with the paper's two sensors; beside it with three."""
    scenario = load("isolation")
    run, three = simulate(scenario), simulate(scenario.model_copy(update={"sensors": 3}))
    onset_n, onset_p = _onsets(run)
    r_n, r_p = _residuals(run)
    findings = [
        near("r_N, worst from 60 s after its fault on", "rpm", _worst(r_n[_settled(run, onset_n, onset_p)], 40), 40, 3),
        near("r_p, worst from 60 s after its fault on", "kPa", _worst(r_p[_settled(run, onset_p)], 5), 5, 0.2),
        *_cross_talk(run, ""),
        *_cross_talk(three, "three sensors: "),
        *_isolation_verdicts(run),
    ]
    remark = "The paper shows that each residual answers its own fault only; the limits make that a number."
    return Experiment("E2", "Isolation without disturbance", findings, remark, _picture("E2", run, None, _RESIDUALS))


def _cross_talk(run: Recording, whose: str) -> list[Finding]:
    """Return how much each fault moves the other's residual, in per cent of the other fault."""
    onset_n, onset_p = _onsets(run)
    r_n, r_p = _residuals(run)
    only_n, both = (run.time_s >= onset_n) & (run.time_s < onset_p), run.time_s >= onset_p
    return [
        at_most(f"{whose}cross-talk of f_N on r_p, peak", "% of 5 kPa", 100 * _peak(r_p[only_n]) / 5, 2),
        at_most(f"{whose}cross-talk of f_p on r_N, peak", "% of 40 rpm", 100 * _peak(r_n[both] - 40) / 40, 10),
    ]


def isolation_two_sensors() -> Experiment:
    """E3: with two sensors the residuals follow the disturbance."""
    from ac_design.store import cached_design
    from ac_design.weights import FdiWeights

    scenario = load("isolation_two_sensors")
    design = cached_design(
        "fdi-two-sensors", "ac_design.fdi_two_sensors", scenario.operating_point, scenario.sample_time_s, FdiWeights()
    )
    calm = simulate(scenario.model_copy(update={"air": Air()}))
    run = simulate(scenario)
    r_n, r_p = _residuals(run)
    calm_n, calm_p = _residuals(calm)
    onset_n, onset_p = (fault.onset_s for fault in scenario.faults)
    disturbed = run.time_s < onset_n
    findings = [
        near(
            "without disturbance: r_N, 60 s after its fault on",
            "rpm",
            _worst(calm_n[_settled(calm, onset_n, onset_p)], 40),
            40,
            3,
        ),
        near(
            "without disturbance: r_p, 60 s after its fault on",
            "kPa",
            _worst(calm_p[_settled(calm, onset_p)], 5),
            5,
            0.2,
        ),
        at_least("r_N under the disturbance alone, peak", "rpm", _peak(r_n[disturbed]), 40),
        at_least("r_p under the disturbance alone, peak", "kPa", _peak(r_p[disturbed]), 5),
        noted("no filter with two sensors gets below (1: gives nothing)", "", float(design["lower_bound"])),
    ]
    remark = (
        "The paper: with two sensors the residuals are very sensitive to the disturbance. Ours are: the disturbance "
        "alone moves them by more than the faults do; the lower bound says that no other filter could help."
    )
    panels = (*_RESIDUALS, "air_flow")
    return Experiment(
        "E3", "Isolation with two sensors under disturbance", findings, remark, _picture("E3", run, None, panels)
    )


def isolation_disturbed() -> Experiment:
    """E4: with the wall thermocouple the faults stay apart during a manoeuvre and steps in air flow."""
    run = simulate(load("isolation_disturbed"))
    onset_n, onset_p = _onsets(run)
    r_n, r_p = _residuals(run)
    settled_n, settled_p = _settled(run, onset_n, onset_p), _settled(run, onset_p)
    findings = [
        near("r_N, mean from 60 s after its fault on", "rpm", float(r_n[settled_n].mean()), 40, 10),
        near("r_p, mean from 60 s after its fault on", "kPa", float(r_p[settled_p].mean()), 5, 0.3),
        near("r_N, worst from 60 s after its fault on", "rpm", _worst(r_n[settled_n], 40), 40, 10, in_paper=False),
        near("r_p, worst from 60 s after its fault on", "kPa", _worst(r_p[settled_p], 5), 5, 0.3, in_paper=False),
        noted("r_N: part of the time within 10 rpm", "%", 100 * _part_within(r_n[settled_n], 40, 10)),
        noted("r_p: part of the time within 0.3 kPa", "%", 100 * _part_within(r_p[settled_p], 5, 0.3)),
        at_most("false alarms", "", float(summarise(run)["false_alarms"]), 0),
        *_isolation_verdicts(run),
        noted("r_N before any fault, peak", "rpm", _peak(r_n[run.time_s < onset_n])),
        noted("r_p before any fault, peak", "kPa", _peak(r_p[run.time_s < onset_n])),
    ]
    panels = ("p_e", "SH", *_RESIDUALS, "air_flow")
    remark = (
        "Manoeuvre of +5 kPa and -2.5 K from 100 s, air flow +10 % at 200 s, back at 550 s, -10 % at 850 s. The worst "
        "ticks are the seconds after a step of the air flow, which nobody measures."
    )
    return Experiment("E4", "Isolation with the wall thermocouple", findings, remark, _picture("E4", run, None, panels))


def actuator_fault() -> Experiment:
    """E5: 40 rpm on the compressor speed; passive with a K0 after the paper's weights and with ours; active."""
    scenario = load("actuator_fault")
    let_go = simulate(scenario.model_copy(update={"controller": "paper"}), passive=True)
    helped = simulate(scenario.model_copy(update={"controller": "paper"}), passive=False)
    tracking, active = simulate(scenario, passive=True), simulate(scenario, passive=False)
    first, second, third, fourth = (summarise(run)["metrics"] for run in (let_go, tracking, active, helped))
    findings = [
        near("passive, K0 after the paper: change of the command", "rpm", first["command_change_rpm"], -20, 2),
        near("passive, K0 after the paper: p_e at rest", "kPa", first["steady_pressure_error_kpa"], 0, 0.05),
        noted("passive, K0 after the paper: p_e off its reference, peak", "kPa", first["peak_pressure_error_kpa"]),
        noted("passive, K0 that tracks both: change of the command", "rpm", second["command_change_rpm"]),
        noted("passive, K0 that tracks both: p_e off its reference, peak", "kPa", second["peak_pressure_error_kpa"]),
        near("active: change of the command", "rpm", third["command_change_rpm"], -40, 0.2),
        near("active: p_e minus reference at rest", "kPa", third["steady_pressure_error_kpa"], 0, 0.05),
        at_most("active: p_e off its reference, peak", "kPa", third["peak_pressure_error_kpa"], 0.3),
        near("active, K0 after the paper: change of the command", "rpm", fourth["command_change_rpm"], -40, 0.2),
        noted("active, K0 after the paper: p_e off its reference, peak", "kPa", fourth["peak_pressure_error_kpa"]),
        noted("active: no controller at 10 Hz gets below", "kPa", _smallest_peak_kpa(scenario)),
    ]
    picture = _picture("E5", active, let_go, (*_LOOP, *_RESIDUALS))
    remark = (
        "Drawn as passive: a K0 after the paper's weights, which holds p_e, leaves SH alone, takes back half of the "
        "40 rpm and leaves the rest to the valve. The K0 that is used everywhere else holds both references; its "
        "passive loop comes to rest at -40 rpm, too, and what accommodation buys is the transient of p_e."
    )
    title = "Accommodation of an actuator fault"
    return Experiment("E5", title, findings + _isolation_verdicts(active), remark, picture)


def _smallest_peak_kpa(scenario: Scenario) -> float:
    from ac_design.analysis.performance_bounds import smallest_peak_pa

    return smallest_peak_pa(scenario.operating_point, scenario.sample_time_s, 40.0 * RPM) / KPA


def sensor_fault() -> Experiment:
    """E6: 5 kPa on the pressure sensor, passive and active."""
    return _accommodation(
        "sensor_fault",
        "Accommodation of a sensor fault",
        lambda passive, active: [
            near("passive: change of the command", "rpm", passive["command_change_rpm"], 50, 5),
            near("passive: p_e minus reference at rest", "kPa", passive["steady_pressure_error_kpa"], -5, 0.2),
            toward("active: change of the command", "rpm", active["command_change_rpm"], 10, 0, 1),
            toward("active: p_e minus reference at rest", "kPa", active["steady_pressure_error_kpa"], -1, 0, 0.1),
            at_most("active: p_e off its reference, peak", "kPa", active["peak_pressure_error_kpa"], 0.5),
        ],
    )


def compensators() -> Experiment:
    """E7: Q over frequency at the three points, and the medium Q used at the others."""
    designs = {point: designs_at(point, DEFAULT_SAMPLE_TIME_S) for point in POINTS}
    frequencies = np.logspace(-4, math.log10(0.9 * math.pi / DEFAULT_SAMPLE_TIME_S), 300)
    charts, findings = [], []
    for name, rows in (("Q_act", slice(0, 2)), ("Q_sen", slice(2, 4))):
        gains = {
            point: _largest_singular_value(designs[point].compensator, rows, frequencies, DEFAULT_SAMPLE_TIME_S)
            for point in POINTS
        }
        looks = zip(POINTS, (GREEN, BLUE, VERMILION), ("dash", "solid", "dashdot"), strict=True)
        charts.append(
            Chart(
                title=f"Compensator {name.replace('_', '<sub>')}</sub>",
                y_title="largest singular value (rpm, % over kPa, K, K)",
                curves=[Curve(frequencies, gains[point], point, colour, dash) for point, colour, dash in looks],
                x_title="Frequency, rad/s",
                log="xy",
            )
        )
        spread = max(float(np.max(gains[point] / gains["med"])) for point in ("low", "high"))
        spread = max(spread, *(float(np.max(gains["med"] / gains[point])) for point in ("low", "high")))
        verdict = AGREES if spread > 1.5 else DIFFERS
        what = f"{name}: largest ratio of gains between medium and another point"
        findings.append(Finding(what, "", None, spread, verdict, "they differ: above 1.5"))
    for block, scenario in (("Q_act", "actuator_fault"), ("Q_sen", "sensor_fault")):
        for point in ("low", "high"):
            findings += _medium_poles_at(point, block)
            findings += _medium_compensator_at(point, scenario, designs["med"])
    remark = (
        "The paper concludes that Q must be scheduled with the operating point. The linear loop of a point's plant and "
        "K0 with the medium Q: with that point's own observer f_e does not depend on q, so any stable Q is stable, and "
        "only the accommodation suffers; with the medium observer, too, a pole above zero means that the loop is "
        f"unstable there. {_unstable(findings)} The runs are those loops on the nonlinear plant: a missing number "
        "means that it ran away."
    )
    return Experiment("E7", "Compensators over the operating points", findings, remark, draw(charts, 2, "E7"))


def drive_cycle(cycle: Path | None) -> Experiment:
    """E8: the model through a drive cycle; the paper's measurements are not public."""
    title = "Drive cycle SC03"
    if cycle is None:
        return Experiment("E8", title, [], "Left out: no drive cycle was given (--cycle FILE).")
    from ac_plant_node.drive_cycle import load_drive_cycle, run_drive_cycle

    run = run_drive_cycle(load_drive_cycle(cycle))
    p_e, p_c = run.outputs[:, 0] / KPA, run.outputs[:, 3] / KPA
    findings = [
        at_most("drift of the refrigerant mass", "relative", run.mass_drift, 1e-6),
        noted("lowest p_e", "kPa", float(p_e.min())),
        noted("highest p_e", "kPa", float(p_e.max())),
        noted("lowest p_c", "kPa", float(p_c.min())),
        noted("highest p_c", "kPa", float(p_c.max())),
    ]
    charts = [
        Chart("Vehicle speed", [Curve(run.time_s, 3.6 * run.vehicle_speed_m_s, "", GREEN)], "v, km/h"),
        Chart("Compressor speed", [Curve(run.time_s, run.compressor_speed_rad_s / RPM, "", BLUE)], "N, rpm"),
        Chart("Evaporator pressure", [Curve(run.time_s, p_e, "", BLUE)], "p<sub>e</sub>, kPa"),
        Chart("Condenser pressure", [Curve(run.time_s, p_c, "", VERMILION)], "p<sub>c</sub>, kPa"),
    ]
    remark = (
        "The plant alone, open loop from the medium point: belt-driven compressor, valve and air held. The paper "
        "compares with measurements (p_c within 6 %, p_e about 8 %) that are not public: nothing to compare with here."
    )
    return Experiment("E8", title, findings, remark, draw(charts, 2, "E8"))


# --------------------------------------------------------------------------------------------------- how it is done


def _accommodation(
    name: str, title: str, judge: Callable[[dict[str, float | None], dict[str, float | None]], list[Finding]]
) -> Experiment:
    scenario, paper = load(name), ACCOMMODATION[name]
    passive, active = simulate(scenario, passive=True), simulate(scenario, passive=False)
    findings = judge(summarise(passive)["metrics"], summarise(active)["metrics"])
    picture = _picture(paper.experiment, active, passive, (*_LOOP, *_RESIDUALS))
    return Experiment(paper.experiment, title, findings + _isolation_verdicts(active), paper.remark, picture)


def _medium_poles_at(point: str, block: str) -> list[Finding]:
    """Return the slowest pole of the linear loop with the medium Q, and the factor on q up to which it is stable."""
    from ac_design.analysis.loop_stability import medium_at

    found = []
    for observer, loop in medium_at(point, block).items():
        whose = f"medium {block} at {point}, {observer}"
        found.append(noted(f"{whose}: slowest pole", "rad/s", loop.slowest_rad_s))
        found.append(noted(f"{whose}: stable up to so many times q", "", loop.margin))
    return found


def _unstable(findings: list[Finding]) -> str:
    """Return where the medium point's Q has a pole above zero, in words."""
    end = ": slowest pole"
    poles = [f for f in findings if f.quantity.endswith(end) and f.ours is not None]
    wrong = [
        f"{f.quantity.removesuffix(end)} ({f.ours:+.2g} rad/s)" for f in poles if f.ours is not None and f.ours >= 0.0
    ]
    return f"Unstable: {'; '.join(wrong) or 'none'}; the other {len(poles) - len(wrong)} are stable."


def _medium_compensator_at(point: str, name: str, medium: Designs) -> list[Finding]:
    """Return the peak of p_e off its reference: with the point's designs, the medium Q, and its observer as well."""
    scenario = load(name, [f"operating_point={point}"])
    own = designs_at(point, scenario.sample_time_s)
    foreign = replace(medium.fdi, input_rest=own.fdi.input_rest, output_rest=own.fdi.output_rest)
    # Without the bounds that would leave the loop to K0: Q itself is what is looked at.
    unbounded = replace(medium.compensator, q_range=np.full(2, np.inf), reference_rest=np.empty(0))
    used = {
        "its own Q": own,
        "the medium Q": replace(own, compensator=unbounded),
        "the medium Q and observer": replace(own, fdi=foreign, compensator=unbounded),
    }
    found = []
    for whose, designs in used.items():
        try:
            error: float | None = summarise(simulate(scenario, designs=designs))["metrics"]["peak_pressure_error_kpa"]
        except UserError:
            error = None
        found.append(noted(f"{name} at {point} with {whose}: p_e off its reference, peak", "kPa", error))
    return found


def _largest_singular_value(
    design: Any, rows: slice, frequencies: NDArray[np.float64], sample_time_s: float
) -> NDArray[np.float64]:
    """Return the largest singular value of one compensator over frequency, in rpm and % over kPa, K, K."""
    to_units = np.array([1.0 / RPM, 100.0])[:, None] * np.array([KPA, 1.0, 1.0])
    c, d, identity = design.c[rows], design.d[rows], np.eye(len(design.a))
    gains = []
    for frequency in frequencies:
        z = np.exp(1j * frequency * sample_time_s)
        response = c @ np.linalg.solve(z * identity - design.a, design.b) + d
        gains.append(np.linalg.norm(response * to_units, 2))
    return np.array(gains)


def _isolation_verdicts(run: Recording) -> list[Finding]:
    """Whether, and how fast, each fault was named rightly."""
    found = []
    for fault in summarise(run)["faults"]:
        right = fault["isolated_as"] == fault["kind"]
        after = fault["isolated_s"] - fault["onset_s"] if right else None
        found.append(at_most(f"{fault['kind'].replace('_', ' ')} fault isolated after", "s", after, SETTLING_S))
    return found


def _onsets(run: Recording) -> tuple[float, float]:
    onset_n, onset_p = (fault["onset_s"] for fault in summarise(run)["faults"])
    return onset_n, onset_p


def _residuals(run: Recording) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Give r_N in rpm and r_p in kPa."""
    series = run.series
    return series["fdi/residual/compressor_speed:compressor"] / RPM, series["fdi/residual/evaporator_pressure"] / KPA


def _settled(run: Recording, onset_s: float, until_s: float = math.inf) -> NDArray[np.bool_]:
    mask: NDArray[np.bool_] = (run.time_s >= onset_s + SETTLING_S) & (run.time_s < until_s)
    return mask


def _worst(values: NDArray[np.float64], wanted: float) -> float:
    """Return the value that is furthest from the one wanted."""
    return float(values[np.argmax(np.abs(values - wanted))])


def _part_within(values: NDArray[np.float64], wanted: float, allowed: float) -> float:
    """Return the part of the ticks at which a value is no further than `allowed` from the one wanted."""
    return float(np.mean(np.abs(values - wanted) <= allowed))


def _peak(values: NDArray[np.float64]) -> float:
    return float(np.abs(values).max())


def _picture(title: str, run: Recording, beside: Recording | None, panels: tuple[str, ...]) -> str:
    return draw(charts_of(run, beside, panels), 2, title)


def _finite(finding: dict[str, Any]) -> dict[str, Any]:
    return {key: None if isinstance(item, float) and not math.isfinite(item) else item for key, item in finding.items()}
