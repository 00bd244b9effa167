"""What ``fdi/status`` says, typed both ways: as a row, and as the key-value pairs of a DiagnosticStatus."""

from typing import NamedTuple

from ac_common.errors import shortened
from ac_common.faults import ISOLABLE_KINDS, UNKNOWN

_THRESHOLDS = tuple(f"threshold/{kind}" for kind in ISOLABLE_KINDS)
#: What a fault can be isolated as.
_NAMES = frozenset((*ISOLABLE_KINDS, UNKNOWN))
#: How it is told of a fault that its name is unsure, sure, unsure again, and that it never was sure.
NOT_SURE, SURE, NO_LONGER = "not sure, not acted on", "is sure", "is sure no longer, not acted on"
NEVER_SURE = "never sure, not acted on"


class StatusRow(NamedTuple):
    """One message of ``fdi/status``: what the supervision of the residuals said at one tick.

    Times count from the first tick of the run. Nan stands for "not yet".
    """

    time_s: float
    detected: bool
    isolated: str | None  # a kind of fault that has a filter, "unknown", or None
    size: float  # estimate of the isolated fault, SI; nan for an unknown one
    onset_s: float
    isolated_s: float
    thresholds: tuple[float, ...]  # of the residuals, in the order of `ac_common.faults.ISOLABLE`, SI
    also_isolated: str | None = None  # with two faults isolated: the one before `isolated`
    unsure: str | None = None  # that of the isolated ones whose name may yet be the other's: nothing is done about it

    @property
    def acted_on(self) -> tuple[str | None, str | None]:
        """`isolated` and `also_isolated`, None in place of one that is unsure."""
        return acted_on(self.isolated, self.also_isolated, self.unsure)


def acted_on(isolated: str | None, also_isolated: str | None, unsure: str | None) -> tuple[str | None, str | None]:
    """Return what accommodation is to act on of what is isolated: all but what is unsure."""
    return None if isolated == unsure else isolated, None if also_isolated == unsure else also_isolated


def status_text(row: StatusRow) -> str:
    """Return the decision in words, for people who look at the topic."""
    if row.isolated is not None:
        named = f"{row.isolated}, {row.also_isolated}" if row.also_isolated else row.isolated
        return f"fault isolated: {named}" + (f"; {NOT_SURE}: {row.unsure}" if row.unsure else "")
    return "fault detected, not yet isolated" if row.detected else "no fault"


def status_values(row: StatusRow) -> dict[str, str]:
    """Return the key-value pairs of a row: numbers as the shortest text that reads back to the same bits."""
    return {
        "detected": "true" if row.detected else "false",
        "isolated": row.isolated or "",
        "also_isolated": row.also_isolated or "",
        "unsure": row.unsure or "",
        "size": repr(float(row.size)),
        "onset_s": repr(float(row.onset_s)),
        "isolated_s": repr(float(row.isolated_s)),
        **{key: repr(float(limit)) for key, limit in zip(_THRESHOLDS, row.thresholds, strict=True)},
    }


def status_row(values: dict[str, str], time_s: float) -> StatusRow:
    """Return the row of these key-value pairs; `time_s` counts from the first tick.

    Raises
    ------
    ValueError
        When they are not what `status_values` writes.
    """
    try:
        isolated, also_isolated = (values[key] or None for key in ("isolated", "also_isolated"))
        unsure = values.get("unsure") or None  # older recordings do not say
        for named in (isolated, also_isolated, unsure):
            if named is not None and named not in _NAMES:
                raise ValueError(named)
        return StatusRow(
            time_s=time_s,
            detected={"true": True, "false": False}[values["detected"]],
            isolated=isolated,
            size=float(values["size"]),
            onset_s=float(values["onset_s"]),
            isolated_s=float(values["isolated_s"]),
            thresholds=tuple([float(values[key]) for key in _THRESHOLDS]),
            also_isolated=also_isolated,
            unsure=unsure,
        )
    except (KeyError, ValueError) as problem:
        msg = f"fdi/status: {type(problem).__name__} {shortened(problem)}"
        raise ValueError(msg) from None
