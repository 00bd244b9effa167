"""The memory of the observer: its layout in one flat array, and what a design says of the filter."""

from typing import NamedTuple

import numpy as np

from ac_plant_node.dynamics.balances import N_STATES
from ac_plant_node.dynamics.workspace import N_WORK
from ac_plant_node.inputs import N_HELD
from ac_plant_node.parameters.values import NAMES
from fdi_node.envelope.compiled import Array, jit
from fdi_node.envelope.model import N_READINGS

N_WINDOWS = 8
"""Windows in which jumps are looked for; the last is for those that startle."""
ABRUPT = (0, 1, 2)
"""Which of those that may jump do so in one tick that has to be found: the compressor's speed, the sensor of the
evaporator's pressure, and the air flow that moves this pressure as fast as a fault. Whichever of them were looked for
in windows only would explain its own jumps worse than the others do, because of the worse onset."""
N_ONSETS = 10
"""Ticks for each of which these jumps are looked for, beside; the likeliest before them is kept."""
N_BEGINNINGS = N_WINDOWS + len(ABRUPT) * (N_ONSETS + 1)
N_PARAMETERS = len(NAMES)

TICKS, LOST, AGE, ZETA_THEN, SPEED_THEN, OPENING_THEN, DOUBT, NIS, GATED, LARGEST, SLOPE, CAUTION = range(12)
"""Scalars: ticks observed; corrections that led outside the model's domain and were taken back; ticks since the last
Jacobian, and zone length, speed, opening there; how short the superheated zone is (0..1); mean square of the white
innovations; ticks for which readings have been gated; largest ratio of all jumps in all windows; K/Pa by which the
reading of SH rises with p_e beside: dT_sat/dp where it is an outlet temperature, else 0; by what multiple of themselves
the variances of the readings are taken larger than they are."""
N_SCALARS = 12


class Rules(NamedTuple):
    """What a design says of the filter; n = 12 + m.

    `rows` (m, 5): the unknowns; `Q` (n,): intensities of the process noise per second; `R` (4,): variances of the
    readings, inf for one that is not used, both in units of the scales; `jumping` (q,): positions of the unknowns that
    may jump; `prior` (q,): inverse variances of their sizes, -1 for a valve that is stuck; `growing` (q,): 1 for one
    that grows, whose size is per second, 0 for one that jumps; `nominal`: the plant's parameters; `constants` (3,):
    sample time, ticks between two Jacobians, share by which the model's rates may be off.
    """

    rows: Array
    Q: Array
    R: Array
    jumping: Array
    prior: Array
    growing: Array
    nominal: Array
    constants: Array


def packed(rules: Rules) -> Array:
    """Return rules as one array, because each array handed to compiled code costs time; `rules_in` takes it."""
    sizes = np.array([len(rules.rows), len(rules.jumping)], dtype=np.float64)
    return np.concatenate([sizes, *(part.ravel() for part in rules)])


@jit
def rules_in(flat: Array) -> Rules:
    """Return the parts of an array from `packed`."""
    m, q = int(flat[0]), int(flat[1])
    n = N_STATES + m
    a = 2 + 5 * m
    b = a + n
    c = b + N_READINGS
    d = c + q
    e = d + q
    f = e + q
    g = f + N_PARAMETERS
    return Rules(flat[2:a].reshape(m, 5), flat[a:b], flat[b:c], flat[c:d], flat[d:e], flat[e:f], flat[f:g], flat[g:])


class Memory(NamedTuple):
    """All that the observer remembers, and room to work: views into one array.

    `work`: of the integration; `scalars`; `x` (m,): unknowns; `out` (4,): predicted outputs; `before`, `now` (12,):
    integration vector before the last correction and after it; `par`, `held`: the plant's, unknowns included; `e`, `s`
    (4,): innovations and their standard deviations; `white`, `sizes` (4,): innovations of the readings one after the
    other over theirs, and these; `P` (n, n), `A`, `F` (12, n), `C`, `PC` (4, n): covariance, Jacobian, transition,
    Jacobian of the readings, C P, all in units of the scales; `V` (n, w q + 11 a), `S`, `d` (w q + 11 a,): as in
    `jumps`, of the jumps in w windows, then of each of the a abrupt ones from each of the last ticks on, and of the one
    that is kept; `age` (w + 11 a,): ticks of each; `telling`, `opening` (w,): a window's largest ratio, the valve's
    opening when it began; `ratios`, `best` (q,): of each jump the largest ratio, and which beginning it is of; `past`
    (10, 2, w q + 11 a): S and d before each of the last ticks.
    """

    work: Array
    scalars: Array
    x: Array
    out: Array
    before: Array
    now: Array
    par: Array
    held: Array
    e: Array
    s: Array
    white: Array
    sizes: Array
    P: Array
    A: Array
    F: Array
    C: Array
    PC: Array
    V: Array
    S: Array
    d: Array
    age: Array
    telling: Array
    opening: Array
    ratios: Array
    best: Array
    past: Array


@jit
def memory_of(flat: Array, m: int, q: int) -> Memory:
    """Return the parts of the array of an observer with m unknowns of which q may jump."""
    n, w = N_STATES + m, N_WINDOWS
    a = N_WORK
    b = a + N_SCALARS
    c = b + m
    e = c + N_READINGS
    f = e + N_STATES
    g = f + N_STATES
    h = g + N_PARAMETERS
    i = h + N_HELD
    j = i + N_READINGS
    k = j + N_READINGS
    kk = k + N_READINGS
    o = kk + N_READINGS
    p = o + n * n
    r = p + N_STATES * n
    s = r + N_STATES * n
    t = s + N_READINGS * n
    u = t + N_READINGS * n
    columns = w * q + N_BEGINNINGS - w
    v = u + n * columns
    x = v + columns
    y = x + columns
    z = y + N_BEGINNINGS
    return Memory(
        flat[:a], flat[a:b], flat[b:c], flat[c:e], flat[e:f], flat[f:g], flat[g:h], flat[h:i], flat[i:j], flat[j:k],
        flat[k:kk], flat[kk:o], flat[o:p].reshape(n, n), flat[p:r].reshape(N_STATES, n), flat[r:s].reshape(N_STATES, n),
        flat[s:t].reshape(N_READINGS, n), flat[t:u].reshape(N_READINGS, n), flat[u:v].reshape(n, columns), flat[v:x],
        flat[x:y], flat[y:z], flat[z : z + w], flat[z + w : z + 2 * w], flat[z + 2 * w : z + 2 * w + q],
        flat[z + 2 * w + q : z + 2 * w + 2 * q],
        flat[z + 2 * w + 2 * q : z + 2 * w + 2 * q + N_ONSETS * 2 * columns].reshape(N_ONSETS, 2, columns),
    )  # fmt: skip


def new_memory(m: int, q: int) -> Array:
    """Return the array of an observer with m unknowns of which q may jump, all zero."""
    n, w = N_STATES + m, N_WINDOWS
    columns = w * q + N_BEGINNINGS - w
    small = (
        N_WORK + N_SCALARS + m + 2 * N_STATES + N_PARAMETERS + N_HELD + 5 * N_READINGS + N_BEGINNINGS + 2 * w + 2 * q
    )
    return np.zeros(small + n * n + 2 * (N_STATES + N_READINGS) * n + (n + 2 + 2 * N_ONSETS) * columns)
