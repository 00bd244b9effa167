"""The ROS arguments of a node's process: what is wrong with them becomes one line."""

import os
import re
import sys
from collections.abc import Sequence

import rclpy
from rclpy.logging import LoggingSeverity, set_logger_level

from ac_common.errors import UserError, shortened
from ac_ros_common._rclpy import RCLError, UnknownROSArgsError

#: Where in its sources the middleware met the problem: nothing that a user can act on.
_ORIGIN = re.compile(r",? at /\S+:\d+")
#: What it says when a file is given that is not there.
_NO_FILE = "Error opening YAML file"


#: How the middleware's logging looks on standard error.
CONSOLE_FORMAT = "RCUTILS_CONSOLE_OUTPUT_FORMAT"


class ArgumentError(UserError):
    """Arguments or a parameter file that the middleware cannot read; the message is one line."""


def init(arguments: Sequence[str] | None = None) -> None:
    """Initialise rclpy from `arguments`, the command line's when None.

    Raises
    ------
    ArgumentError
        When an argument or a parameter file is malformed.
    """
    os.environ.setdefault(CONSOLE_FORMAT, "{name}: {message}")
    set_logger_level("rcl", LoggingSeverity.FATAL)  # it would say the same once more, in its own words
    try:
        rclpy.init(args=list(sys.argv if arguments is None else arguments))
    except UnknownROSArgsError as problem:
        raise ArgumentError(f"unknown ROS argument {shortened(str(problem).strip('[]'), 300)}") from None
    except RCLError as problem:
        text = _ORIGIN.sub("", str(problem)).removeprefix("failed to initialize rcl: ").removeprefix("error not set")
        if _NO_FILE in text:
            text = text.replace(_NO_FILE, "no such file, or it cannot be read")
        raise ArgumentError(shortened(text, 300) or "malformed ROS arguments") from None
    set_logger_level("rcl", LoggingSeverity.UNSET)
