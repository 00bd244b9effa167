"""The loop with the designs of the whole envelope: ordinary ticks in compiled code, all others as `Loop` does them."""

import contextlib
from collections.abc import Callable, Iterable
from functools import partial
from itertools import repeat
from pathlib import Path
from typing import Any

import numpy as np

from ac_common.cache import compiled_folder
from ac_common.compiled import ready
from ac_common.faults import COMPONENT_KINDS, ISOLABLE_KINDS, KINDS, STICKING
from ac_common.fdi_status import StatusRow
from ac_common.signals import READINGS as SENSORS
from ac_common.signals import Inlets, Measurement
from ac_common.topics import COMPENSATOR, CONTROLLER
from ac_experiments.loop import PROGRESS_EVERY, Loop, Progress
from ac_experiments.ordinary_ticks import (
    CONCLUDE,
    GIVE_UP,
    LOST,
    MOVE,
    SENSE,
    SOURCES,
    ordinary_ticks,
)
from ac_experiments.tick_columns import FAULTS, INLETS_READ, READINGS, RESIDUAL, STUCK
from ac_plant_node import Plant
from ac_plant_node.dynamics.telling import N_OUTPUTS
from ac_plant_node.plant import handed_over
from ac_plant_node.saturation import saturation_curve
from fault_injector_node.injector import STICKING_FAULTS, components_of_all
from fdi_node.envelope import EnvelopeDetector
from gimc_controller_node.envelope_compensator import AT_LIMIT, HARMFUL, EnvelopeCompensator

_OF_THE_VALVE = [COMPONENT_KINDS.index(kind) for kind in ("valve_stuck", "valve_slow")]
_SAYS = ("", AT_LIMIT, HARMFUL)
"""What a compensator announces, by the numbers of `ordinary_ticks`."""


def is_compiled() -> bool:
    """Return whether the code of a `CompiledLoop` is in the cache; to make it takes ten seconds."""
    return _mark().exists()


def _mark() -> Path:
    return compiled_folder(*SOURCES) / "complete"


class CompiledLoop(Loop):
    """A loop whose ordinary ticks are those of `ac_experiments.ordinary_ticks`."""

    def __init__(self, *given: Any, **more: Any) -> None:
        super().__init__(*given, **more)
        self._thresholds, self._said = np.empty((len(self.made), 2)), np.zeros((len(self.made), 2))
        self._ordinary = self._prepared()

    def run_compiled(self, progress: Progress) -> bool:
        """Do all ticks, and return whether that could be done: if not, what `Loop.run` does with another loop holds."""
        if self._ordinary is None:
            return False
        self.tick(0)
        self._before[:] = self._injector.read_before
        k, ticks = 1, len(self.made)
        while k < ticks:
            k, why = self._go_on(k, min(k - k % PROGRESS_EVERY + PROGRESS_EVERY, ticks))
            if why == GIVE_UP:
                return False
            if why == CONCLUDE:
                self._conclude(k)
                k += 1
            if k % PROGRESS_EVERY == 0:
                progress(k, ticks)
        progress(ticks, ticks)
        with contextlib.suppress(OSError):  # a cache that cannot be written costs time, and nothing else
            _mark().touch()
        return True

    def _prepared(self) -> Callable[[int, int, int], tuple[int, int]] | None:
        """Return `ordinary_ticks` as a function of its first three arguments; None where no tick is ordinary."""
        plant, detector, compensator, controller = self._plant, self._detector, self._compensator, self._controller
        plan, ticks, k0 = self.schedule, len(self.made), controller.limited.k0
        sizes = components_of_all(plan.faults)
        if not (isinstance(plant, Plant) and isinstance(detector, EnvelopeDetector)):
            return None
        if k0 is None or not isinstance(compensator, EnvelopeCompensator):
            return None
        self.made[:, FAULTS:] = np.hstack([sizes, plan.faults[:, [KINDS.index(fault.kind) for fault in STICKING]]])
        changes = np.zeros(ticks)
        changes[1:] = (sizes[1:] != sizes[:-1]).any(axis=1) | sizes[1:, _OF_THE_VALVE].any(axis=1)
        self._observer, self._air, self._before = detector, np.zeros(2), np.zeros(len(SENSORS))
        references, saturation = controller.references, saturation_curve() if self._injector.is_derived else np.empty(0)
        shared = (
            *(self._sample_time_s, references.constants, saturation),
            *(*detector.compiled, detector.curve, self._reads_air),
            *(compensator.memory, compensator.curve, compensator.n_states, int(compensator.accommodate)),
            *(controller.limited.memory, k0.memory, k0.n_states, references.curve, controller.caps, controller.guards),
            *(*handed_over(plant), self._air, self._before),
            *(self._injector.noise(ticks), plan.reference, plan.faults, plan.stuck, changes, plan.air),
            *(self.made, self._thresholds, self._said),
        )
        run, self._results = ready(ordinary_ticks), handed_over(plant)[-1]
        diagnoses = int(self._unseen is None)
        return lambda first, last, stage: run(first, last, stage, int(controller.is_ordinary), diagnoses, *shared)

    def _go_on(self, first: int, last: int) -> tuple[int, int]:
        """Do ordinary ticks up to one that is not; return it, or `last`, and why it ends there."""
        assert self._ordinary is not None
        self._air[:] = self._inlets
        k, why = self._ordinary(first, last, SENSE)
        while why == LOST:
            self._observer.begin_anew()
            k, why = self._ordinary(k, last, MOVE)
        self._outputs, self._inlets = self._results[:N_OUTPUTS].tolist(), (float(self._air[0]), float(self._air[1]))
        if k > first:
            self._take_note(first, k)
        return k, why

    def _take_note(self, first: int, last: int) -> None:
        """Record and announce what ordinary ticks have left behind, and let the blocks go on from there."""
        if self._unseen is None:
            self._note_status(first, last)
        says = {COMPENSATOR: _SAYS, CONTROLLER: self._controller.words}
        said = self._said[first:last].astype(int)
        changed = np.flatnonzero((said[1:] != said[:-1]).any(axis=1)) + 1
        for tick in (0, *changed.tolist()):
            for (node, words), number in zip(says.items(), said[tick].tolist(), strict=True):
                if words[number] != self._does[node]:
                    self._announce(self._times[first + tick], node, words[number])
        self._controller.follow(int(said[-1, 1]))

    def _note_status(self, first: int, last: int) -> None:
        """Record what the detector says in ordinary ticks."""
        times = self._times[first:last]
        _, detected, isolated, _, onset_s, isolated_s, also, unsure = self._observer.follow(times[0], times[-1])
        sizes: Iterable[float] = repeat(np.nan)
        thresholds = zip(*self._thresholds[first:last].T.tolist(), strict=True)
        if isolated in ISOLABLE_KINDS:
            sizes = self.made[first:last, RESIDUAL + ISOLABLE_KINDS.index(isolated)].tolist()
        found, since = (repeat(detected), repeat(isolated)), (repeat(onset_s), repeat(isolated_s))
        rows = zip(times, *found, sizes, *since, thresholds, repeat(also), repeat(unsure), strict=False)
        self.status += map(partial(tuple.__new__, StatusRow), rows)  # as `_make`, in half the time

    def _conclude(self, k: int) -> None:
        """Do the rest of a tick in which the observer has taken the readings."""
        row = self.made[k].tolist()
        measured, inlets = Measurement(*row[READINGS:INLETS_READ]), Inlets(*row[INLETS_READ : INLETS_READ + 2])
        faults = self.schedule.faults[k].tolist()
        for (fault, _), size in zip(STICKING_FAULTS, row[STUCK:], strict=True):
            faults[fault] = size
        air = self.schedule.air[k, : self._reads_air].tolist()
        found = self._unseen or self._observer.conclude(self._times[k], *inlets, *air)
        self._act(k, faults, measured, inlets, found)
