"""YAML, read and written in one way: numbers as YAML 1.2 has them, no key twice, an end to every file that is read."""

import re
from pathlib import Path
from typing import Any

import yaml

from ac_common.errors import UserError, shortened

#: Longest file, in characters: thousands of changes of a scenario, and an end to /dev/zero.
LARGEST_FILE = 250_000

#: What the parser lets through besides its own errors: a date that is none, a number too long, nesting without end.
_PROBLEMS = (ValueError, TypeError, LookupError, AttributeError, RecursionError, AssertionError)

#: The parser's words for it.
_TWICE = re.compile(r'found duplicate key "?(.*?)"? with value .*', re.DOTALL)

#: Text that every reader takes for text without quotation marks, those of YAML 1.1 (the middleware's) included.
_PLAIN = re.compile(r"(?!(?:y|n|yes|no|on|off|true|false|null)$)[a-z/_].*", re.IGNORECASE)


def parsed(text: str, what: str) -> Any:
    """Return the content of a YAML text.

    Parameters
    ----------
    text
        One document.
    what
        Beginning of the complaint about a bad one.

    Raises
    ------
    UserError
        In one line: what is wrong, and in which line and column.
    """
    from ruamel.yaml import YAML  # no node reads YAML, most of them write it
    from ruamel.yaml.error import YAMLError

    try:
        return YAML(typ="safe", pure=True).load(text)
    except (YAMLError, *_PROBLEMS) as problem:
        why = "nested too deeply" if isinstance(problem, RecursionError) else _why(problem)
        raise UserError(f"{what}: {why}") from None


def shipped(path: Path) -> Any:
    """Return the content of a YAML file that comes with the program: in a tenth of the time, and with no complaints.

    Numbers need a point here, as in YAML 1.1.
    """
    return yaml.load(path.read_text(encoding="utf-8"), Loader=yaml.CSafeLoader)


def _why(problem: Exception) -> str:
    """Return what is wrong with a text, and where, without the parser's advice to programmers."""
    said, mark = getattr(problem, "problem", None), getattr(problem, "problem_mark", None)
    if not said:
        return shortened(problem, 200)
    said = _TWICE.sub(r"key '\1' is given twice", str(said))
    place = f" in line {mark.line + 1}, column {mark.column + 1}" if mark is not None else ""
    return f"{shortened(said, 160)}{place}"


def text_of(path: Path) -> str:
    """Return the text of a file.

    Raises
    ------
    UserError
        In one line: why there is none.
    """
    try:
        with path.open(encoding="utf-8") as file:
            text = file.read(LARGEST_FILE + 1)
    except OSError as problem:
        raise UserError(f"{path}: cannot be read: {problem.strerror}") from None
    except UnicodeDecodeError:
        raise UserError(f"{path}: not a text file in UTF-8") from None
    if len(text) > LARGEST_FILE:
        raise UserError(f"{path}: too long; allowed: {LARGEST_FILE} characters")
    return text


def yaml_text(content: Any, width: int = 80, flow: bool = False) -> str:
    """Return plain data as YAML in lines of about `width` characters, as a block or in brackets (`flow`).

    What stands twice in it is written twice.
    """
    text: str = yaml.dump(
        content, Dumper=_Writer, default_flow_style=flow, sort_keys=False, width=width, allow_unicode=True
    )
    return text


class _Writer(yaml.CSafeDumper):  # type: ignore[misc]
    """Quotes text that another reader might take for something else; never refers to what has been written before."""

    def ignore_aliases(self, data: Any) -> bool:  # noqa: ARG002
        return True

    def represent_str(self, data: str) -> Any:
        return self.represent_scalar("tag:yaml.org,2002:str", data, style=None if _PLAIN.fullmatch(data) else "'")


_Writer.add_representer(str, _Writer.represent_str)
