"""The README's picture: `python -m docs.tools.road_picture FOLDER` draws `on_the_road`, with K0 alone beside it.

The same plots are in the report of the README's first command, under "The whole run".
"""

import sys
from collections.abc import Sequence
from pathlib import Path

from ac_experiments.report.matplotlib_charts import draw
from ac_experiments.report.panels import charts_of
from ac_experiments.scenario import load
from ac_experiments.simulate import simulate

SCENARIO = "on_the_road"
#: What is drawn, two in a row: what is controlled, what is estimated, the load.
PANELS = ("p_e", "r_p", "SH", "r_N", "air_flow", "condenser_flow", "air_inlet", "condenser_inlet")


def main(arguments: Sequence[str]) -> int:
    """Draw it."""
    (folder,) = arguments
    scenario = load(SCENARIO)
    run, alone = (simulate(scenario, passive) for passive in (False, True))
    picture = draw(charts_of(run, alone, PANELS), title=f"{SCENARIO}: {scenario.description}")
    (Path(folder) / f"{SCENARIO}.svg").write_text(picture, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
