"""Write the page `docs/reproduction.md`, the paper's numbers beside ours, from one run of `acftc reproduce`.

``python -m docs.tools.reproduction_page --cycle sc03.csv`` runs the experiments and writes the page, its pictures and
`docs/reproduction/paper.json` anew. It takes some minutes; a test only compares the page with `paper.json`.
"""

import json
import math
import sys
from pathlib import Path
from typing import Any

import click

PAGE = Path(__file__).parents[2] / "docs" / "reproduction.md"
FOLDER = PAGE.with_suffix("")


def text(content: dict[str, Any]) -> str:
    """Return the content of the page, given that of ``paper.json``."""
    parts = [
        "# The paper's experiments",
        "",
        "<!-- Written by `python -m docs.tools.reproduction_page --cycle sc03.csv`. -->",
        "",
        "Our numbers beside those that the paper's prose gives, on the nonlinear plant. `acftc reproduce --out",
        "results/paper --cycle sc03.csv` runs all of it on your machine; the schedule SC03 is US EPA's (40 CFR Part",
        "86) and not shipped. *agrees*: within the rule's tolerance of the paper's number. *better*: beyond it in the",
        "direction the paper aims at. *differs*: neither. *noted*: the paper gives no number.",
        "",
        "| | experiment | verdict |",
        "|---|---|---|",
    ]
    parts += [f"| [{key}](#{key.lower()}) | {item['title']} | {item['verdict']} |" for key, item in content.items()]
    for key, item in content.items():
        parts += ["", f"## {key} {item['title']} {{ #{key.lower()} }}", ""]
        if item["findings"]:
            parts += ["| quantity | unit | paper | ours | verdict | rule |", "|---|---|---|---|---|---|"]
            parts += [_row(finding) for finding in item["findings"]]
            parts.append("")
        parts.append(item["remark"])
        if item["figure"]:
            parts += ["", f"![{key}: {item['title']}](reproduction/{item['figure']})"]
    return "\n".join([*parts, ""])


def _row(finding: dict[str, Any]) -> str:
    paper, ours = (_number(finding[key]) for key in ("paper", "ours"))
    cells = (finding["quantity"], finding["unit"], paper, ours, finding["verdict"], finding["rule"])
    return "| " + " | ".join(str(cell).replace("|", "\\|") for cell in cells) + " |"


def _number(value: float | None) -> str:
    return "–" if value is None or not math.isfinite(value) else f"{value:.4g}"


@click.command()
@click.option("--cycle", metavar="FILE", type=click.Path(path_type=Path), help="Drive cycle for E8.")
def main(cycle: Path | None) -> None:
    """Run the experiments and write the page."""
    from ac_experiments.paper.reproduce import reproduce

    FOLDER.mkdir(exist_ok=True)
    reproduce(FOLDER, cycle, lambda line: print(line, file=sys.stderr))
    (FOLDER / "index.html").unlink()  # the page says the same
    content = json.loads((FOLDER / "paper.json").read_text(encoding="utf-8"))
    PAGE.write_text(text(content), encoding="utf-8")


if __name__ == "__main__":
    main()
