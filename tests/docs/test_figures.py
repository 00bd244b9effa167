"""The figures in the documentation's sentences are what comes out today, digit by digit."""

import math
from functools import cache
from typing import Any

import pytest

from docs.tools.doc_figures import MEASURES, ROOT, SENTENCES, Values, groups, printed, rewritten, stated

pytestmark = pytest.mark.slow

#: What is measured through the graph; all else needs no ROS.
THROUGH_THE_GRAPH = "own_controller"


@cache
def measured(group: str) -> Values:
    return MEASURES[group]()


def marked(page: str, sentence: str) -> Any:
    """Have a sentence take its turn with the graphs when it needs one."""
    return pytest.param(page, sentence, marks=pytest.mark.ros if THROUGH_THE_GRAPH in groups(sentence) else ())


@pytest.mark.parametrize(("page", "sentence"), [marked(*pair) for pair in SENTENCES])
def test_a_figure_is_what_is_measured(page: str, sentence: str) -> None:
    text = (ROOT / page).read_text(encoding="utf-8")
    expected = printed(sentence, {group: measured(group) for group in groups(sentence)})
    assert list(stated(sentence, text).groups()) == expected, "run `python -m docs.tools.doc_figures`"


def test_what_is_written_is_what_is_read() -> None:
    sentence = "off by {a[x]:.1f} kPa ({a[y]:+.0f} rpm)"
    text = "Before. It is off\nby 3.0 kPa (+7 rpm) at most; off by much."
    new = rewritten(sentence, text, {"a": {"x": -0.04, "y": -12.2}})
    assert new == "Before. It is off\nby 0.0 kPa (-12 rpm) at most; off by much."
    with pytest.raises(ValueError, match="0 times"):
        stated(sentence, "off by a lot")
    with pytest.raises(ValueError, match="2 times"):
        stated(sentence, text * 2)


def test_words_that_tell_of_figures_hold() -> None:
    """Words for which no figure stands: what is not found, and what is found though it is not there."""
    own_filter, own_scenario = measured("own_filter"), measured("own_scenario")
    assert "5 kPa are not found at all" in " ".join(page("own-filter").split())
    assert math.isnan(own_filter["sensor_isolated_after_s"])
    assert own_filter["threshold_rpm"] > 3 * own_filter["our_threshold_rpm"]  # "several times higher"
    assert "sees a compressor fault that is not there" in " ".join(page("own-scenario").split())
    assert own_scenario["strong_false_alarms"] == 0
    assert own_scenario["strong_false_alarms_of_paper"] > 0


def page(name: str) -> str:
    return (ROOT / "docs" / "how-to" / f"{name}.md").read_text(encoding="utf-8")
