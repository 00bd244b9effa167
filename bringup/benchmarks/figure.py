"""One line of a benchmark's table, the plant's and the graph's alike."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Figure:
    """One line of the table.

    Attributes
    ----------
    ours, reference : measured in the same run of the benchmark; reference None where there is nothing to compare with.
    limit : what the figure must reach ("at least" or "at most" is in `at_least`); None: for information.
    """

    name: str
    unit: str
    ours: float
    limit: float | None = None
    at_least: bool = False
    reference: float | None = None

    @property
    def passed(self) -> bool | None:
        """Whether the limit is kept; None when there is none."""
        if self.limit is None:
            return None
        return self.ours >= self.limit if self.at_least else self.ours <= self.limit
