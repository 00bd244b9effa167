"""Draw what a layout shows, from the layout file and a recorded run; a stand-in for a screenshot of the program.

    python layouts/draw.py results/actuator_fault/bag

It writes docs/how-to/foxglove.svg and docs/how-to/plotjuggler.svg.
"""

import json
import re
import sys
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path

HERE = Path(__file__).parent
PICTURES = HERE.parent / "docs" / "how-to"


@dataclass(frozen=True)
class Signal:
    """What one curve or lamp shows: a topic, the field of its message, and a joint or a key where there is one."""

    topic: str
    field: str
    item: str = ""  # index of the joint, its name, or the key of a status
    label: str = ""
    color: str = ""


@dataclass(frozen=True)
class Panel:
    """One panel: where it is (left, top, width, height, all of 1), its title, and what it shows."""

    place: tuple[float, float, float, float]
    title: str
    kind: str
    signals: tuple[Signal, ...]


def foxglove(text: str) -> list[Panel]:
    """Panels of a Foxglove layout."""
    layout = json.loads(text)

    def panels(node, left, top, width, height):
        if isinstance(node, str):
            return [_foxglove_panel(node, layout["configById"][node], (left, top, width, height))]
        share = node["splitPercentage"] / 100
        if node["direction"] == "row":
            first, second = (left, top, width * share, height), (left + width * share, top, width * (1 - share), height)
        else:
            first, second = (
                (left, top, width, height * share),
                (left, top + height * share, width, height * (1 - share)),
            )
        return panels(node["first"], *first) + panels(node["second"], *second)

    return panels(layout["layout"], 0.0, 0.0, 1.0, 1.0)


def _foxglove_panel(name, config, place):
    kind = name.partition("!")[0]
    if kind == "Plot":
        signals = [_message_path(path["value"], path["label"], path["color"]) for path in config["paths"]]
    elif kind == "Indicator":
        signals = [_message_path(config["path"])]
    else:
        signals = [Signal(config["topicToRender"], "status")]
    return Panel(place, config["foxglovePanelTitle"], kind, tuple(signals))


def _message_path(text, label="", color=""):
    status = re.fullmatch(r'(/[\w/]+)\.status\[0\]\.values\[:\]\{key=="([\w/]+)"\}\.value', text)
    if status:
        return Signal(status[1], "value", status[2], label, color)
    plain = re.fullmatch(r"(/[\w/]+)\.(\w+)(?:\[(\d+)\])?", text)
    if not plain:
        raise ValueError(f"not a message path that this script knows: {text}")
    return Signal(plain[1], plain[2], plain[3] or "", label, color)


def plotjuggler(text: str) -> list[Panel]:
    """Panels of a PlotJuggler layout."""

    def panels(node, left, top, width, height):
        if node.tag == "DockArea":
            signals = tuple(_series(curve.get("name"), curve.get("color")) for curve in node.iter("curve"))
            return [Panel((left, top, width, height), node.get("name"), "Plot", signals)]
        found, at = [], 0.0
        for child, share in zip(node, map(float, node.get("sizes").split(";")), strict=True):
            if node.get("orientation") == "|":
                found += panels(child, left + at * width, top, share * width, height)
            else:
                found += panels(child, left, top + at * height, width, share * height)
            at += share
        return found

    return panels(ET.fromstring(text.encode()).find("tabbed_widget/Tab/Container/DockSplitter"), 0.0, 0.0, 1.0, 1.0)


def _series(name, color):
    status = re.fullmatch(r"(/[\w/]+/status)/\w+/((?:threshold/)?\w+)", name)
    if status:
        return Signal(status[1], "value", status[2], name, color)
    joint = re.fullmatch(r"(/[\w/]+)/(\w+)/(position|velocity)", name)
    if joint:
        return Signal(joint[1], joint[3], joint[2], name, color)
    topic, _, field = name.rpartition("/")
    return Signal(topic, field, "", name, color)


LAYOUTS = {"foxglove": ("foxglove.json", foxglove), "plotjuggler": ("plotjuggler.xml", plotjuggler)}


def values(signal, recording):
    """Values of a signal in a recording, tick by tick."""
    import numpy as np

    from ac_common.faults import ISOLABLE_KINDS
    from ac_common.topics import BY_NAME

    topic = signal.topic.removeprefix("/ac/")
    if signal.field == "value":
        fault = ISOLABLE_KINDS.index(signal.item.removeprefix("threshold/"))
        return np.array([row.thresholds[fault] for row in recording.status])
    joints = BY_NAME[topic].joints
    if not joints:
        return recording.series[topic]
    joint = joints[int(signal.item)] if signal.item.isdigit() else signal.item
    return recording.series[f"{topic}:{joint}"]


def draw(panels, recording, file):
    """Draw the panels with the curves of a recording."""
    import matplotlib as mpl

    mpl.use("svg")
    import matplotlib.pyplot as plt

    mpl.rcParams.update({"font.size": 7, "svg.hashsalt": "acftc", "svg.fonttype": "none"})
    mpl.rcParams.update({"axes.formatter.useoffset": False, "axes.formatter.limits": (-6, 9)})
    figure = plt.figure(figsize=(11, 7))
    for panel in panels:
        left, top, width, height = panel.place
        figure.add_artist(plt.Rectangle((left, 1 - top - height), width, height, fill=False, color="#bbbbbb", lw=0.8))
        axes = figure.add_axes((left + 0.06, 1 - top - height + 0.035, width - 0.07, height - 0.06))
        axes.set_title(panel.title, fontsize=7, loc="left", pad=2)
        if panel.kind != "Plot":
            axes.axis("off")
            axes.text(
                0.5, 0.5, f"{panel.kind}\n{panel.signals[0].topic}\n{panel.signals[0].item}", ha="center", va="center"
            )
            continue
        for signal in panel.signals:
            # A curve of ten thousand points on five centimetres: every tenth is enough.
            axes.plot(
                recording.time_s[::10], values(signal, recording)[::10], color=signal.color, lw=0.9, label=signal.label
            )
        axes.legend(fontsize=5, loc="best", frameon=False)
    figure.savefig(file, metadata={"Date": None})


if __name__ == "__main__":
    from ac_experiments.bags.reader import read_bag

    run = read_bag(sys.argv[1])
    for name, (layout_file, read) in LAYOUTS.items():
        draw(read((HERE / layout_file).read_text(encoding="utf-8")), run, PICTURES / f"{name}.svg")
        print(f"wrote {PICTURES / name}.svg")
