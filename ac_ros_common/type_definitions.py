"""Texts and hashes of message types, as a bag stores them so that a reader needs nothing else."""

import json
import re
import sys
from functools import cache
from pathlib import Path

SEPARATOR = "=" * 80
_PRIMITIVE = re.compile(r"^(bool|byte|char|float(32|64)|u?int(8|16|32|64)|w?string)\b")


def share_folder(package: str) -> Path:
    """Return the folder in which an interface package keeps its definitions."""
    own = Path(sys.prefix) / "share" / package
    if own.is_dir():
        return own
    from ament_index_python.packages import get_package_share_directory  # a ROS installation elsewhere

    return Path(get_package_share_directory(package))


@cache
def definition(type_name: str) -> str:
    """Return the text of ``pkg/msg/Type`` followed by those of all nested types, as the encoding ``ros2msg`` has it."""
    texts = [_own_text(type_name)]
    seen = [type_name]
    for name in seen:  # grows while it is walked
        for nested in _nested(name):
            if nested not in seen:
                seen.append(nested)
                package, _, short = nested.split("/")
                texts.append(f"{SEPARATOR}\nMSG: {package}/{short}\n{_own_text(nested)}")
    return "\n".join(texts)


@cache
def type_hash(type_name: str) -> str:
    """Return the RIHS hash of a message type."""
    package, kind, short = type_name.split("/")
    described = json.loads((share_folder(package) / kind / f"{short}.json").read_text(encoding="utf-8"))
    hashes: dict[str, str] = {entry["type_name"]: entry["hash_string"] for entry in described["type_hashes"]}
    return hashes[type_name]


def _own_text(type_name: str) -> str:
    package, kind, short = type_name.split("/")
    return (share_folder(package) / kind / f"{short}.msg").read_text(encoding="utf-8").strip() + "\n"


def _nested(type_name: str) -> list[str]:
    package = type_name.split("/")[0]
    found = []
    for line in _own_text(type_name).splitlines():
        words = line.split("#")[0].split()
        if len(words) < 2 or "=" in line.split("#")[0] or _PRIMITIVE.match(words[0]):
            continue
        name = words[0].split("[")[0]
        parts = name.split("/")
        if len(parts) == 1:
            parts = ["std_msgs" if name == "Header" else package, name]
        found.append(f"{parts[0]}/msg/{parts[-1]}")
    return found
