"""Coverage-guided fuzzing (atheris) of what checks messages and of what loads scenarios.

    python tests/fuzz/guided.py messages --seconds 300
    python tests/fuzz/guided.py scenario --seconds 300

Starts from good inputs and lets libFuzzer change them towards new branches. Whatever is no clean refusal ends it: an
exception that is not meant for the user, a value that is not finite, an input that takes longer than ten seconds, more
than 2 GB. The input is left in the folder that is printed. Exit code 0 when there was none.
"""

import argparse
import math
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import atheris

with atheris.instrument_imports(include=["ac_common", "ac_experiments", "ac_ros_common", "ruamel"]):
    from ac_common.errors import UserError
    from ac_common.fdi_status import StatusRow, status_row
    from ac_common.topics import DIAGNOSTICS, TOPICS
    from ac_common.wire import columns, packer, read_diagnostics
    from ac_experiments.scenario import BUILT_IN, load
    from ac_experiments.scenario_schema import Scenario
    from ac_ros_common.messages import BadMessage, reader


#: Flags of libFuzzer: an input may take so long, and so much memory.
LIMITS = ("-timeout=10", "-rss_limit_mb=2048")
SIZES = {"messages": 2_000, "scenario": 4_000}


def check_message(data: bytes) -> None:
    """One byte for the topic, then the message: as a node checks it, and as the bag reader does."""
    if not data:
        return
    topic = TOPICS[data[0] % len(TOPICS)]
    content = data[1:]
    _read_as_bag(topic, content)
    try:
        _, values = reader(topic)(content)
    except BadMessage:
        return
    for value in values:
        assert isinstance(value, StatusRow) or math.isfinite(value), f"{topic.name}: {value}"


def _read_as_bag(topic: "object", content: bytes) -> None:
    try:
        if topic.type == DIAGNOSTICS:  # type: ignore[attr-defined]
            for status in read_diagnostics(content):
                status_row(status.values, 0.0)
        else:
            columns(topic, [content])  # type: ignore[arg-type]
    except ValueError:
        pass  # a clean refusal


def check_scenario(data: bytes) -> None:
    """A scenario file of any content."""
    file = Path(tempfile.gettempdir()) / "guided.yaml"
    file.write_bytes(data)
    try:
        scenario = load(file)
    except UserError as problem:
        if "\n" in str(problem) or len(str(problem)) > 1000:
            raise RuntimeError("not one clear line") from problem
        return
    assert isinstance(scenario, Scenario)
    assert scenario.ticks > 0


def good_messages() -> list[bytes]:
    """One good message of each topic, with the topic's number before it."""
    row = StatusRow(1.0, True, "compressor_speed", 4.2, 0.5, 0.9, (1.0, 500.0), None)
    found = []
    for number, topic in enumerate(TOPICS):
        values = [row] if topic.type == DIAGNOSTICS else [0.5] * len(topic.series)
        found.append(bytes([number]) + packer(topic)(1_000_000_000, values))
    return found


def good_scenarios() -> list[bytes]:
    """The built-in scenarios."""
    return [path.read_bytes() for path in sorted(BUILT_IN.glob("*.yaml"))]


TARGETS: dict[str, tuple[Callable[[bytes], None], Callable[[], list[bytes]]]] = {
    "messages": (check_message, good_messages),
    "scenario": (check_scenario, good_scenarios),
}


def _words() -> list[str]:
    """Words that a mutation should know: the keys of a scenario and YAML's own signs."""
    schema = Scenario.model_json_schema()
    keys = {key for part in (schema, *schema["$defs"].values()) for key in part.get("properties", {})}
    return [
        *sorted(keys),
        ": ",
        "- ",
        "{",
        "}",
        "[",
        "]",
        "&a ",
        "*a",
        "!!",
        "<<: ",
        ".nan",
        ".inf",
        "1e9",
        "null",
        "true",
    ]


def main() -> None:
    """Fuzz one target."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("target", choices=list(TARGETS))
    parser.add_argument("--seconds", type=int, default=300)
    parser.add_argument("--seed", type=int, default=0, help="0: another one each time")
    options = parser.parse_args()
    check, good = TARGETS[options.target]
    folder = Path(tempfile.mkdtemp(prefix=f"acftc-guided-{options.target}-"))
    tempfile.tempdir = str(folder)
    corpus = folder / "corpus"
    corpus.mkdir()
    for number, data in enumerate(good()):
        (corpus / f"good-{number}").write_bytes(data)
    words = folder / "words"
    words.write_text("".join(f'"{word}"\n' for word in _words()))
    print(f"inputs that fail are left in {folder}", flush=True)
    flags = [f"-max_total_time={options.seconds}", f"-max_len={SIZES[options.target]}", f"-seed={options.seed}"]
    if options.target == "scenario":
        flags.append(f"-dict={words}")
    flags += [*LIMITS, "-print_final_stats=1", "-verbosity=0", f"-artifact_prefix={folder}/", str(corpus)]
    atheris.Setup([sys.argv[0], *flags], check)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
