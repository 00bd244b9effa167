"""What 40 rpm leave along random drives when they are known as soon as they show, beside what is left when detected.

    python -m docs.tools.envelope_known 50000 1000

Each drive is played to 1000 s without the fault, with K0 alone, with accommodation, and with a compensator that is told
the fault, without any error, from the first reading in which it shows: that of the tick after the onset. No detector
knows it earlier or better, so what is left then is not for the diagnosis to mend.
"""

import argparse
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ac_common.faults import ISOLABLE_KINDS
from ac_common.signals import Inlets, Measurement
from ac_common.units import KPA, RPM
from ac_experiments.designs import EnvelopeDesigns, designs_of
from ac_experiments.loop import Loop
from ac_experiments.recording import Recording
from ac_experiments.scenario import load
from ac_experiments.scenario_schema import Scenario
from ac_experiments.simulate import simulate
from ac_experiments.study.fault_free import LATE_S
from fdi_node.detector import Detection

DURATION_S, ONSET_S, SIZE_RPM = 1000.0, 600.0, 40.0
PLAIN = f"duration_s={DURATION_S:g}"
FAULT = f"faults=[{{kind: compressor_speed, size_rpm: {SIZE_RPM:g}, onset_s: {ONSET_S:g}}}]"
PLAYED = ("detected", "known at once", "K0 alone", "no fault")
MUCH_KPA, OFF_KPA = 1.0, 0.5


class Told(Loop):
    """The loop with a compensator that is told the fault; it has no detector."""

    def __init__(self, scenario: Scenario, designs: EnvelopeDesigns) -> None:
        super().__init__(scenario, designs, None, accommodate=True, diagnose=False)
        size = SIZE_RPM * RPM
        residual = tuple(size * (kind == "compressor_speed") for kind in ISOLABLE_KINDS)
        self._shows = round(ONSET_S / scenario.sample_time_s) + 1
        self._known = (residual, True, "compressor_speed", size)

    def _act(self, k: int, faults: Sequence[float], measured: Measurement, inlets: Inlets, found: Detection) -> None:
        if k >= self._shows:
            residual, detected, isolated, size = self._known
            found = found._replace(residual=residual, detected=detected, isolated=isolated, size=size)
        super()._act(k, faults, measured, inlets, found)


def told(scenario: Scenario, designs: EnvelopeDesigns) -> dict[str, NDArray[np.float64]]:
    """Return the series of a drive with a compensator that is told the fault."""
    loop = Told(scenario, designs)
    loop.run(lambda *_: None)
    return loop.series


def left(run: dict[str, NDArray[np.float64]], plain: Recording) -> tuple[float, float]:
    """Return the peak of the error of p_e since the onset, and how far p_e is off that of `plain` late, in kPa."""
    pressure = run["plant/evaporator_pressure"]
    error = np.abs(pressure - run["reference/evaporator_pressure"]) / KPA
    off = np.abs(pressure - plain.series["plant/evaporator_pressure"]) / KPA
    late = plain.time_s >= ONSET_S + LATE_S
    return float(error[plain.time_s >= ONSET_S].max()), float(off[late].max())


def played(seed: int) -> NDArray[np.float64]:
    """Return what is left of a drive with each of `PLAYED` (4, 2)."""
    drive, healthy = (load(f"drive:{seed}", [PLAIN, *more]) for more in ([FAULT], []))
    designs = designs_of(drive)
    assert isinstance(designs, EnvelopeDesigns)
    plain = simulate(healthy, True, designs=designs, diagnose=False)
    runs = (
        simulate(drive, designs=designs).series,
        told(drive, designs),
        simulate(drive, True, designs=designs, diagnose=False).series,
        plain.series,
    )
    return np.array([left(run, plain) for run in runs])


def main() -> None:
    """Print for both compensators in how many drives the peak is above others, and how far p_e is off late."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("first", type=int)
    parser.add_argument("count", type=int)
    given, rows = parser.parse_args(), []
    for seed in range(given.first, given.first + given.count):  # a second each
        rows.append(played(seed))
        each = ", ".join(f"{who} {peak:.2f}" for who, peak in zip(PLAYED, rows[-1][:, 0], strict=True))
        print(f"drive:{seed}: peak of the error of p_e, kPa: {each}", flush=True)
    peaks, off = np.moveaxis(np.array(rows), 2, 0)
    print(f"{given.count} drives, {SIZE_RPM:g} rpm; differences in kPa, the worst")
    for i, who in enumerate(PLAYED[:2]):
        over, more = peaks[:, i] - peaks[:, 2], peaks[:, i] - peaks[:, 3]
        print(
            f"{who}: peak above K0 alone's in {(over > 0.0).sum()}, by {over.max():.2f}; "
            f"more than {MUCH_KPA:g} above the drive's own in {(more > MUCH_KPA).sum()}, by {more.max():.2f}; "
            f"p_e off by more than {OFF_KPA:g} from {LATE_S:g} s on in {(off[:, i] > OFF_KPA).sum()}, "
            f"by {off[:, i].max():.2f}"
        )


if __name__ == "__main__":
    main()
