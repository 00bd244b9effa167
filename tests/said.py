"""What a command has said on stderr, but for the notices of what is made once and then kept."""


def complaints(stderr: str) -> list[str]:
    """Lines of `stderr` without those that tell of designs or tables being made: whether they are is the cache's."""
    return [line for line in stderr.strip().splitlines() if "(once, " not in line]
