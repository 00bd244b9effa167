"""What happens in one run of a campaign: picked from a seed and nothing else, so a failing seed can be run again."""

import random
from dataclasses import dataclass
from typing import Literal

from ac_common.errors import UserError
from ac_common.topics import COMPENSATOR, CONTROLLER, FDI, INJECTOR, RECORDER, SCENARIO
from ac_experiments.scenario import check
from ac_experiments.scenario_schema import Scenario

ProcessFaultKind = Literal["kill", "stop"]
MessageFaultKind = Literal["lost", "late", "twice", "nan", "wrong_unit", "out_of_range"]

#: The plant is left out: it sets the pace, and its death is the end of a run.
VICTIMS = (FDI, COMPENSATOR, CONTROLLER, INJECTOR, SCENARIO, RECORDER)
MESSAGE_FAULTS: tuple[MessageFaultKind, ...] = ("lost", "late", "twice", "nan", "wrong_unit", "out_of_range")
#: Process faults lie so far apart that one is over before the next begins, s.
APART_S = 7.0
#: Nothing happens before, so that there is a run to disturb, nor near the end, so that its effect can be seen, s.
START_S, END_S = 3.0, 7.0
SHORTEST_S = 12.0


@dataclass(frozen=True)
class ProcessFault:
    """``kill -9`` of a node, or a stop (SIGSTOP) for `lasts_s`."""

    at_s: float
    node: str
    kind: ProcessFaultKind
    lasts_s: float = 0.0

    def __str__(self) -> str:
        lasts = f" {self.lasts_s:.1f} s" if self.kind == "stop" else ""
        return f"{self.kind} {self.node}{lasts} at {self.at_s:.1f} s"


@dataclass(frozen=True)
class MessageFault:
    """From `start_s` to `end_s` a `share` of the messages that leave the injector suffers.

    ``lost``: not sent; ``late``: sent up to 150 ms later; ``twice``: sent again at once; ``nan``: not a number;
    ``wrong_unit``: the pressure in kPa, temperatures in K, speeds in rpm; ``out_of_range``: far too large.
    """

    kind: MessageFaultKind
    share: float
    start_s: float
    end_s: float

    def __str__(self) -> str:
        return f"{self.share:.0%} {self.kind} {self.start_s:.0f}-{self.end_s:.0f} s"


@dataclass(frozen=True)
class Plan:
    """One run of a campaign."""

    seed: int
    scenario: Scenario
    processes: tuple[ProcessFault, ...]
    messages: tuple[MessageFault, ...]

    def lines(self) -> list[str]:
        """Return, in words, everything that happens."""
        plant = [
            f"{one.fault.symbol} {one.size / one.fault.si:+.1f} {one.fault.unit} {one.profile} at {one.onset_s:.0f} s"
            for one in self.scenario.faults
        ]
        return [*plant, *map(str, self.processes), *map(str, self.messages)]


def plan(seed: int, duration_s: float = 24.0) -> Plan:
    """Pick what happens in the run of a seed.

    Parameters
    ----------
    seed
        The same seed and duration give the same plan, on every machine.
    duration_s
        Length of the run, at least 12 s.

    Raises
    ------
    UserError
        When the duration is too short for anything to happen.
    """
    if not SHORTEST_S <= duration_s <= 3600.0:
        msg = f"a campaign's run of {duration_s:g} s; allowed: {SHORTEST_S:g} to 3600 s"
        raise UserError(msg)
    rng = random.Random(f"acftc campaign {seed}")
    last_s = duration_s - END_S
    return Plan(
        seed=seed,
        scenario=_scenario(rng, seed, duration_s),
        processes=_process_faults(rng, last_s),
        messages=_message_faults(rng, last_s),
    )


def _scenario(rng: random.Random, seed: int, duration_s: float) -> Scenario:
    faults = []
    for kind, size, largest in (("compressor_speed", "size_rpm", 60.0), ("evaporator_pressure", "size_kpa", 6.0)):
        if rng.random() < 0.7:
            sign = rng.choice((-1.0, 1.0))
            fault = {
                "kind": kind,
                size: round(sign * rng.uniform(0.3, 1.0) * largest, 1),
                "onset_s": round(rng.uniform(1.0, 0.6 * duration_s), 1),
                "profile": rng.choice(("step", "ramp", "sine", "drift")),
            }
            faults.append(fault)
    reference = {"at_s": 2.0, "to": round(rng.uniform(-3, 3), 1), "ramp_s": 8.0}
    air = {"at_s": round(rng.uniform(2, 10), 1), "to": round(rng.uniform(-5, 5), 1)}
    noise = {"evaporator_pressure_kpa": 0.02, "superheat_k": 0.02, "wall_temperature_k": 0.02}
    return check(
        {
            "name": f"campaign_{seed}",
            "description": f"seed {seed} of a fault campaign",
            "operating_point": rng.choice(("low", "med", "high")),
            "duration_s": duration_s,
            "references": {"evaporator_pressure_kpa": [reference]},
            "air": {"mass_flow_percent": [air]},
            "faults": faults,
            "noise": {**noise, "seed": seed},
        }
    )


def _process_faults(rng: random.Random, last_s: float) -> tuple[ProcessFault, ...]:
    found = []
    at_s = START_S + rng.uniform(0.0, 2.0)
    victims = list(VICTIMS)
    while round(at_s, 1) < last_s and victims:
        node = victims.pop(rng.randrange(len(victims)))
        kind: ProcessFaultKind = "kill" if rng.random() < 0.6 else "stop"
        lasts_s = round(rng.uniform(0.5, 5.0), 1) if kind == "stop" else 0.0
        found.append(ProcessFault(round(at_s, 1), node, kind, lasts_s))
        at_s += APART_S + rng.uniform(0.0, 3.0)
    return tuple(found)


def _message_faults(rng: random.Random, last_s: float) -> tuple[MessageFault, ...]:
    found = []
    for kind in rng.sample(MESSAGE_FAULTS, rng.randint(1, 3)):
        start_s = rng.uniform(1.0, last_s)
        found.append(MessageFault(kind, round(rng.uniform(0.05, 0.4), 2), round(start_s, 1), round(start_s + 4.0, 1)))
    return tuple(found)
