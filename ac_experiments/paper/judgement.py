"""How a number of ours is judged against the paper's: three rules, three verdicts."""

from dataclasses import dataclass, field

AGREES, BETTER, DIFFERS, NOTED, LEFT_OUT = "agrees", "better", "differs", "noted", "left out"


@dataclass(frozen=True)
class Finding:
    """One number of an experiment: the paper's (None: it gives none), ours, and whether they go together."""

    quantity: str
    unit: str
    paper: float | None
    ours: float | None
    verdict: str
    rule: str


@dataclass(frozen=True)
class Experiment:
    """One experiment: its findings, what a reader must know, and its picture as SVG text."""

    id: str
    title: str
    findings: list[Finding] = field(default_factory=list)
    remark: str = ""
    picture: str = ""

    @property
    def verdict(self) -> str:
        """Return the worst verdict among the findings that were judged."""
        verdicts = {finding.verdict for finding in self.findings}
        return next((verdict for verdict in (DIFFERS, AGREES, BETTER, NOTED) if verdict in verdicts), LEFT_OUT)


def near(
    quantity: str, unit: str, ours: float | None, wanted: float, allowed: float, *, in_paper: bool = True
) -> Finding:
    """Judge against a number, the paper's own unless `in_paper` is False: within `allowed` it agrees."""
    fits = ours is not None and abs(ours - wanted) <= allowed
    paper = wanted if in_paper else None
    return Finding(quantity, unit, paper, ours, AGREES if fits else DIFFERS, f"{wanted:g} ± {allowed:g} {unit}")


def at_most(quantity: str, unit: str, ours: float | None, limit: float) -> Finding:
    """Judge against a limit that turns the paper's words ("not affected") into a number."""
    fits = ours is not None and abs(ours) <= limit
    return Finding(quantity, unit, None, ours, AGREES if fits else DIFFERS, f"at most {limit:g} {unit}")


def at_least(quantity: str, unit: str, ours: float | None, limit: float) -> Finding:
    """Judge against a limit that turns the paper's words ("very sensitive") into a number."""
    fits = ours is not None and abs(ours) >= limit
    return Finding(quantity, unit, None, ours, AGREES if fits else DIFFERS, f"at least {limit:g} {unit}")


def toward(quantity: str, unit: str, ours: float | None, paper: float, ideal: float, allowed: float) -> Finding:
    """Judge where the paper itself misses the ideal: nearer to it is better, within `allowed` of the paper agrees."""
    verdict = DIFFERS
    if ours is not None and abs(ours - paper) <= allowed:
        verdict = AGREES
    elif ours is not None and abs(ours - ideal) < abs(paper - ideal):
        verdict = BETTER
    return Finding(quantity, unit, paper, ours, verdict, f"the paper's ± {allowed:g} {unit}, or nearer to {ideal:g}")


def noted(quantity: str, unit: str, ours: float | None) -> Finding:
    """Put a number on record that nothing is held against."""
    return Finding(quantity, unit, None, ours, NOTED, "for the record")
