"""The observer: an extended Kalman filter on the compiled plant.

State z = [x, u]: the plant's twelve and the unknowns u, random walks. Each tick

    f_e = y - g(z^)                     innovation of the nonlinear plant
    z^ <- z^ + K f_e                    reading by reading, K from the covariance P
    z^ <- plant over one tick           the compiled model itself;  P <- F P F' + Q

F and C are central differences, as far apart as the filter's own standard deviations say: a kink of the plant (a zone
that ends, a flow that reverses) then counts as far as the estimate is uncertain. They are renewed now and then
(`fdi_node.envelope.detector.JACOBIAN_S`), and when the plant has moved on.

What makes it sturdy: the process noise has a part that grows with the state's own rate, for a model is right within a
share of what it says; where the superheated zone is about to end, SH and T_w and what they depend on are trusted less;
a reading that is absurdly far off does not correct the estimate for a while (the decision has the time to say why); and
a correction that leads outside the model's domain is taken back.
"""

import numpy as np

from ac_plant_node.dynamics.balances import N_STATES, REGIME_E, X
from ac_plant_node.dynamics.drive import OPENING, SPEED
from ac_plant_node.dynamics.exponential import MAX_PHI_ERROR
from ac_plant_node.dynamics.workspace import Work, views
from ac_plant_node.properties.tables import Tables
from fdi_node.envelope import jumps
from fdi_node.envelope.compiled import Array, jit
from fdi_node.envelope.memory import (
    AGE,
    DOUBT,
    GATED,
    JUMPED,
    LEFT,
    LOST,
    NIS,
    NOT_KNOWN,
    OFF,
    OPENING_THEN,
    READ,
    SLOPE,
    SPEED_THEN,
    TICKS,
    ZETA_THEN,
    Memory,
    Rules,
    filled_up,
    memory_of,
    rules_in,
)
from fdi_node.envelope.model import (
    ENERGY,
    HIGHEST,
    LOWEST,
    N_READINGS,
    PARAMETER,
    PLACE,
    POSITION,
    READING,
    READING_SCALE,
    SCALE,
    STATE_SCALE,
    apply,
    linearise,
)
from fdi_node.envelope.products import combine, multiply, subtract, terms
from fdi_node.envelope.step import go_on
from fdi_node.envelope.transition import hold, transition

STEP_SHARE = 0.05
"""Half the distance of the Jacobian's differences, in standard deviations of the filter,"""
LEAST_STEP, KNOWN_STEP = 1.0e-7, 1.0e-3
"""but at least the first, and the second for an unknown that is known; in units of the scales."""
GATE, GATED_S = 8.0, 2.0
"""A reading this many standard deviations off does not correct the estimate, for at most so long."""
READING_JUMP = 10.0
"""A reading of p_e has jumped when it has moved in one tick by this many standard deviations of the difference of two
readings, and by as much more than the model has. Air flows that step move p_e by a quarter of that in a tick."""
NIS_S, MOST = 5.0, 25.0
"""Time constant of the mean of the squares of the white innovations, each cut at the second number."""
SHORT_ZONE = 0.12
"""Length of the superheated zone below which the readings of it are trusted less,"""
SHORT_R = np.array([0.0, 1.0, 9.0, 0.0])
"""by these variances in K^2 of SH and T_w,"""
SHORT_Q = np.array([0.0, 50.0, 3.0e3, 0.1, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]) ** 2 / STATE_SCALE**2
"""and intensities of noise of U_e, h_e2, T_ew, D_e."""
MOVED_ZETA, MOVED_SPEED, MOVED_OPENING, REST = 0.03, 0.2, 0.05, 5
"""Changes of zone length, speed (logarithm) and opening that renew the Jacobian, after this many ticks at least."""
AGING = 0.1
"""A Jacobian of `REST` or more grows old half as fast in a tick whose remainder is below this part of what a step may
be off by."""
SURPRISING = 3.0
"""An innovation of this many standard deviations does so, too: what has moved may be none of these."""
MOST_SD = 10.0
"""Largest standard deviation, in units of the scales."""


@jit
def _renew_when_due(m: Memory, k: Work, rules: Rules, told: Array, tab: Tables) -> None:
    """Renew Jacobians and transition when the plant has moved on, or they are old."""
    scalars, n, step = m.scalars, m.P.shape[0], m.step
    zeta, speed = k.aux[X], max(told[SPEED], 1.0)
    moved = abs(zeta - scalars[ZETA_THEN]) > MOVED_ZETA or abs(told[OPENING] - scalars[OPENING_THEN]) > MOVED_OPENING
    moved = moved or abs(np.log(speed / max(scalars[SPEED_THEN], 1.0))) > MOVED_SPEED
    for r in range(N_READINGS):
        moved = moved or abs(m.white[r]) > SURPRISING
    if scalars[TICKS] == 0.0 or scalars[AGE] >= rules.constants[1] or (moved and scalars[AGE] >= REST):
        for i in range(n):
            step[i] = max(STEP_SHARE * np.sqrt(max(m.P[i, i], 0.0)), LEAST_STEP)
            if i >= N_STATES and m.P[i, i] < KNOWN_STEP**2:
                known = rules.rows[i - N_STATES, PLACE] == PARAMETER and m.P[i, i] == 0.0
                step[i] = 0.0 if known else KNOWN_STEP
        linearise(k, m.x, rules.rows, told, rules.nominal, m.par, tab, step, m.A, m.C)
        if not transition(k, m.A, rules.constants[0], m.F):  # a kink, as seen from afar
            for i in range(n):
                step[i] = KNOWN_STEP if step[i] > 0.0 else 0.0
            linearise(k, m.x, rules.rows, told, rules.nominal, m.par, tab, step, m.A, m.C)
            if not transition(k, m.A, rules.constants[0], m.F):
                hold(m.F)
        for i in range(N_STATES):
            for j in range(n):
                m.turned[j, i] = m.F[i, j]
        slope = scalars[SLOPE] * READING_SCALE[0] / READING_SCALE[1]
        for j in range(n):
            if j < N_STATES or int(rules.rows[j - N_STATES, PLACE]) != READING:
                m.C[1, j] += slope * m.C[0, j]
        scalars[AGE], scalars[ZETA_THEN], scalars[SPEED_THEN], scalars[OPENING_THEN] = 0.0, zeta, speed, told[OPENING]
    scalars[DOUBT] = 1.0 if k.aux[REGIME_E] != 0.0 else max(0.0, 1.0 - (1.0 - zeta) / SHORT_ZONE)


@jit
def _uncertain(m: Memory, rules: Rules) -> int:
    """Return how many states there are up to the last that is not known exactly: P is zero beyond."""
    n: int = m.P.shape[0]
    while n > N_STATES and m.P[n - 1, n - 1] == 0.0 and rules.Q[n - 1] == 0.0:
        n -= 1
    return n


@jit
def _jumped(m: Memory, rules: Rules, pressure: float) -> float:
    """Return by how much the reading of p_e has jumped since the tick before, 0 when it has not: `READING_JUMP`."""
    moved, off = pressure - m.scalars[READ], m.e[0] - m.scalars[LEFT]
    m.scalars[READ], m.scalars[OFF] = pressure, off if np.isfinite(off) else NOT_KNOWN
    jumped = off if abs(off) < abs(moved) else moved
    return float(jumped) if abs(jumped) > READING_JUMP * np.sqrt(2.0 * rules.R[0]) and off * moved > 0.0 else 0.0


@jit
def innovate(m: Memory, rules: Rules, reading: Array) -> None:
    """Work out innovations, C P and the innovations' standard deviations before this tick's correction."""
    n = _uncertain(m, rules)
    for r in range(N_READINGS):
        m.e[r] = (reading[r] - m.out[r]) / READING_SCALE[r]
    for i in range(m.x.shape[0]):
        if int(rules.rows[i, PLACE]) == READING:
            at = int(rules.rows[i, POSITION])
            m.e[at] -= m.x[i] / READING_SCALE[at]
    m.scalars[JUMPED] = _jumped(m, rules, reading[0] / READING_SCALE[0])
    for r in range(N_READINGS):
        K = m.PC[r]
        for i in range(m.P.shape[0]):
            K[i] = 0.0
        if not rules.R[r] < np.inf:
            m.e[r], m.s[r] = 0.0, 1.0
            continue
        for j in range(n):
            c = m.C[r, j]
            if c != 0.0:
                for i in range(n):
                    K[i] += c * m.P[j, i]
        s = rules.R[r] + m.scalars[DOUBT] ** 2 * SHORT_R[r]
        for i in range(n):
            s += m.C[r, i] * K[i]
        m.s[r] = np.sqrt(s)


@jit
def correct(m: Memory, rules: Rules) -> None:
    """Work out the correction `m.dz`, the covariance after it, and what the jumps' windows learn."""
    n = _uncertain(m, rules)
    may_gate, gated, total, readings = m.scalars[GATED] * rules.constants[0] < GATED_S, False, 0.0, 0.0
    dz, gains, G = m.dz, m.gains, m.G
    for i in range(m.P.shape[0]):
        dz[i] = 0.0
    combine(m.C, m.V, G)
    for r in range(N_READINGS):
        m.white[r], m.sizes[r], gains[r] = 0.0, 1.0, 0.0
        if not rules.R[r] < np.inf:
            continue
        C, K, e = m.C[r], m.PC[r], m.e[r]
        s = rules.R[r] + m.scalars[DOUBT] ** 2 * SHORT_R[r]
        for i in range(n):
            s += C[i] * K[i]
            e -= C[i] * dz[i]
        m.sizes[r] = np.sqrt(s)
        m.white[r] = e / m.sizes[r]
        total += min(m.white[r] ** 2, MOST)
        readings += 1.0
        jumps.follow(m, G[r], e, s)
        if (may_gate and abs(m.white[r]) > GATE) or (r == 0 and m.scalars[JUMPED] != 0.0):
            gated = True
            continue
        gains[r] = 1.0 / s
        for i in range(n):
            dz[i] += K[i] / s * e
        for later in range(r + 1, N_READINGS):
            f = 0.0
            for i in range(n):
                f += m.C[later, i] * K[i]
            f /= s
            for i in range(n):
                m.PC[later, i] -= f * K[i]
            g = np.float32(f)
            for j in range(G.shape[1]):
                G[later, j] -= g * G[r, j]
    subtract(m.PC, gains, m.PC, n, m.P)
    subtract(m.PC, gains, G, n, m.V)
    m.scalars[LEFT] = m.e[0]
    for i in range(n):
        m.scalars[LEFT] -= m.C[0, i] * dz[i]
    m.scalars[GATED] = m.scalars[GATED] + 1.0 if gated else max(m.scalars[GATED] - 0.1, 0.0)
    m.scalars[NIS] += (total / readings - m.scalars[NIS]) * rules.constants[0] / NIS_S


@jit
def _move(m: Memory, k: Work, rules: Rules, dz: Array) -> None:
    """Move the estimate by `dz` (n,), in units of the scales; unknowns stay within their limits."""
    for i in range(N_STATES):
        if i != ENERGY:
            k.y[i] += dz[i] * STATE_SCALE[i]
    for i in range(m.x.shape[0]):
        row = rules.rows[i]
        m.x[i] = min(max(m.x[i] + dz[N_STATES + i] * row[SCALE], row[LOWEST]), row[HIGHEST])


@jit
def observe(flat: Array, packed: Array, reading: Array, told: Array, tab: Tables) -> None:
    """Take the readings of a tick.

    Parameters
    ----------
    flat : array
        The memory, from `fdi_node.envelope.memory.new_memory`.
    packed : array
        The rules, from `fdi_node.envelope.memory.packed`.
    reading : (4,) array
        p_e Pa, SH K, T_w degC, p_c Pa.
    told : (N_HELD,) array
        What the plant was driven by up to now, as commanded and measured.
    tab : Tables
    """
    rules = rules_in(packed)
    m = memory_of(flat, rules.rows.shape[0], rules.jumping.shape[0])
    take(m, views(m.work), rules, reading, told, tab)


@jit
def take(m: Memory, k: Work, rules: Rules, reading: Array, told: Array, tab: Tables) -> None:
    """Do as `observe`, on the parts of both arrays; `k`: those of the memory's `work`."""
    _renew_when_due(m, k, rules, told, tab)
    innovate(m, rules, reading)
    jumps.begin_due(m, rules, int(m.scalars[TICKS]))
    m.scalars[TICKS] += 1.0
    correct(m, rules)
    for i in range(N_STATES):
        m.before[i] = k.y[i]
    _move(m, k, rules, m.dz)
    jumps.judge(m, rules)


@jit
def predict(flat: Array, packed: Array, told: Array, tab: Tables) -> int:
    """Go on to the next tick with the plant driven by `told`; 0, or 1 when the state cannot be continued."""
    rules = rules_in(packed)
    m = memory_of(flat, rules.rows.shape[0], rules.jumping.shape[0])
    status: int = go_on_to_next(m, views(m.work), rules, told, tab)
    return status


@jit
def go_on_to_next(m: Memory, k: Work, rules: Rules, told: Array, tab: Tables) -> int:
    """Do as `predict`, on the parts of both arrays; `k`: those of the memory's `work`."""
    h = rules.constants[0]
    apply(m.x, rules.rows, told, rules.nominal, m.par, m.held)
    for i in range(N_STATES):
        m.now[i] = k.y[i]
    left = go_on(k, m.work, m.par, tab, m.held, h, m.C, m.out)
    if np.isnan(left):
        m.scalars[LOST] += 1.0
        for i in range(N_STATES):
            k.y[i] = m.now[i] = m.before[i]
        left = go_on(k, m.work, m.par, tab, m.held, h, m.C, m.out)
    status = int(np.isnan(left))
    is_good = left <= AGING * MAX_PHI_ERROR and m.scalars[AGE] >= REST
    m.scalars[AGE] += 0.5 if is_good else 1.0
    propagate_covariance(m, k.y, rules, _uncertain(m, rules))
    jumps.propagate(m, rules, told[OPENING])
    for r in range(N_READINGS):
        if not np.isfinite(m.out[r]):
            status = 1
    return status


@jit
def propagate_covariance(m: Memory, y: Array, rules: Rules, n: int) -> None:
    """P <- F P F' + Q of the first n states, no standard deviation above `MOST_SD`."""
    P, F, h = m.P, m.F, rules.constants[0]
    M, D, columns = m.FP, m.FPF, m.columns
    count = terms(rules.rows, P, False, columns)
    multiply(F, P, columns, count, filled_up(n), M)
    multiply(M, m.turned, columns, count, m.turned.shape[1], D)
    for i in range(N_STATES):
        for j in range(i + 1):
            P[i, j] = P[j, i] = D[i, j]
        for j in range(N_STATES, n):
            P[i, j] = P[j, i] = M[i, j]
    for i in range(n):
        P[i, i] += rules.Q[i] * h
        if i < N_STATES and i != ENERGY:
            rate = rules.constants[2] * (y[i] - m.now[i]) / (STATE_SCALE[i] * h)
            P[i, i] += (rate * rate + m.scalars[DOUBT] ** 2 * SHORT_Q[i]) * h
        if P[i, i] > MOST_SD**2:
            f = MOST_SD / np.sqrt(P[i, i])
            for j in range(n):
                P[i, j] *= f
                P[j, i] *= f


@jit
def accept_jump(flat: Array, rules: Rules, h: int, is_fault: bool) -> None:
    """Take it that the h-th of those that may jump has jumped, as its likeliest beginning says; between two ticks."""
    m = memory_of(flat, rules.rows.shape[0], rules.jumping.shape[0])
    jumps.accept(m, rules, h, is_fault, m.dz)
    _move(m, views(m.work), rules, m.dz)
    for i in range(m.P.shape[0]):
        m.scalars[LEFT] -= m.C[0, i] * m.dz[i]
    m.scalars[AGE] = rules.constants[1]  # the Jacobian was that of another state


@jit
def accept_reading_jump(flat: Array, rules: Rules, unknown: int) -> None:
    """Take it that the reading of p_e has jumped by `JUMPED`, and the unknown that is its error with it.

    The jump may be off by what the plant itself may have moved by: its variance is the innovation's.
    """
    m = memory_of(flat, rules.rows.shape[0], rules.jumping.shape[0])
    at, unit = N_STATES + unknown, READING_SCALE[0] / rules.rows[unknown, SCALE]
    for i in range(m.P.shape[0]):
        m.dz[i] = 0.0
    m.dz[at] = m.scalars[JUMPED] * unit
    m.P[at, at] += (m.s[0] * unit) ** 2
    _move(m, views(m.work), rules, m.dz)
    m.scalars[LEFT] -= m.scalars[JUMPED]
    jumps.begin_all(m, rules)


@jit
def settle(flat: Array, rules: Rules, unknown: int, variance: float) -> None:
    """Take it that an unknown is zero, with this variance in units of its scale, whatever the filter knew of it."""
    m = memory_of(flat, rules.rows.shape[0], rules.jumping.shape[0])
    at = N_STATES + unknown
    m.x[unknown] = 0.0
    for j in range(m.P.shape[0]):
        m.P[at, j] = m.P[j, at] = 0.0
    m.P[at, at] = variance
    jumps.begin_all(m, rules)
