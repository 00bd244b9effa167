"""Nodes of the user's in the graph, in place of acftc's, and parameters of the user's for the nodes."""

import shlex
import shutil
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ac_common.errors import UserError, nearest, shortened
from ac_common.topics import FDI, NAMESPACE, RECORDER
from ac_common.yaml_file import parsed, text_of
from bringup.launch.process_table import LOOP_NODES, PROCESSES

if TYPE_CHECKING:
    from ac_ros_common.parameters import Parameter


@dataclass(frozen=True)
class UserNodes:
    """What of a graph is the user's.

    Attributes
    ----------
    commands
        Node name to the command that starts it in place of acftc's.
    by_hand
        Nodes that the user starts: the graph waits for them.
    params_file
        A ROS 2 parameter file that has the last word.
    """

    commands: Mapping[str, Sequence[str]] = field(default_factory=dict)
    by_hand: tuple[str, ...] = ()
    params_file: Path | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Return the nodes whose code is the user's."""
        return (*self.commands, *self.by_hand)

    def program(self, name: str) -> str:
        """Return the program that starts a node."""
        return self.commands.get(name, (sys.executable,))[0]


def user_nodes(
    given: Sequence[str] = (), by_hand: Sequence[str] = (), params_file: Path | str | None = None
) -> UserNodes:
    """Return what a user wants to be different, checked.

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
    UserError
        One line: no such node, a command that cannot be found, a node named twice, or what is wrong in the file.
    """
    commands: dict[str, Sequence[str]] = {}
    for text in given:
        name, _, command = text.partition("=")
        _known(name, f"--node {text}")
        if name in commands:
            raise UserError(f"--node {text}: {name} has a command already")
        commands[name] = _command(command, f"--node {text}")
    for name in by_hand:
        _known(name, f"--without {name}")
        if name in commands:
            raise UserError(f"--without {name}: it has a command, too; either you start it or acftc does")
    chosen = UserNodes(commands, tuple(dict.fromkeys(by_hand)), None if params_file is None else Path(params_file))
    if chosen.params_file is not None:
        _check_file(chosen.params_file, chosen.names)
    return chosen


def _known(name: str, where: str) -> None:
    if name not in LOOP_NODES:
        allowed = f"{nearest(name, LOOP_NODES)} allowed: {', '.join(LOOP_NODES)}"
        raise UserError(f"{where}: no node {shortened(name)!r} can be replaced{allowed}")


def _command(text: str, where: str) -> list[str]:
    try:
        words = shlex.split(text)
    except ValueError as problem:
        raise UserError(f"{where}: {problem}") from None
    if not words:
        raise UserError(f"{where}: no command after the '='")
    if words[0] in ("python", "python3"):
        words[0] = sys.executable  # the one that has ROS, whatever is on the path
    if shutil.which(words[0]) is None:
        raise UserError(f"{where}: {shortened(words[0], 200)!r} is not an executable")
    script = Path(words[1]) if len(words) > 1 and words[0] == sys.executable else None
    if script is not None and script.suffix == ".py" and not script.is_file():
        raise UserError(f"{where}: there is no file {shortened(script, 200)}")
    return words


def _check_file(file: Path, users: Sequence[str]) -> None:
    """Refuse a parameter file with a node or a parameter that does not exist: ROS would silently pass over it."""
    content = parsed(text_of(file), f"{file}: is no YAML")
    if not isinstance(content, dict):
        raise UserError(f"{file}: holds no mapping of node names such as {NAMESPACE}/{FDI}")
    for key, section in content.items():
        name = str(key).removeprefix(f"{NAMESPACE}/")
        if name not in (*LOOP_NODES, RECORDER) or not str(key).startswith("/"):
            nodes = ", ".join(f"{NAMESPACE}/{node}" for node in LOOP_NODES)
            raise UserError(f"{file}: no node {shortened(key)!r}; allowed: {nodes}")
        values = section.get("ros__parameters") if isinstance(section, dict) else None
        if not isinstance(values, dict):
            raise UserError(f"{file}: {key} holds no mapping 'ros__parameters'")
        if name not in users:
            try:
                flat = _flat(values)
            except RecursionError:  # an anchor that holds itself
                raise UserError(f"{file}: {key} is nested too deeply") from None
            _check_names(file, str(key), flat, name)


def given_parameters(file: Path | None) -> dict[str, dict[str, Any]]:
    """Return the parameters in a user's file that `user_nodes` has checked: node name to names, dotted, to values."""
    if file is None:
        return {}
    content = parsed(text_of(file), f"{file}: is no YAML")
    return {
        str(key).removeprefix(f"{NAMESPACE}/"): _flat(section["ros__parameters"]) for key, section in content.items()
    }


def _check_names(file: Path, key: str, values: Mapping[str, Any], name: str) -> None:
    from ac_ros_common.parameters import COMMON

    declared: Sequence[Parameter] = import_module(PROCESSES[name].class_module).PARAMETERS
    allowed = [parameter.name for parameter in (*COMMON, *declared)]
    for given in values:
        if given not in allowed:
            hint = f"{nearest(given, allowed)} allowed: {', '.join(allowed)}"
            raise UserError(f"{file}: {key} has no parameter {shortened(given)!r}{hint}")


def _flat(values: Mapping[str, Any], above: str = "") -> dict[str, Any]:
    """Return nested names joined by dots, as ROS does."""
    flat: dict[str, Any] = {}
    for key, value in values.items():
        flat |= _flat(value, f"{above}{key}.") if isinstance(value, dict) else {f"{above}{key}": value}
    return flat
