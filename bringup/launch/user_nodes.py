"""Nodes of your own in the graph, in place of ours, and parameters of your own for the nodes."""

import shlex
import shutil
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ac_common.errors import BringupError, nearest, shortened
from ac_common.topics import COMPENSATOR, CONTROLLER, FDI, INJECTOR, NAMESPACE, PLANT, RECORDER, SCENARIO
from ac_common.yaml_file import parsed, text_of
from bringup.launch.node_modules import MODULES, module_of

if TYPE_CHECKING:
    from ac_ros_common.parameters import Parameter

#: The nodes that somebody else's may stand in for; what is recorded, and how, stays ours.
REPLACEABLE = (PLANT, INJECTOR, FDI, COMPENSATOR, CONTROLLER, SCENARIO)


@dataclass(frozen=True)
class OwnNodes:
    """What differs from the graph as it comes.

    Attributes
    ----------
    commands
        Node name to the command that starts it in place of ours.
    by_hand
        Nodes that the user starts: the graph waits for them.
    params_file
        A ROS 2 parameter file that has the last word.
    """

    commands: Mapping[str, Sequence[str]] = field(default_factory=dict)
    by_hand: tuple[str, ...] = ()
    params_file: Path | None = None

    @property
    def strange(self) -> tuple[str, ...]:
        """Nodes whose code is not ours."""
        return (*self.commands, *self.by_hand)


def own_nodes(
    given: Sequence[str] = (), by_hand: Sequence[str] = (), params_file: Path | str | None = None
) -> OwnNodes:
    """Check what a user wants to be different.

    Parameters
    ----------
    given
        ``NAME=COMMAND`` for each node to be started in another way.
    by_hand
        Names of the nodes that the user starts.
    params_file
        Path of a ROS 2 parameter file.

    Raises
    ------
    BringupError
        One line: no such node, a command that cannot be found, a node named twice, or what is wrong in the file.
    """
    commands: dict[str, Sequence[str]] = {}
    for text in given:
        name, _, command = text.partition("=")
        _known(name, f"--node {text}")
        if name in commands:
            raise BringupError(f"--node {text}: {name} has a command already")
        commands[name] = _command(command, f"--node {text}")
    for name in by_hand:
        _known(name, f"--without {name}")
        if name in commands:
            raise BringupError(f"--without {name}: it has a command, too; either you start it or acftc does")
    chosen = OwnNodes(commands, tuple(dict.fromkeys(by_hand)), None if params_file is None else Path(params_file))
    if chosen.params_file is not None:
        _check_file(chosen.params_file, chosen.strange)
    return chosen


def _known(name: str, where: str) -> None:
    if name not in REPLACEABLE:
        allowed = f"{nearest(name, REPLACEABLE)} allowed: {', '.join(REPLACEABLE)}"
        raise BringupError(f"{where}: no node {shortened(name)!r} can be replaced{allowed}")


def _command(text: str, where: str) -> list[str]:
    try:
        words = shlex.split(text)
    except ValueError as problem:
        raise BringupError(f"{where}: {problem}") from None
    if not words:
        raise BringupError(f"{where}: no command after the '='")
    if words[0] in ("python", "python3"):
        words[0] = sys.executable  # the one that has ROS, whatever is on the path
    if shutil.which(words[0]) is None:
        raise BringupError(f"{where}: {shortened(words[0], 200)!r} is not an executable")
    script = Path(words[1]) if len(words) > 1 and words[0] == sys.executable else None
    if script is not None and script.suffix == ".py" and not script.is_file():
        raise BringupError(f"{where}: there is no file {shortened(script, 200)}")
    return words


def _check_file(file: Path, strange: Sequence[str]) -> None:
    """Refuse a parameter file with a node or a parameter that does not exist: ROS would silently pass over it."""
    content = parsed(text_of(file), f"{file}: is no YAML")
    if not isinstance(content, dict):
        raise BringupError(f"{file}: holds no mapping of node names such as {NAMESPACE}/{FDI}")
    for key, section in content.items():
        name = str(key).removeprefix(f"{NAMESPACE}/")
        if name not in (*REPLACEABLE, RECORDER) or not str(key).startswith("/"):
            nodes = ", ".join(f"{NAMESPACE}/{node}" for node in REPLACEABLE)
            raise BringupError(f"{file}: no node {shortened(key)!r}; allowed: {nodes}")
        values = section.get("ros__parameters") if isinstance(section, dict) else None
        if not isinstance(values, dict):
            raise BringupError(f"{file}: {key} holds no mapping 'ros__parameters'")
        if name not in strange:
            try:
                flat = _flat(values)
            except RecursionError:  # an anchor that holds itself
                raise BringupError(f"{file}: {key} is nested too deeply") from None
            _check_names(file, str(key), flat, name)


def _check_names(file: Path, key: str, values: Mapping[str, Any], name: str) -> None:
    from ac_ros_common.parameters import COMMON

    declared: Sequence[Parameter] = import_module(module_of(MODULES[name])).PARAMETERS
    allowed = [parameter.name for parameter in (*COMMON, *declared)]
    for given in values:
        if given not in allowed:
            hint = f"{nearest(given, allowed)} allowed: {', '.join(allowed)}"
            raise BringupError(f"{file}: {key} has no parameter {shortened(given)!r}{hint}")


def _flat(values: Mapping[str, Any], above: str = "") -> dict[str, Any]:
    """Nested names joined by dots, as ROS does."""
    flat: dict[str, Any] = {}
    for key, value in values.items():
        flat |= _flat(value, f"{above}{key}.") if isinstance(value, dict) else {f"{above}{key}": value}
    return flat
