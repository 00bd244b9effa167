"""The memory of the observer: its layout in one flat array, and what a design says of the filter."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

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
Single = NDArray[np.float32]
LANES = 8
"""So many numbers are a line of the cache, and the most that a processor takes at a time."""

TICKS, LOST, AGE, ZETA_THEN, SPEED_THEN, OPENING_THEN, DOUBT, NIS, GATED, LARGEST, SLOPE = range(11)
READ, LEFT, OFF, JUMPED = range(11, 15)
"""Scalars: ticks observed; corrections that led outside the model's domain and were taken back; ticks since the last
Jacobian, and zone length, speed, opening there; how short the superheated zone is (0..1); mean square of the white
innovations; ticks for which readings have been gated; largest ratio of all jumps in all windows; K/Pa by which the
reading of SH rises with p_e beside: dT_sat/dp where it is an outlet temperature, else 0; the last reading of p_e, and
what the correction has left of its innovation, nan when what was before is not known; by how much more than the model
the reading has moved in this tick (`NOT_KNOWN` then), and that again where it has jumped, else 0."""
N_SCALARS = 15
NOT_KNOWN = 1.0e9
"""More than any reading moves."""


class Rules(NamedTuple):
    """What a design says of the filter; n = 12 + m.

    `rows` (m, 5): the unknowns; `Q` (n,): intensities of the process noise per second; `R` (4,): variances of the
    readings, inf for one that is not used, both in units of the scales; `jumping` (q,): positions of the unknowns that
    may jump; `prior` (q,): inverse variances of their sizes, -1 for a valve that is stuck; `most` (q,): how large they
    are at most; `growing` (q,): 1 for one that grows, whose size is per second, 0 for one that jumps; `nominal`: the
    plant's parameters; `constants` (3,): sample time, ticks between two Jacobians, share by which the model's rates may
    be off.
    """

    rows: Array
    Q: Array
    R: Array
    jumping: Array
    prior: Array
    most: Array
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
    g = f + q
    i = g + N_PARAMETERS
    return Rules(
        flat[2:a].reshape(m, 5), flat[a:b], flat[b:c], flat[c:d], flat[d:e], flat[e:f], flat[f:g], flat[g:i], flat[i:]
    )


class Memory(NamedTuple):
    """All that the observer remembers, and room to work: views into one array.

    `work`: of the integration; `scalars`; `x` (m,): unknowns; `out` (4,): predicted outputs; `before`, `now` (12,):
    integration vector before the last correction and after it; `par`, `held`: the plant's, unknowns included; `e`, `s`
    (4,): innovations and their standard deviations; `white`, `sizes` (4,): innovations of the readings one after the
    other over theirs, and these; `P` (n, n), `A`, `F` (12, n), `C`, `PC` (4, n): covariance, Jacobian, transition,
    Jacobian of the readings, C P, all in units of the scales; `turned` (n, 12): the transition's transpose; `V`
    (n, w q + 11 a), `S`, `d` (w q + 11 a,): as in `jumps`, of the jumps in w windows, then of each of the a abrupt ones
    from each of the last ticks on, and of the one that is kept; `age`, `seen` (w + 11 a,): ticks of each, and `OFF` in
    its first; `telling`, `opening` (w,): a window's largest ratio, the valve's opening when it began; `ratios`, `best`
    (q,): of each jump the largest ratio, and which beginning it is of; `past` (10, 3, w q + 11 a): S, d and
    `seen` before each of the last ticks.

    The rest is room: `step`, `dz` (n,): steps of the differences, the correction; `gains` (4,), `G` (4, w q + 11 a):
    of the readings; `columns`: as `products.terms`; `FP`, `FPF` (12, .), `FV` (12, w q + 11 a): products.

    `V`, `G` and `FV` are of single precision: what jumps do is known to some per cent at best, for it is linearised.

    Each part begins at a multiple of `LANES` numbers, and rows of P, C P, V, S, d and of room are filled up with zeros
    to such a multiple: loops along them take so many numbers at a time, and none is left over.
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
    turned: Array
    V: Single
    S: Array
    d: Array
    age: Array
    seen: Array
    telling: Array
    opening: Array
    ratios: Array
    best: Array
    past: Array
    step: Array
    dz: Array
    gains: Array
    G: Single
    columns: Array
    FP: Array
    FPF: Array
    FV: Single


_ROOM = Memory._fields.index("step")


@jit
def filled_up(size: int) -> int:
    """Return the multiple of `LANES` that is as large as a size, or the next one."""
    return (size + LANES - 1) // LANES * LANES


@jit
def _layout(m: int, q: int) -> NDArray[np.int64]:
    """Return of each part of `Memory`, and of what is behind the last, where it begins, its rows and their length."""
    n, w = N_STATES + m, N_WINDOWS * q + N_BEGINNINGS - N_WINDOWS
    line, filled, wide, states = 1, filled_up(n), filled_up(w), filled_up(N_STATES)
    parts = (
        (line, N_WORK), (line, N_SCALARS), (line, m), (line, N_READINGS), (line, N_STATES), (line, N_STATES),
        (line, N_PARAMETERS), (line, N_HELD), (line, N_READINGS), (line, N_READINGS), (line, N_READINGS),
        (line, N_READINGS), (n, filled), (N_STATES, n), (N_STATES, n), (N_READINGS, n), (N_READINGS, filled),
        (n, states), (n, wide // 2), (line, wide), (line, wide), (line, N_BEGINNINGS), (line, N_BEGINNINGS),
        (line, N_WINDOWS), (line, N_WINDOWS), (line, q), (line, q), (N_ONSETS * 3, wide), (line, n), (line, n),
        (line, N_READINGS), (N_READINGS, wide // 2), (line, filled), (N_STATES, filled), (N_STATES, states),
        (N_STATES, wide // 2), (line, 0),
    )  # fmt: skip
    found, at = np.zeros((len(parts), 3), dtype=np.int64), 0
    for i, (rows, length) in enumerate(parts):
        found[i, 0], found[i, 1], found[i, 2] = at, rows, length
        at += filled_up(rows * length)
    return found


@jit
def _line(flat: Array, part: NDArray[np.int64]) -> Array:
    at, _, length = part
    return flat[at : at + length]


@jit
def _matrix(flat: Array, part: NDArray[np.int64]) -> Array:
    at, rows, length = part
    return flat[at : at + rows * length].reshape(rows, length)


@jit
def _single(flat: Array, part: NDArray[np.int64]) -> Single:
    """Return a matrix of single precision: two of its numbers take the place of one."""
    at, rows, length = part
    return flat[at : at + rows * length].view(np.float32).reshape(rows, 2 * length)


@jit
def memory_of(flat: Array, m: int, q: int) -> Memory:
    """Return the parts of the array of an observer with m unknowns of which q may jump."""
    at = _layout(m, q)
    return Memory(
        _line(flat, at[0]), _line(flat, at[1]), _line(flat, at[2]), _line(flat, at[3]), _line(flat, at[4]),
        _line(flat, at[5]), _line(flat, at[6]), _line(flat, at[7]), _line(flat, at[8]), _line(flat, at[9]),
        _line(flat, at[10]), _line(flat, at[11]), _matrix(flat, at[12]), _matrix(flat, at[13]), _matrix(flat, at[14]),
        _matrix(flat, at[15]), _matrix(flat, at[16]), _matrix(flat, at[17]), _single(flat, at[18]),
        _line(flat, at[19]), _line(flat, at[20]), _line(flat, at[21]), _line(flat, at[22]), _line(flat, at[23]),
        _line(flat, at[24]), _line(flat, at[25]), _line(flat, at[26]),
        _matrix(flat, at[27]).reshape(N_ONSETS, 3, at[27, 2]), _line(flat, at[28]), _line(flat, at[29]),
        _line(flat, at[30]), _single(flat, at[31]), _line(flat, at[32]), _matrix(flat, at[33]), _matrix(flat, at[34]),
        _single(flat, at[35]),
    )  # fmt: skip


def new_memory(m: int, q: int) -> Array:
    """Return the array of an observer with m unknowns of which q may jump, all zero."""
    return aligned(np.zeros(int(_layout(m, q)[-1, 0])))


def remembered(m: int, q: int) -> int:
    """Return how much of such an array is remembered from tick to tick; the rest is room to work."""
    return int(_layout(m, q)[_ROOM, 0])


def aligned(values: Array) -> Array:
    """Return a copy of an array that begins where a line of the processor's cache does."""
    room = np.empty(len(values) + LANES)
    first = -(room.ctypes.data // room.itemsize) % LANES
    copy = room[first : first + len(values)]
    copy[:] = values
    return copy
