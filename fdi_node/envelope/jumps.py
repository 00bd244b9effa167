"""Likelihoods of jumps in what the observer estimates, and of one that grows.

Generalised likelihood ratios of Willsky & Jones (IEEE TAC 21(1), 1976, 108); the sensitivities are those of the bias
filter in Friedland (IEEE TAC 14(4), 1969, 359). Had unknown h jumped by v when a window began, the filter's error would
be V_h v more and its innovation G_h v with G = C V, both by the filter's own recursion:

    V <- V - K G,  V <- F V;    S <- S + G^2 / s,  d <- d + G f_e / s     (s: variance of f_e)

so ``d_h^2 / S_h`` is twice the log-likelihood ratio of "h has jumped" to "nothing has", and ``d_h / S_h`` its size.
What jumps has a prior variance, which adds its inverse to S. A valve that is stuck has no size to be found: its
opening is off by what the command has done since, and the ratio is ``2 d - S``. For a sensor that drifts v is the rate:
V_h is 0 at first, and its own row gains a tick's share in each tick. Small jumps of the pressure's sensor and of the
compressor's speed, and steps of the air flow, differ by their first ticks, so for these every tick is a possible
beginning. When an air flow has jumped, S and d of what had begun before go back to what they were then, and V goes on:
a fault that was in doubt stays so.
"""

import numpy as np

from ac_plant_node.dynamics.balances import N_STATES
from ac_plant_node.dynamics.drive import OPENING
from fdi_node.envelope.compiled import Array, jit
from fdi_node.envelope.memory import (
    ABRUPT,
    LARGEST,
    N_BEGINNINGS,
    N_ONSETS,
    N_WINDOWS,
    NOT_KNOWN,
    OFF,
    TICKS,
    Memory,
    Rules,
    Single,
)
from fdi_node.envelope.model import PLACE, POSITION, READING, READING_SCALE, SCALE
from fdi_node.envelope.products import multiply, terms

SHORTEST_S, LONGEST_S = 1, 128
"""Window w is SHORTEST_S 2^w seconds long, and begins when another one is half full."""
TELLING, SPEAKING = 20.0, 36.0
"""A window whose largest ratio is beyond the first is kept for up to LONGEST_S; what startles does not begin the last
window anew when its ratio is beyond the second."""
STARTLING = 6.0
"""An innovation of this many standard deviations begins the last window."""
LINEARISED = 0.4
"""What linearisation may leave of a jump in the estimate, as a share of it."""
LARGEST_JUMP = 2.0
"""No jump is larger than this many of its prior standard deviations. Without a limit an absurdly large one, some ticks
ago, would explain a reading's jump nearly as well as that does."""
UNSEEN = 4.0
"""By how many standard deviations of the difference of two readings a jump of p_e may differ from what was seen in its
tick. The observer's own innovation may tell little of that: after a step of the blower it believes a reading."""


@jit
def _column(beginning: int, h: int, q: int) -> int:
    """Column of V of a beginning, a window or one of the onsets behind them, and of the h-th that may jump."""
    return beginning * q + h if beginning < N_WINDOWS else N_WINDOWS * q + beginning - N_WINDOWS


@jit
def _abrupt(onset: int) -> int:
    """Which of those that may jump an onset is of."""
    return ABRUPT[(onset - N_WINDOWS) // (N_ONSETS + 1)]


@jit
def _begin_column(m: Memory, rules: Rules, at: int, h: int) -> None:
    """Let a column of V that is zero begin with a jump of its unknown."""
    if rules.prior[h] >= 0.0 and rules.growing[h] == 0.0:
        m.V[N_STATES + int(rules.jumping[h]), at] = 1.0
    m.S[at] = m.d[at] = 0.0


@jit
def begin(m: Memory, rules: Rules, window: int) -> None:
    """Begin a window anew: what jumps would do so now."""
    q = rules.jumping.shape[0]
    first, last = window * q, (window + 1) * q
    for i in range(m.V.shape[0]):
        for at in range(first, last):
            m.V[i, at] = 0.0
    for h in range(q):
        _begin_column(m, rules, first + h, h)
    m.age[window] = m.telling[window] = 0.0
    m.opening[window] = m.held[OPENING]


@jit
def _begin_onset(m: Memory, rules: Rules, tick: int) -> None:
    """Begin with the abrupt jumps in this tick; one that gives way is kept if it is the likeliest so far."""
    q = rules.jumping.shape[0]
    for a, h in enumerate(ABRUPT):
        first = N_WINDOWS + a * (N_ONSETS + 1)
        onset, kept = first + tick % N_ONSETS, first + N_ONSETS
        at, to = _column(onset, h, q), _column(kept, h, q)
        too_old = m.age[kept] * rules.constants[0] > LONGEST_S
        if too_old or _ratio(m, rules, onset, h) > _ratio(m, rules, kept, h):
            for i in range(m.V.shape[0]):
                m.V[i, to] = m.V[i, at]
            m.S[to], m.d[to], m.age[kept], m.seen[kept] = m.S[at], m.d[at], m.age[onset], m.seen[onset]
        for i in range(m.V.shape[0]):
            m.V[i, at] = 0.0
        _begin_column(m, rules, at, h)
        m.age[onset] = 0.0


@jit
def forget(m: Memory, rules: Rules, ticks: int) -> None:
    """Take back what the last ticks told, at most `N_ONSETS`; else, and where it has begun since, begin anew."""
    if ticks > N_ONSETS:
        begin_all(m, rules)
        return
    q, slot = rules.jumping.shape[0], int(m.scalars[TICKS] - ticks) % N_ONSETS
    for at in range(m.S.shape[0]):
        m.S[at], m.d[at] = m.past[slot, 0, at], m.past[slot, 1, at]
    for beginning in range(N_BEGINNINGS):
        if m.age[beginning] >= ticks:
            continue
        if beginning < N_WINDOWS:
            begin(m, rules, beginning)
            continue
        at = _column(beginning, 0, q)
        for i in range(m.V.shape[0]):
            m.V[i, at] = 0.0
        _begin_column(m, rules, at, _abrupt(beginning))
        m.age[beginning] = 0.0


@jit
def told_before(m: Memory, rules: Rules, h: int) -> float:
    """Return the largest ratio of another jump before the h-th, as its likeliest beginning is; 0: too long ago."""
    ticks, q, largest = m.age[int(m.best[h])], rules.jumping.shape[0], 0.0
    if ticks > N_ONSETS:
        return largest
    then = m.past[int(m.scalars[TICKS] - ticks) % N_ONSETS]
    for beginning in range(N_BEGINNINGS):
        for other in range(q):
            is_looked_for = beginning < N_WINDOWS or other == _abrupt(beginning)
            if other != h and is_looked_for:
                at = _column(beginning, other, q)
                limits = _limits(rules, other, then[2, beginning])
                ratio = _ratio_of(then[0, at], then[1, at], rules.prior[other], limits)
                largest = max(largest, ratio)
    return largest


@jit
def begin_all(m: Memory, rules: Rules) -> None:
    """Begin all windows anew."""
    for window in range(N_WINDOWS):
        begin(m, rules, window)
    q = rules.jumping.shape[0]
    for i in range(m.V.shape[0]):
        for at in range(N_WINDOWS * q, m.V.shape[1]):
            m.V[i, at] = 0.0
    for onset in range(N_WINDOWS, N_BEGINNINGS):
        _begin_column(m, rules, _column(onset, 0, q), _abrupt(onset))
        m.age[onset] = 0.0


@jit
def begin_due(m: Memory, rules: Rules, tick: int) -> None:
    """Begin the windows whose turn it is, and the last one when an innovation startles."""
    per_second = round(1.0 / rules.constants[0])
    half, rest = divmod(tick, per_second * SHORTEST_S // 2)
    if rest == 0:
        for window in range(N_WINDOWS - 1):
            kept = m.telling[window] > TELLING and m.age[window] < LONGEST_S * per_second
            if half % 2 ** (window + 1) == 2**window and not kept:
                begin(m, rules, window)
    last, startled = N_WINDOWS - 1, False
    for r in range(m.e.shape[0]):
        startled = startled or abs(m.e[r]) > STARTLING * m.s[r]
    if startled and m.age[last] > per_second and m.telling[last] <= SPEAKING:
        begin(m, rules, last)
    _begin_onset(m, rules, tick)
    now = m.past[tick % N_ONSETS]
    for at in range(m.S.shape[0]):
        now[0, at], now[1, at] = m.S[at], m.d[at]
    for beginning in range(N_BEGINNINGS):
        now[2, beginning] = m.seen[beginning]
    for beginning in range(N_BEGINNINGS):
        if m.age[beginning] == 0.0:  # what jumps then shows in this tick
            m.seen[beginning] = m.scalars[OFF]
        m.age[beginning] += 1.0


@jit
def follow(m: Memory, G: Single, e: float, s: float) -> None:
    """Take one reading: what jumps do to its innovation (w,), the innovation e, of variance s."""
    per_variance = 1.0 / s
    for j in range(G.shape[0]):
        f = G[j] * per_variance
        m.S[j] += f * G[j]
        m.d[j] += f * e


@jit
def propagate(m: Memory, rules: Rules, opening: float) -> None:
    """Go on to the next tick: V <- F V; `opening`: the valve's, as commanded."""
    w = m.V.shape[1]
    q = rules.jumping.shape[0]
    for h in range(q):
        if rules.prior[h] < 0.0:
            at = int(rules.jumping[h])
            for window in range(N_WINDOWS):
                m.V[N_STATES + at, window * q + h] = (m.opening[window] - opening) / rules.rows[at, SCALE]
    count = terms(rules.rows, m.P, True, m.columns)
    multiply(m.F, m.V, m.columns, count, w, m.FV)
    for i in range(N_STATES):
        for j in range(w):
            m.V[i, j] = m.FV[i, j]
    for h in range(q):
        if rules.growing[h] != 0.0:
            own = N_STATES + int(rules.jumping[h])
            for window in range(N_WINDOWS):
                m.V[own, window * q + h] += rules.constants[0]


@jit
def judge(m: Memory, rules: Rules) -> None:
    """Find for each jump the window in which it is the likeliest, and its ratio there."""
    q = rules.jumping.shape[0]
    m.scalars[LARGEST] = -np.inf
    for h in range(q):
        m.ratios[h] = -np.inf
    for window in range(N_WINDOWS):
        m.telling[window] = -np.inf
    for window in range(N_WINDOWS):
        for h in range(q):
            ratio = _ratio(m, rules, window, h)
            m.telling[window] = max(m.telling[window], ratio)
            if ratio > m.ratios[h]:
                m.ratios[h], m.best[h] = ratio, window
    for onset in range(N_WINDOWS, N_BEGINNINGS):
        h = _abrupt(onset)
        ratio = _ratio(m, rules, onset, h)
        if ratio > m.ratios[h]:
            m.ratios[h], m.best[h] = ratio, onset
    for h in range(q):
        m.scalars[LARGEST] = max(m.scalars[LARGEST], m.ratios[h])


@jit
def _limits(rules: Rules, h: int, seen: float) -> tuple[float, float]:
    """Return the least and the largest size of the h-th jump; `seen`: how far the reading of p_e moved in its tick."""
    row, most = rules.rows[int(rules.jumping[h])], rules.most[h]
    is_pressure = int(row[PLACE]) == READING and int(row[POSITION]) == 0 and rules.growing[h] == 0.0
    if not is_pressure or seen == NOT_KNOWN:
        return -most, most
    unit, apart = READING_SCALE[0] / row[SCALE], UNSEEN * np.sqrt(2.0 * rules.R[0])
    return max((seen - apart) * unit, -most), min((seen + apart) * unit, most)


@jit
def _size(S: float, d: float, prior: float, limits: tuple[float, float]) -> float:
    """Return the likeliest size of a jump."""
    return float(min(max(d / (S + prior), limits[0]), limits[1]))


@jit
def _ratio_of(S: float, d: float, prior: float, limits: tuple[float, float]) -> float:
    if prior < 0.0:
        return 2.0 * d - S
    size = _size(S, d, prior, limits)
    return size * (2.0 * d - size * (S + prior))


@jit
def _ratio(m: Memory, rules: Rules, beginning: int, h: int) -> float:
    """Return the likelihood ratio of the h-th jump since a beginning."""
    at = _column(beginning, h, rules.jumping.shape[0])
    return float(_ratio_of(m.S[at], m.d[at], rules.prior[h], _limits(rules, h, m.seen[beginning])))


@jit
def accept(m: Memory, rules: Rules, h: int, is_fault: bool, dz: Array) -> None:
    """Work out how far the estimate is off, `dz` (n,), when the h-th that may jump has done so; begin all windows anew.

    What is no fault leaves what was told before of others. P grows by V S^-1 V', as if its variance had been infinite
    when the window began, and by what linearisation may have left out.
    """
    n, beginning = m.P.shape[0], int(m.best[h])
    at = _column(beginning, h, rules.jumping.shape[0])
    for i in range(n):
        dz[i] = 0.0
    if rules.prior[h] >= 0.0:
        total = m.S[at] + rules.prior[h]
        size = _size(m.S[at], m.d[at], rules.prior[h], _limits(rules, h, m.seen[beginning]))
        for i in range(n):
            dz[i] = m.V[i, at] * size
            for j in range(n):
                m.P[i, j] += float(m.V[i, at]) * float(m.V[j, at]) / total
        for i in range(n):
            m.P[i, i] += (LINEARISED * dz[i]) ** 2
    if is_fault:
        begin_all(m, rules)
    else:
        forget(m, rules, int(m.age[beginning]))
