"""YAML files that users write, read in one way: numbers as YAML 1.2 has them, no key twice, an end to every file."""

import re
from collections.abc import Hashable
from pathlib import Path
from typing import Any

import yaml

from ac_common.errors import BringupError, shortened

#: Longest file, in characters: thousands of changes of a scenario, and an end to /dev/zero.
LARGEST_FILE = 250_000


class Loader(yaml.SafeLoader):
    """PyYAML's safe loader, which also reads 1e3 as a number and refuses a key given twice."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        """Construct a mapping, refusing duplicate keys (YAML 1.2 forbids them; PyYAML keeps the last silently)."""
        seen = set()
        for key_node, _ in node.value:
            key = key_node.value if isinstance(key_node, yaml.ScalarNode) else None
            if key in seen and key is not None:
                raise yaml.constructor.ConstructorError(None, None, f"key {key!r} is given twice", key_node.start_mark)
            seen.add(key)
        return super().construct_mapping(node, deep=deep)


# YAML 1.2's float; PyYAML (YAML 1.1) takes 1e3 for text.
Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(r"^[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)[eE][-+]?[0-9]+$"),
    list("-+0123456789."),
)


#: What PyYAML lets through besides its own errors: a date that is none, a number too long, nesting without end.
_PROBLEMS = (yaml.YAMLError, ValueError, TypeError, LookupError, AttributeError, RecursionError)


def parsed(text: str, what: str) -> Any:
    """Content of a YAML text; `what` begins the complaint about a bad one."""
    try:
        return yaml.load(text, Loader=Loader)
    except _PROBLEMS as problem:
        why = "nested too deeply" if isinstance(problem, RecursionError) else shortened(problem, 200)
        msg = f"{what}: {why}"
        raise BringupError(msg) from None


def text_of(path: Path) -> str:
    """Text of a file; raises `BringupError` with the reason, in one line, where there is none."""
    try:
        with path.open(encoding="utf-8") as file:
            text = file.read(LARGEST_FILE + 1)
    except OSError as problem:
        msg = f"{path}: cannot be read: {problem.strerror}"
        raise BringupError(msg) from None
    except UnicodeDecodeError:
        msg = f"{path}: not a text file in UTF-8"
        raise BringupError(msg) from None
    if len(text) > LARGEST_FILE:
        msg = f"{path}: too long; allowed: {LARGEST_FILE} characters"
        raise BringupError(msg)
    return text
