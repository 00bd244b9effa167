"""The page of published optima says what is found."""

from pathlib import Path

import pytest
from published import PUBLISHED

from gimc import hinfsyn

PAGE = Path(__file__).parents[2] / "docs" / "optima.md"
ROWS = {
    cells[0].strip(): [cell.strip() for cell in cells[1:]]
    for line in PAGE.read_text(encoding="utf-8").splitlines()
    if line.startswith("| ") and (cells := line.strip("|").split("|"))
}


@pytest.mark.parametrize("name", PUBLISHED)
def test_row(name: str) -> None:
    """What is printed for the problem, and the norm that is found now; times are those of the run that wrote it."""
    optimum, ours = ROWS[name][:2]
    published = PUBLISHED[name]
    assert optimum == ("" if published.optimum is None else f"{published.optimum:.6g}")
    assert float(ours) == pytest.approx(hinfsyn(*published.problem())[1], rel=1e-4)
