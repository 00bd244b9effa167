"""Plots in a page that needs nothing else: one to zoom and point at, and a still one for print and for files."""

import base64
import gzip
import json
from collections.abc import Sequence
from pathlib import Path

from ac_experiments.report import matplotlib_charts
from ac_experiments.report.charts import Chart
from ac_experiments.report.parts import Plot
from ac_experiments.report.plotly_charts import NARROW, WIDE, figure, library

#: Of a still picture, by columns: size of each plot, so that letters are as large on paper in all of them.
_SIZES_IN = {1: (11.2, 2.55), 2: (5.6, 2.55), 3: (3.75, 2.3)}

#: Draws each plot as wide as the page allows, and anew in one column when the window gets narrow, or wide again.
_DRAW = """
const narrow = matchMedia("(max-width: 760px)");
const drawAll = () => {
  for (const [name, plot] of Object.entries(plots)) {
    const layout = narrow.matches ? plot.narrow : plot.wide;
    document.getElementById(name).style.height = layout.height + "px";
    Plotly.react(name, plot.data, structuredClone(layout), config);
  }
};
drawAll();
narrow.addEventListener("change", drawAll);
"""


class Plots:
    """Puts plots into a page.

    Parameters
    ----------
    pictures
        Path of the page without its suffix: the still pictures are written beside it. None: they are not written.
    """

    def __init__(self, pictures: Path | None) -> None:
        self._pictures = pictures
        self._figures: dict[str, str] = {}

    def put(self, charts: Sequence[Chart], name: str, title: str, columns: int = 2, still_columns: int = 0) -> Plot:
        """Return a plot of `charts` in so many columns, the still picture in others when it is said.

        `name` goes to the picture's file name.
        """
        still_columns = still_columns or columns
        size_in = _SIZES_IN[still_columns]
        moving = figure(charts, columns, WIDE)
        wide, narrow = moving["layout"], figure(charts, 1, NARROW)["layout"]
        self._figures[f"plots{name}"] = json.dumps({"data": moving["data"], "wide": wide, "narrow": narrow})
        if self._pictures is None:
            still = matplotlib_charts.draw(charts, still_columns, title, size_in)
        else:
            still = matplotlib_charts.save(
                charts, self._pictures.with_name(self._pictures.name + name), still_columns, title, size_in
            )
        picture = base64.b64encode(still.encode()).decode()
        return Plot(f"plots{name}", title, wide["height"], picture)

    def script(self) -> str:
        """Return the plotting library and all plots as the page unpacks them: gzip in base64, half the size."""
        figures = ", ".join(f'"{name}": {moving}' for name, moving in self._figures.items())
        config = {"responsive": True, "displaylogo": False, "toImageButtonOptions": {"format": "svg", "scale": 1}}
        text = f"{library()}\nconst plots = {{{figures}}}, config = {json.dumps(config)};{_DRAW}"
        return base64.b64encode(gzip.compress(text.encode(), 6, mtime=0)).decode()
