"""What the lamps say of a fault that is isolated: while its name is not sure, accommodation waits."""

import re
from dataclasses import replace

import pytest

from ac_common.fdi_status import StatusRow
from ac_experiments.metrics import summarise
from bringup.dash.page import lamps
from tests.dash_views import RUNNING
from tests.small_faults import sure_later


def lit(status: StatusRow, accommodate: bool) -> dict[str, tuple[str, str]]:
    """Colour and words of each lamp that is lit."""
    view = replace(RUNNING, point="high", accommodate=accommodate, status=status)
    found = re.findall(r'class="lamp (\w+) on" data-lamp="(\w+)">([^<]+)<', lamps(view, ""))
    return {name: (colour, words) for colour, name, words in found}


@pytest.mark.parametrize("accommodate", [True, False])
def test_a_name_that_is_not_sure_yet(accommodate: bool) -> None:
    run = sure_later()
    (fault,) = summarise(run)["faults"]
    row_at = {row.time_s: row for row in run.status}
    before, unsure, sure = (lit(row_at[at], accommodate) for at in (0.0, fault["isolated_s"], fault["sure_s"]))
    on = ("good", "accommodation on") if accommodate else None
    waits = ("wait", "accommodation waits: K0 alone") if accommodate else None
    assert [lamp.get("accommodating") for lamp in (before, unsure, sure)] == [on, waits, on]
    assert "isolated_f_p" not in before
    assert re.fullmatch(r"f_p pressure sensor: \+0\.\d kPa, not sure", unsure["isolated_f_p"][1])
    assert re.fullmatch(r"f_p pressure sensor: \+0\.\d kPa", sure["isolated_f_p"][1])
    assert (unsure["isolated_f_p"][0], sure["isolated_f_p"][0]) == ("warn", "bad")
