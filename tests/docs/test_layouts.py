"""The layouts for Foxglove and PlotJuggler name only topics, fields, joints and keys that exist."""

import json
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from ac_common.fdi_status import StatusRow
from ac_common.topics import BY_NAME, DIAGNOSTICS, JOINT_FIELD, JOINTS, NAMESPACE
from ac_common.wire import pack_status, read_diagnostics
from ac_ros_common.messages import message_class

FOLDER = Path(__file__).parents[2] / "layouts"
sys.path.insert(0, str(FOLDER))

import draw  # noqa: E402

PANELS = {name: read((FOLDER / file).read_text(encoding="utf-8")) for name, (file, read) in draw.LAYOUTS.items()}
SIGNALS = [
    pytest.param(signal, id=f"{name}-{signal.topic}-{signal.item or signal.field}")
    for name, panels in PANELS.items()
    for panel in panels
    for signal in panel.signals
]
STATUS = read_diagnostics(pack_status(0, StatusRow(0.0, False, None, 0.0, 0.0, 0.0, (0.0, 0.0))))[0]


@pytest.mark.parametrize("signal", SIGNALS)
def test_signal_exists(signal: draw.Signal) -> None:
    if signal.topic == "/diagnostics":
        return
    topic = BY_NAME[signal.topic.removeprefix(f"{NAMESPACE}/")]
    fields = message_class(topic.type).get_fields_and_field_types()
    if topic.type == DIAGNOSTICS:
        assert (signal.field, signal.item in STATUS.values) == ("value", True)
        return
    assert signal.field in fields
    if topic.type == JOINTS:
        joint = topic.joints[int(signal.item)] if signal.item.isdigit() else signal.item
        assert joint in topic.joints
        assert JOINT_FIELD[joint] == signal.field  # the others are NaN
    else:
        assert not signal.item


def test_foxglove_places_every_panel_once() -> None:
    layout = json.loads((FOLDER / "foxglove.json").read_text(encoding="utf-8"))

    def leaves(node: object) -> list[str]:
        return [node] if isinstance(node, str) else [*leaves(node["first"]), *leaves(node["second"])]  # type: ignore[index]

    assert sorted(leaves(layout["layout"])) == sorted(layout["configById"])


def test_foxglove_and_lichtblick_show_the_titles_and_legends_are_off_the_data() -> None:
    layout = json.loads((FOLDER / "foxglove.json").read_text(encoding="utf-8"))
    for panel in layout["configById"].values():
        assert panel["foxglovePanelTitle"] == panel["lichtblickPanelTitle"] != ""
        assert "title" not in panel  # which neither program shows
        assert panel.get("legendDisplay", "top") == "top"


def test_plotjuggler_sizes_fit_the_panels() -> None:
    for splitter in ET.parse(FOLDER / "plotjuggler.xml").iter("DockSplitter"):
        sizes = [float(size) for size in splitter.get("sizes", "").split(";")]
        assert len(sizes) == len(splitter) == int(splitter.get("count", 0))
        assert sum(sizes) == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize("panels", PANELS.values(), ids=PANELS)
def test_panels_fill_the_window(panels: list[draw.Panel]) -> None:
    assert sum(width * height for _, _, width, height in (panel.place for panel in panels)) == pytest.approx(1.0)
    assert all(panel.signals for panel in panels)
