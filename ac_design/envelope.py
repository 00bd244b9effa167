"""The design of observer and decision over the whole envelope: nothing in it depends on an operating point."""

import math
from collections.abc import Sequence
from dataclasses import astuple, dataclass, field

import numpy as np

from ac_common.errors import UserError
from ac_common.sample_time import LONGEST_SAMPLE_TIME_S, SHORTEST_SAMPLE_TIME_S
from ac_plant_node import POINTS, load_parameters, operating_point
from ac_plant_node.dynamics.drive import held_inputs
from ac_plant_node.inputs import N_INPUTS
from ac_plant_node.properties.tables import REFRIGERANTS
from fdi_node.envelope import EnvelopeDesign, Limits
from fdi_node.envelope.unknowns import PARAMETERS, UNKNOWNS

SENSORS = ("p_e", "superheat", "T_w", "p_c")
"""Readings that the observer can use; the first two it must."""
KNOWN, IF_NEEDED, ESTIMATED = PARAMETER_CHOICES = ("known", "if_needed", "estimated")
"""What of the plant's parameters: `design_envelope_fdi`."""

NONE, BLOWER = AIR_FLOW_SENSORS = ("none", "blower")
"""What is known of the air flow through the evaporator: `design_envelope_fdi`."""

_BLOWER_FIRST, _BLOWER_DRIFT = 0.03, 0.002
"""By what share the flow may be off what a known blower is told to give, and how fast that changes, per sqrt(s)."""
_STATE_NOISE = 0.1 * np.array([1e-5, 5.0, 20.0, 0.003, 0.002, 0.0, 50.0, 2e-4, 20.0, 0.003, 0.002, 0.002])


@dataclass(frozen=True)
class EnvelopeWeights:
    """What the observer is told about noise.

    Attributes
    ----------
    reading_std : tuple of float
        Of p_e [Pa], SH [K], T_w [K], p_c [Pa].
    state_noise : tuple of float
        Intensities of the process noise of the integration vector, per sqrt(s).
    rate_share : float
        By what share of its own rate a state may go elsewhere, for about a second.
    limits : Limits
        Of the decision.
    """

    reading_std: tuple[float, ...] = (200.0, 0.1, 0.05, 2000.0)
    state_noise: tuple[float, ...] = tuple(_STATE_NOISE.tolist())
    rate_share: float = 0.04
    limits: Limits = field(default_factory=Limits)


def design_envelope_fdi(
    sample_time_s: float,
    sensors: Sequence[str] = SENSORS,
    parameters: str = IF_NEEDED,
    superheat: str = "direct",
    air_flow: str = "none",
    weights: EnvelopeWeights | None = None,
) -> EnvelopeDesign:
    """Return observer and decision over the whole envelope.

    Parameters
    ----------
    sample_time_s : float
        0.01 to 0.1 s.
    sensors : sequence of str
        Out of `SENSORS`, with "p_e" and "superheat" among them. Without "p_c" the condenser's air flow is taken as
        known, the parameters' own, but for jumps of it.
    parameters : str
        Out of `PARAMETER_CHOICES`: the plant's are `KNOWN`; or they are `ESTIMATED` from the start, at the price of
        small faults; or that only `IF_NEEDED`, when the plant turns out to be another one in the first minute.
    superheat : str
        "direct", or "derived" from an outlet temperature and the measured pressure.
    air_flow : str
        What is known of the air flow through the evaporator: "none", or "blower": its nominal flow is told, which the
        true one follows within some per cent.
    weights : EnvelopeWeights, optional

    Raises
    ------
    UserError
        For a sample time out of range, sensors or a choice that there are not.
    """
    if not (math.isfinite(sample_time_s) and SHORTEST_SAMPLE_TIME_S <= sample_time_s <= LONGEST_SAMPLE_TIME_S):
        allowed = f"{SHORTEST_SAMPLE_TIME_S:g} to {LONGEST_SAMPLE_TIME_S:g} s"
        raise UserError(f"sample time {sample_time_s:g} s: designs exist for {allowed}")
    if not set(sensors) <= set(SENSORS) or not {"p_e", "superheat"} <= set(sensors):
        raise UserError(f"sensors {', '.join(sensors)}: allowed are p_e, superheat and any of {', '.join(SENSORS[2:])}")
    if parameters not in PARAMETER_CHOICES:
        raise UserError(f"parameters {parameters!r}: allowed are {', '.join(PARAMETER_CHOICES)}")
    weights = weights or EnvelopeWeights()
    plant, rests = load_parameters(), [operating_point(name) for name in POINTS]
    if air_flow not in AIR_FLOW_SENSORS:
        raise UserError(f"air flow sensor {air_flow!r}: allowed are {', '.join(AIR_FLOW_SENSORS)}")
    known = set() if "p_c" in sensors else {"condenser_air_flow"}
    unknowns = [
        one._replace(first=0.0, drift=0.0)
        if one.name in known
        else one._replace(first=_BLOWER_FIRST, drift=_BLOWER_DRIFT)
        if one.name == "evaporator_air_flow" and air_flow == BLOWER
        else one
        for one in UNKNOWNS + (PARAMETERS if parameters != KNOWN else ())
    ]
    return EnvelopeDesign(
        parameters=plant.values,
        refrigerant=float(REFRIGERANTS.index(plant.refrigerant)),
        start_states=np.array([rest.conserved for rest in rests]),
        start_inputs=np.array([held_inputs(rest.inputs, plant)[:N_INPUTS] for rest in rests]),
        start_outputs=np.array([rest.outputs for rest in rests]),
        used=np.array([float(name in sensors) for name in SENSORS]),
        reading_std=np.array(weights.reading_std),
        state_noise=np.array(weights.state_noise),
        rate_share=weights.rate_share,
        first=np.array([one.first for one in unknowns]),
        drift=np.array([one.drift for one in unknowns]),
        opened=float(parameters == ESTIMATED),
        derived=float(superheat == "derived"),
        blower=float(air_flow == BLOWER),
        limits=np.array(astuple(weights.limits)),
        sample_time_s=sample_time_s,
    )
