"""What a varied value may be drawn from: each a map from the unit interval, so every kind of sampling serves all."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ac_experiments.schema_part import quoted, unknown

#: A normal value is drawn from within so many standard deviations: what is drawn is bounded, and bounds can be checked.
WIDEST = 4.0
#: Text, number, truth, mapping: what a file can name in a list.
Value = Any

_NUMBERS = ("uniform", "normal", "log_uniform")
_LISTS = ("choice", "grid")
KINDS = (*_NUMBERS, *_LISTS)
_EXAMPLE = "for instance {uniform: [0, 2]} or {choice: [low, med, high]}"


@dataclass(frozen=True)
class Distribution:
    """A distribution of one value.

    Attributes
    ----------
    kind : str
        "uniform", "log_uniform": between two numbers; "normal": mean and standard deviation, within `WIDEST` of them;
        "choice": one of the values, all as likely; "grid": each of the values with each of every other grid.
    values : tuple
        The two numbers, or the values.
    """

    kind: str
    values: tuple[Value, ...]

    @property
    def is_grid(self) -> bool:
        """Whether its values are gone through, not drawn."""
        return self.kind == "grid"

    @property
    def is_number(self) -> bool:
        """Whether every value is a number."""
        return all(isinstance(value, int | float) and not isinstance(value, bool) for value in self.values)

    @property
    def bounds(self) -> tuple[Value, ...]:
        """Lowest and highest value of numbers; all values of a list."""
        return self.values if self.kind in _LISTS else (self.at(0.0), self.at(1.0))

    def at(self, share: float) -> Value:
        """Return the value below which a share of all draws lies (the quantile function); 0 and 1 give the bounds."""
        if self.kind in _LISTS:
            return self.values[min(int(share * len(self.values)), len(self.values) - 1)]
        first, second = (float(value) for value in self.values)
        if self.kind == "uniform":
            return first + share * (second - first)
        if self.kind == "log_uniform":
            return min(max(first * math.exp(share * math.log(second / first)), first), second)
        from scipy.special import ndtr, ndtri

        outside = float(ndtr(-WIDEST))
        deviation = float(ndtri(outside + share * (1.0 - 2.0 * outside)))
        return first + second * min(max(deviation, -WIDEST), WIDEST)


def distribution(given: Any) -> Distribution:
    """Return the distribution that a file describes by a mapping of one entry, its kind and values.

    Raises
    ------
    ValueError
        One line: what of it cannot be.
    """
    if not isinstance(given, Mapping) or len(given) != 1:
        msg = f"given {quoted(given)}; must be a distribution, {_EXAMPLE}"
        raise ValueError(msg)
    ((kind, values),) = given.items()
    if kind not in KINDS:
        raise ValueError(unknown("distribution", kind, list(KINDS)))
    if not isinstance(values, list) or not values:
        msg = f"{kind}: given {quoted(values)}; must be a list, {_EXAMPLE}"
        raise ValueError(msg)
    made = Distribution(kind, tuple(values))
    if kind in _NUMBERS:
        _check_numbers(made)
    elif any(values.count(value) > 1 for value in values):
        msg = f"{kind}: given {quoted(values)}, which names a value twice"
        raise ValueError(msg)
    return made


def _check_numbers(made: Distribution) -> None:
    what = "mean and standard deviation" if made.kind == "normal" else "lowest and highest value"
    if len(made.values) != 2 or not made.is_number or not all(math.isfinite(value) for value in made.values):
        msg = f"{made.kind}: given {quoted(list(made.values))}; must be two numbers, {what}"
        raise ValueError(msg)
    first, second = made.values
    if made.kind == "normal":
        if not second > 0.0:
            msg = f"normal: given the standard deviation {second:g}; must be above 0"
            raise ValueError(msg)
    elif not first < second or (made.kind == "log_uniform" and not first > 0.0):
        least = " and above 0" if made.kind == "log_uniform" else ""
        msg = f"{made.kind}: given {first:g} to {second:g}; the first must be below the second{least}"
        raise ValueError(msg)
