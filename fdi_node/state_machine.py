"""The state machine of `fdi_node.decision`, compiled: watches on the residuals, and what follows from them.

Times since when something holds are `inf` while it does not: later than every time.
"""

import math

from ac_common.faults import ISOLABLE_KINDS
from fdi_node.compiled import Array, jit
from fdi_node.reading_jumps import AWAY, N_READINGS, look_for_jump

NOT = math.inf
"""Time since when something holds that does not hold."""

N_RESIDUALS = len(ISOLABLE_KINDS)
QUIET, DETECTED, ISOLATED, UNKNOWN = range(4)
"""What the decision is at."""

# Layout of what it remembers, and of what it is made of (`fdi_node.decision.Supervision`).
PHASE, CHANGES, ONSET_S, DETECTED_S, AWAY_SINCE, BACK_SINCE, KNOWN = range(7)
"""Its state; how often what it concludes has changed; since when there is a detection, and when that was; since when a
reading is where it has jumped to, or back; how many faults are isolated."""
FAULTS = 7
"""Of each isolated fault the index of its residual, since when it is there, when it was isolated; in that order."""
FAULT, SINCE, WHEN = range(3)
WATCHES = FAULTS + 3 * N_RESIDUALS
"""Of each residual since when it is above its threshold, leads (its fault is the one), exceeds (it is more than the
other faults' cross-talk), is below (its fault is over), and whether the present detection is about it."""
ABOVE, LEADS, EXCEEDS, BELOW, UNDER_WAY = range(5)
N_WATCH = 5
RULES = WATCHES + N_WATCH * N_RESIDUALS
CONFIRM_S, ISOLATE_S, RATIO, UNDECIDED_S, ALSO_ISOLATE_S, CLEAR_RATIO, CLEAR_S, AFTERMATH_S = range(RULES, RULES + 8)
CROSS_TALK = RULES + 8
RATIOS = CROSS_TALK + N_RESIDUALS
"""`|r_i| / threshold_i` of each residual."""
JUMPS = RATIOS + N_RESIDUALS
"""The rest is that of `fdi_node.reading_jumps`."""


@jit
def _watch(m: Array, i: int, time_s: float) -> None:
    """Look at the i-th ratio of this tick, and at the largest one of the others."""
    w, ratio = m[WATCHES + N_WATCH * i : WATCHES + N_WATCH * (i + 1)], m[RATIOS + i]
    others = m[RATIOS + (i + 1) % N_RESIDUALS]
    for k in range(2, N_RESIDUALS):
        others = max(others, m[RATIOS + (i + k) % N_RESIDUALS])
    if ratio > 1.0:
        if w[ABOVE] == NOT:
            w[ABOVE] = time_s
        if not ratio > m[RATIO] * others:
            w[LEADS] = NOT
        elif w[LEADS] == NOT:
            w[LEADS] = time_s
        if not ratio > m[CROSS_TALK + i] * others:
            w[EXCEEDS] = NOT
        elif w[EXCEEDS] == NOT:
            w[EXCEEDS] = time_s
    elif w[ABOVE] != NOT:
        w[ABOVE] = w[LEADS] = w[EXCEEDS] = NOT
    if ratio >= m[CLEAR_RATIO]:
        w[BELOW] = NOT
    elif w[BELOW] == NOT:
        w[BELOW] = time_s
    if time_s - w[ABOVE] >= m[CONFIRM_S]:
        w[UNDER_WAY] = 1.0


@jit
def _go_to(m: Array, phase: int) -> None:
    m[PHASE] = phase
    m[CHANGES] += 1.0


@jit
def _rest(m: Array) -> None:
    """Go back to where nothing is detected."""
    m[ONSET_S] = NOT
    _go_to(m, QUIET)


@jit
def _begin(m: Array, time_s: float) -> None:
    """Begin a detection when a residual calls for it, with the first of those that it is about."""
    since, calls = NOT, False
    for i in range(N_RESIDUALS):
        w = m[WATCHES + N_WATCH * i :]
        if w[UNDER_WAY] != 0.0:
            since, calls = min(since, w[ABOVE]), True
    if calls:
        m[ONSET_S], m[DETECTED_S] = since, time_s
        _go_to(m, DETECTED)


@jit
def _look_anew(m: Array, time_s: float) -> None:
    """Begin with what the residuals say now, whatever they said before."""
    for i in range(N_RESIDUALS):
        w = m[WATCHES + N_WATCH * i :]
        w[UNDER_WAY] = 1.0 if time_s - w[ABOVE] >= m[CONFIRM_S] else 0.0
    _rest(m)
    _begin(m, time_s)


@jit
def _add(m: Array, residual: int, onset_s: float, time_s: float) -> None:
    """Add to the isolated faults."""
    fault = m[FAULTS + 3 * int(m[KNOWN]) :]
    fault[FAULT], fault[SINCE], fault[WHEN] = residual, onset_s, time_s
    m[KNOWN] += 1.0


@jit
def _is_known(m: Array, residual: int, known: int) -> bool:
    """Return whether the first `known` isolated faults have that of a residual among them."""
    found = False
    for k in range(known):
        found = found or m[FAULTS + 3 * k + FAULT] == residual
    return found


@jit
def _isolate(m: Array, time_s: float) -> None:
    """Add to the isolated faults those whose residuals now say so; not while a reading's jump is looked at."""
    known = int(m[KNOWN])
    if known == N_RESIDUALS or m[AWAY_SINCE] != NOT:
        return
    leads = known == 0 and time_s - m[DETECTED_S] < m[UNDECIDED_S]
    hold_s = m[ISOLATE_S] if leads else m[ALSO_ISOLATE_S]
    for i in range(N_RESIDUALS):
        w = m[WATCHES + N_WATCH * i : WATCHES + N_WATCH * (i + 1)]
        if not _is_known(m, i, known) and time_s - w[LEADS if leads else EXCEEDS] >= hold_s:
            _add(m, i, w[ABOVE] if m[KNOWN] > 0.0 else m[ONSET_S], time_s)
            w[UNDER_WAY] = 1.0
            _go_to(m, ISOLATED)


@jit
def _is_over(m: Array, i: int, time_s: float) -> bool:
    return bool(time_s - m[WATCHES + N_WATCH * i + BELOW] >= m[CLEAR_S])


@jit
def _end(m: Array, time_s: float) -> None:
    """Forget what is over; what then is left without an isolated fault is a detection of its own."""
    ends, under_way = False, False
    for i in range(N_RESIDUALS):
        w = m[WATCHES + N_WATCH * i : WATCHES + N_WATCH * (i + 1)]
        if _is_over(m, i, time_s):
            w[UNDER_WAY], ends = 0.0, True
        under_way = under_way or w[UNDER_WAY] != 0.0
    if not ends:
        return
    before, left = int(m[KNOWN]), 0
    for k in range(before):
        fault = m[FAULTS + 3 * k : FAULTS + 3 * (k + 1)]
        if not _is_over(m, int(fault[FAULT]), time_s):
            for j in range(3):
                m[FAULTS + 3 * left + j] = fault[j]
            left += 1
    m[KNOWN] = left
    if before > 0 and left == 0:
        _look_anew(m, time_s)
    elif not under_way:
        _rest(m)
    else:
        m[CHANGES] += 1.0


@jit
def _follow_jump(m: Array, time_s: float) -> None:
    """Note since when a reading is where it has jumped to, or back."""
    is_away = False
    for i in range(N_READINGS):
        is_away = is_away or m[JUMPS + AWAY + i] != 0.0
    if is_away:
        m[AWAY_SINCE], m[BACK_SINCE] = min(m[AWAY_SINCE], time_s), NOT
    else:
        m[AWAY_SINCE], m[BACK_SINCE] = NOT, time_s


@jit
def _enter_unknown(m: Array) -> None:
    """Isolate a fault that no filter is for; the residuals of the others say nothing while it is there."""
    m[ONSET_S] = m[AWAY_SINCE]
    _go_to(m, UNKNOWN)


@jit
def _leave_unknown(m: Array, time_s: float) -> None:
    """Let the unknown fault be over when no residual, or not its reading, has told of it for long enough."""
    small_since = m[FAULTS + WHEN]
    for i in range(N_RESIDUALS):
        small_since = max(small_since, m[WATCHES + N_WATCH * i + BELOW])
    if time_s - small_since < m[CLEAR_S] and time_s - m[BACK_SINCE] < m[AFTERMATH_S]:
        return
    m[KNOWN] = 0.0
    m[AWAY_SINCE] = m[BACK_SINCE] = NOT
    for i in range(N_READINGS):
        m[JUMPS + AWAY + i] = 0.0
    _look_anew(m, time_s)


@jit
def conclude(m: Array, time_s: float, p_e: float, superheat: float, wall: float) -> int:
    """Take the ratios in the memory and the readings of a tick; return `CHANGES`."""
    if look_for_jump(m[JUMPS:], p_e, superheat, wall):
        _follow_jump(m, time_s)
    for i in range(N_RESIDUALS):
        _watch(m, i, time_s)
    phase = m[PHASE]
    if phase != UNKNOWN and time_s - m[AWAY_SINCE] >= m[CONFIRM_S]:
        m[KNOWN] = 0.0
        _add(m, -1, m[AWAY_SINCE], time_s)
        _enter_unknown(m)
    elif phase == QUIET:
        _begin(m, time_s)
    elif phase == UNKNOWN:
        _leave_unknown(m, time_s)
    else:
        _isolate(m, time_s)
        _end(m, time_s)
    return int(m[CHANGES])
