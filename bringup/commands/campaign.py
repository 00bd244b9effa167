"""`acftc campaign`: seeded faults of processes, messages and the plant at once."""

import tempfile
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

import click

from ac_common.errors import RunError, UserError
from bringup.commands.console import print_json, print_table, progress_bar, say
from bringup.commands.options import examples, json_option, path_option

if TYPE_CHECKING:
    from bringup.fault_campaign.run import Outcome


@click.command(
    epilog=examples(
        "acftc campaign --seeds 20 --out results/campaign",
        "acftc campaign --seed 7 --out results/seed_7     the one that failed, again",
    ),
    short_help="Kill nodes and spoil messages by a seed, check the promises.",
)
@click.option("--seeds", default=10, show_default=True, type=click.IntRange(1, 100_000), help="Seeds 0 to N-1.")
@click.option("--seed", type=click.IntRange(0, 2**31 - 1), help="This seed only.")
@click.option("--duration", "duration_s", default=24.0, show_default=True, help="Length of each run, s.")
@path_option("--out", metavar="DIR", help="Keep bags, logs and plans here. Default: nowhere.")
@json_option
def campaign(seeds: int, seed: int | None, duration_s: float, out: Path | None, as_json: bool) -> None:
    """Run a fault campaign through the graph, on the wall clock at 10 Hz.

    Each seed picks faults of processes (kill -9, a stop), of messages (lost, late, doubled, nan, another unit, out of
    range) and of the plant (f_N, f_p) together; afterwards the promises of docs/promises.md are checked on what was
    recorded. Exit code 1 when one was broken; --seed runs that one again.
    """
    from ac_experiments.campaign.plan import plan
    from bringup.fault_campaign.run import as_dict, run_seed

    chosen = range(seeds) if seed is None else [seed]
    plan(chosen[0], duration_s)  # a duration that is no good is refused now
    outcomes = []
    with ExitStack() as stack:
        folder = out or Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="acftc-campaign-")))
        progress = stack.enter_context(progress_bar(f"{len(chosen)} seeds"))
        for done, number in enumerate(chosen):

            def follow(tick: int, ticks: int, done: int = done) -> None:
                if progress is not None:
                    progress(done * ticks + tick, len(chosen) * ticks)

            outcomes.append(run_seed(number, _fresh(folder / f"seed_{number}"), duration_s, follow))
    if as_json:
        print_json([as_dict(outcome) for outcome in outcomes])
    else:
        _print(outcomes)
    broken = [outcome.plan.seed for outcome in outcomes if outcome.broken]
    if broken:
        again = f"acftc campaign --seed {broken[0]} --duration {duration_s:g} --out DIR"
        msg = f"promises broken with seed {', '.join(map(str, broken))}; again: {again}"
        raise RunError(msg)


def _fresh(folder: Path) -> Path:
    if any((folder / "bag").glob("*.mcap")):
        msg = f"{folder}: holds the recording of an earlier campaign; choose another --out"
        raise UserError(msg)
    return folder


def _print(outcomes: "Sequence[Outcome]") -> None:
    rows = []
    for outcome in outcomes:
        kept = sum(verdict.kept is True for verdict in outcome.verdicts)
        judged = sum(verdict.kept is not None for verdict in outcome.verdicts)
        broken = "; ".join(f"{verdict.promise}: {verdict.seen}" for verdict in outcome.broken)
        rows.append([str(outcome.plan.seed), "; ".join(outcome.plan.lines()), f"{kept} of {judged}", broken or "ok"])
    print_table(["seed", "what happens", "promises kept", ""], rows)
    promises = {verdict.promise: [0, 0] for outcome in outcomes for verdict in outcome.verdicts}
    for outcome in outcomes:
        for verdict in outcome.verdicts:
            if verdict.kept is not None:
                promises[verdict.promise][0] += verdict.kept
                promises[verdict.promise][1] += 1
    print_table(["promise", "kept"], [[name, f"{kept} of {n}"] for name, (kept, n) in promises.items()])
    say(f"{sum(outcome.seconds for outcome in outcomes):.0f} s for {len(outcomes)} seeds")
