"""The block diagram and the graph of nodes are those that are drawn from the code."""

import xml.etree.ElementTree as ET

from ac_common.topics import TOPICS
from docs.tools import diagrams


def test_the_pictures_are_up_to_date() -> None:
    for name, drawn in (("structure", diagrams.structure()), ("nodes", diagrams.graph())):
        file = diagrams.FOLDER / f"{name}.svg"
        assert file.read_text(encoding="utf-8") == drawn, "run `python -m docs.tools.diagrams`"
        ET.fromstring(drawn)


def test_every_line_of_the_graph_is_one_of_the_table() -> None:
    pairs = {(topic.publisher, subscriber) for topic in TOPICS for subscriber in topic.subscribers}
    assert pairs == set(diagrams.LINES)
