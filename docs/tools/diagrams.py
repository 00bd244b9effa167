"""Draw the block diagram of the structure and the graph of nodes: ``python -m docs.tools.diagrams``.

The graph's lines are those of the table of topics; one that is missing here ends the program.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import Path

from ac_common.topics import COMPENSATOR, CONTROLLER, FDI, INJECTOR, PLANT, RECORDER, SCENARIO, TOPICS, Topic

FOLDER = Path(__file__).parents[2] / "docs" / "theory"
INK, BLUE, ORANGE, PAPER = "#1a1a1a", "#0072B2", "#D55E00", "#ffffff"

_HEADS = {INK: "ink", BLUE: "blue", ORANGE: "orange"}

Place = tuple[float, float]


@dataclass
class Drawing:
    """Boxes, arrows and words, as SVG that needs nothing else."""

    width: float
    height: float
    title: str
    parts: list[str] = field(default_factory=list)

    def box(self, at: Place, size: Place, words: Sequence[str], colour: str = INK) -> None:
        """Draw a box around a middle, its words in lines."""
        (x, y), (wide, high) = at, size
        self.parts.append(
            f'<rect x="{x - wide / 2}" y="{y - high / 2}" width="{wide}" height="{high}" rx="5" fill="{PAPER}" '
            f'stroke="{colour}" stroke-width="1.6"/>'
        )
        first = y + 5 - 8 * (len(words) - 1)
        for number, line in enumerate(words):
            self.text((x, first + 16 * number), line, "middle", weight=700 if number == 0 else 400)

    def joint(self, at: Place, *signs: tuple[float, float, str]) -> None:
        """Draw where signals are added, with signs beside it."""
        self.parts.append(f'<circle cx="{at[0]}" cy="{at[1]}" r="9" fill="{PAPER}" stroke="{INK}" stroke-width="1.6"/>')
        for dx, dy, sign in signs:
            self.text((at[0] + dx, at[1] + dy), sign, "middle")

    def arrow(self, *places: Place, colour: str = INK, head: bool = True) -> None:
        """Draw a line through places, with a head at its end."""
        points = " ".join(f"{x},{y}" for x, y in places)
        end = f' marker-end="url(#{_HEADS[colour]})"' if head else ""
        self.parts.append(f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="1.5"{end}/>')

    def text(self, at: Place, words: str, anchor: str = "start", colour: str = INK, weight: int = 400) -> None:
        """Write words; what stands between `_{` and `}` below the line."""
        shown = (
            escape(words)
            .replace("_{", '<tspan dy="4" font-size="10">')
            .replace("}", '</tspan><tspan dy="-4"> </tspan>')
        )
        look = f'text-anchor="{anchor}" fill="{colour}" font-weight="{weight}"'
        self.parts.append(f'<text x="{at[0]}" y="{at[1]}" {look}>{shown}</text>')

    def svg(self) -> str:
        """Return the picture."""
        heads = "".join(
            f'<marker id="{name}" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="7" markerHeight="7" '
            f'orient="auto-start-reverse"><path d="M0,0 L10,5 L0,10 z" fill="{colour}"/></marker>'
            for colour, name in _HEADS.items()
        )
        return (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {self.width} {self.height}" role="img" '
            f'font-family="DejaVu Sans, Verdana, sans-serif" font-size="13">\n<title>{escape(self.title)}</title>\n'
            f'<defs>{heads}</defs>\n<rect width="100%" height="100%" fill="{PAPER}"/>\n'
            + "\n".join(self.parts)
            + "\n</svg>\n"
        )


def structure() -> str:
    """Return the block diagram of the structure."""
    d = Drawing(960, 420, "The GIMC structure: K0 in coprime factors, observer, isolation filter, compensator")
    d.arrow((20, 90), (91, 90))
    d.text((24, 82), "r")
    d.joint((100, 90), (-16, 26, "−"))
    d.arrow((109, 90), (150, 90))
    d.box((185, 90), (70, 46), ("Ũ",))
    d.arrow((220, 90), (261, 90))
    d.joint((270, 90), (16, 26, "+"))
    d.arrow((279, 90), (320, 90))
    d.box((360, 90), (80, 46), ("Ṽ⁻¹",))
    d.arrow((400, 90), (481, 90))
    d.text((430, 82), "u")
    d.joint((490, 90))
    d.arrow((490, 30), (490, 81), colour=ORANGE)
    d.text((500, 40), "f_{N}  compressor off its speed", colour=ORANGE)
    d.arrow((499, 90), (550, 90))
    d.box((605, 90), (110, 54), ("plant", "d: air flow"))
    d.arrow((660, 90), (741, 90))
    d.text((672, 82), "actual")
    d.joint((750, 90))
    d.arrow((750, 30), (750, 81), colour=ORANGE)
    d.text((760, 40), "f_{p}  reading off", colour=ORANGE)
    d.arrow((759, 90), (930, 90))
    d.text((905, 82), "y")
    d.arrow((860, 90), (860, 400), (100, 400), (100, 99))
    d.arrow((455, 90), (455, 190), (500, 190))
    d.box((535, 190), (70, 46), ("Ñ",), BLUE)
    d.arrow((570, 190), (611, 190))
    d.joint((620, 190), (-20, -12, "+"), (20, -12, "−"))
    d.arrow((860, 190), (740, 190))
    d.box((705, 190), (70, 46), ("M̃",), BLUE)
    d.arrow((670, 190), (629, 190))
    d.text((536, 152), "observer: f_{e} = Ñu − M̃y", "start", BLUE)
    d.arrow((620, 199), (620, 280), (421, 280), colour=BLUE)
    d.text((540, 272), "f_{e}", colour=BLUE)
    d.box((360, 280), (120, 54), ("Q", "compensator"), BLUE)
    d.arrow((300, 280), (270, 280), (270, 99), colour=BLUE)
    d.text((278, 200), "q", colour=BLUE)
    d.arrow((620, 280), (665, 280), colour=BLUE)
    d.box((715, 280), (100, 54), ("H", "residuals"), BLUE)
    d.arrow((715, 307), (715, 327), colour=BLUE)
    d.box((715, 350), (150, 44), ("decision", "isolated: f_{N}, f_{p}"), BLUE)
    d.arrow((640, 350), (360, 350), (360, 308), colour=BLUE)
    d.text((400, 343), "which Q acts", colour=BLUE)
    d.text((20, 30), "black: the loop with K0 = Ṽ⁻¹Ũ")
    d.text((20, 50), "blue: what makes it fault-tolerant; silent without faults", colour=BLUE)
    return d.svg()


#: Middle of each node, and the lines between them: through which places, and where the topics are written.
NODES = {
    SCENARIO: (100.0, 210.0),
    CONTROLLER: (380.0, 90.0),
    INJECTOR: (660.0, 210.0),
    PLANT: (940.0, 210.0),
    FDI: (660.0, 370.0),
    COMPENSATOR: (380.0, 370.0),
}
LINES: dict[tuple[str, str], tuple[tuple[Place, ...], Place, str]] = {
    (SCENARIO, CONTROLLER): (((130, 186), (130, 100), (300, 100)), (138, 94), "start"),
    (SCENARIO, COMPENSATOR): (((130, 234), (130, 370), (300, 370)), (138, 364), "start"),
    (SCENARIO, INJECTOR): (((180, 210), (580, 210)), (380, 203), "middle"),
    (SCENARIO, PLANT): (((70, 186), (70, 30), (940, 30), (940, 186)), (520, 24), "middle"),
    (CONTROLLER, INJECTOR): (((460, 80), (640, 80), (640, 186)), (468, 74), "start"),
    (INJECTOR, CONTROLLER): (((620, 186), (620, 110), (460, 110)), (468, 126), "start"),
    (INJECTOR, PLANT): (((740, 200), (860, 200)), (800, 172), "middle"),
    (PLANT, INJECTOR): (((860, 222), (740, 222)), (800, 240), "middle"),
    (INJECTOR, FDI): (((660, 234), (660, 346)), (668, 290), "start"),
    (CONTROLLER, FDI): (((440, 114), (440, 310), (620, 310), (620, 346)), (448, 303), "start"),
    (FDI, COMPENSATOR): (((580, 370), (460, 370)), (520, 412), "middle"),
    (COMPENSATOR, CONTROLLER): (((360, 346), (360, 114)), (352, 275), "end"),
    (PLANT, SCENARIO): (((960, 234), (960, 440), (60, 440), (60, 234)), (520, 434), "middle"),
}


def graph() -> str:
    """Return the graph of the nodes.

    Raises
    ------
    KeyError
        For a line that the table of topics has, and `LINES` not.
    """
    d = Drawing(1040, 470, "The nodes of the loop and the topics between them")
    between: dict[tuple[str, str], list[Topic]] = {}
    for topic in TOPICS:
        for subscriber in topic.subscribers:
            between.setdefault((topic.publisher, subscriber), []).append(topic)
    for pair, topics in between.items():
        places, at, anchor = LINES[pair]
        d.arrow(*places)
        d.text(at, _named(topics), anchor, BLUE)
    for name, place in NODES.items():
        d.box(place, (160, 48), (name,), BLUE if name in (FDI, COMPENSATOR) else INK)
    d.text((20, 462), f"{RECORDER} subscribes to all of them and writes the bag; every node reports on /diagnostics")
    return d.svg()


def _named(topics: Sequence[Topic]) -> str:
    """Return the topics of a line: of several under one name that name."""
    folders: dict[str, list[str]] = {}
    for topic in topics:
        folder, _, name = topic.name.rpartition("/")
        folders.setdefault(folder, []).append(name)
    shown = [f"{folder}/{names[0]}" if len(names) == 1 else f"{folder}/…" for folder, names in folders.items()]
    return ", ".join(shown)


def main() -> None:
    """Write both pictures."""
    (FOLDER / "structure.svg").write_text(structure(), encoding="utf-8")
    (FOLDER / "nodes.svg").write_text(graph(), encoding="utf-8")


if __name__ == "__main__":
    main()
