"""Draws docs/concepts/*.svg: one drawing per page of docs/concepts.

    python -m docs.concept_drawings

The same source gives the same bytes.
"""

import math
import sys
from collections.abc import Sequence
from html import escape
from pathlib import Path

PLACE = Path(__file__).resolve().parent / "concepts"
WIDTH = 760
INK, GREY, PALE = "#2b3440", "#8a94a3", "#eef1f5"
BLUE, GREEN, ORANGE = "#3b6ea8", "#4b8b62", "#c77b2f"
FILLS = {BLUE: "#e3ecf7", GREEN: "#e4f1e8", ORANGE: "#fbeedd", GREY: "#f3f5f8"}
"""Colours of roles (coordinator, analyzer, worker, other), and of their boxes."""

Point = tuple[float, float]


class Drawing:
    """An SVG drawing; origin at the upper left, in pixels."""

    def __init__(self, title: str, height: int) -> None:
        self.height = height
        self.lines = [f"<title>{escape(title)}</title>"]

    def text(
        self, x: float, y: float, text: str, *, size: int = 14, colour: str = INK,
        anchor: str = "middle", weight: str = "normal",
    ) -> None:  # fmt: skip
        """Add lines of text; ``y`` is the middle of all of them."""
        rows = text.split("\n")
        for number, row in enumerate(rows):
            at = y + (number - 0.5 * (len(rows) - 1)) * 1.3 * size + 0.35 * size
            self.lines.append(
                f'<text x="{x:g}" y="{at:.1f}" font-size="{size}" fill="{colour}" '
                f'text-anchor="{anchor}" font-weight="{weight}">{escape(row)}</text>'
            )

    def box(
        self, area: tuple[float, float, float, float], text: str = "",
        colour: str = GREY, *, size: int = 14,
    ) -> None:  # fmt: skip
        """Add a box (left, top, width, height) with text in its middle."""
        x, y, width, height = area
        self.lines.append(
            f'<rect x="{x:g}" y="{y:g}" width="{width:g}" height="{height:g}" rx="7" '
            f'fill="{FILLS[colour]}" stroke="{colour}" stroke-width="1.5"/>'
        )
        if text:
            self.text(x + width / 2, y + height / 2, text, size=size)

    def line(
        self, points: Sequence[Point], colour: str = INK, *, is_arrow: bool = True,
        dash: str = "", width: float = 1.6,
    ) -> None:  # fmt: skip
        """Add a line through points, with an arrow head at its end or without."""
        path = " ".join(f"{x:g},{y:g}" for x, y in points)
        dashes = f' stroke-dasharray="{dash}"' if dash else ""
        self.lines.append(
            f'<polyline points="{path}" fill="none" stroke="{colour}" '
            f'stroke-width="{width:g}"{dashes}/>'
        )
        if is_arrow:
            (x0, y0), (x, y) = points[-2:]
            angle = math.atan2(y - y0, x - x0)
            corners = " ".join(
                f"{x - 9 * math.cos(angle + turn):.1f},"
                f"{y - 9 * math.sin(angle + turn):.1f}"
                for turn in (-0.42, 0.42)
            )
            self.lines.append(
                f'<polygon points="{x:g},{y:g} {corners}" fill="{colour}"/>'
            )

    def dot(
        self, x: float, y: float, radius: float, fill: str, stroke: str = "none"
    ) -> None:
        """Add a circle."""
        self.lines.append(
            f'<circle cx="{x:g}" cy="{y:g}" r="{radius:g}" fill="{fill}" '
            f'stroke="{stroke}" stroke-width="1.5"/>'
        )

    def robot(
        self, x: float, y: float, turn: float, limbs: int, colour: str,
        *, is_faint: bool = False, size: float = 1.0,
    ) -> None:  # fmt: skip
        """Add a robot, seen from above: a core and limbs."""
        self.lines.append(
            f'<g transform="translate({x:g},{y:g}) rotate({turn:g}) scale({size:g})" '
            f'opacity="{0.35 if is_faint else 1:g}" fill="{colour}">'
        )
        for number in range(limbs):
            angle = 360 / limbs * number
            self.lines.append(
                f'<rect x="7" y="-3" width="13" height="6" rx="2" '
                f'transform="rotate({angle:g})"/><rect x="21" y="-2.5" width="9" '
                f'height="5" rx="2" transform="rotate({angle + 9:g})"/>'
            )
        self.lines.append('<rect x="-7" y="-7" width="14" height="14" rx="3"/></g>')

    def save(self, name: str) -> None:
        """Write the drawing."""
        start = (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} '
            f'{self.height}" width="{WIDTH}" height="{self.height}" '
            'font-family="Helvetica, Arial, sans-serif">\n'
            f'<rect width="{WIDTH}" height="{self.height}" rx="8" fill="white"/>\n'
        )
        text = start + "\n".join(self.lines) + "\n</svg>\n"
        (PLACE / f"{name}.svg").write_text(text, "utf-8")


def island() -> None:
    """Draw one brood of an off-line island."""
    d = Drawing("An off-line island: one brood", 300)
    d.box((20, 70, 170, 150), "", BLUE)
    d.text(105, 88, "population of 15", weight="bold")
    for number in range(15):
        d.robot(42 + number % 5 * 32, 122 + number // 5 * 36, 31 * number,
                3 + number % 2, BLUE if number in {3, 11} else GREY,
                size=0.52)  # fmt: skip
    d.line([(190, 120), (252, 120)])
    d.text(221, 104, "2 parents", size=12)
    d.box((252, 88, 138, 64), "crossover,\nmutation,\ndevelopment", BLUE, size=13)
    d.line([(390, 120), (428, 120)])
    d.box((428, 88, 112, 64), "vet the body\n(analyzer)", GREEN, size=13)
    d.line([(540, 120), (578, 120)])
    d.box((578, 88, 160, 64), "simulate, compute\nfitness (worker)", ORANGE, size=13)
    d.line([(484, 88), (484, 52), (321, 52), (321, 88)], GREEN, dash="5 4")
    d.text(402, 38, "not viable: another attempt", size=12, colour=GREEN)
    d.line([(658, 152), (658, 250), (470, 250)])
    d.text(664, 205, "15 children", size=12, anchor="start")
    d.box(
        (250, 222, 220, 56),
        "survivor selection:\nthe best 15 of 15 + 15",
        BLUE,
        size=13,
    )
    d.line([(250, 250), (105, 250), (105, 220)])
    d.text(178, 264, "next brood", size=12)
    d.save("island")


def arena() -> None:
    """Draw an arena from above, and its clocks."""
    d = Drawing("An arena: robots that live together", 330)
    ring = " ".join(
        f"{180 + 138 * math.cos(math.pi * k / 6):.1f},"
        f"{165 + 138 * math.sin(math.pi * k / 6):.1f}"
        for k in range(12)
    )
    d.lines.append(
        f'<polygon points="{ring}" fill="{PALE}" stroke="{GREY}" stroke-width="5"/>'
    )
    spots = [(110, 110, 20, 3), (255, 120, 70, 4), (132, 204, 10, 4), (84, 176, 40, 4)]
    for x, y, turn, limbs in spots:
        d.robot(x, y, turn, limbs, BLUE)
    d.robot(212, 215, 15, 4, ORANGE)
    d.robot(246, 208, 50, 3, ORANGE)
    d.dot(229, 212, 48, "none", ORANGE)
    d.robot(180, 145, 5, 3, GREEN)
    d.line([(180, 84), (180, 118)], GREEN)
    d.text(180, 72, "birth", size=12, colour=GREEN)
    d.robot(140, 258, 45, 4, GREY, is_faint=True, size=0.8)
    d.text(178, 286, "removed", size=12, colour=GREY)
    d.text(222, 271, "one model", size=12, colour=ORANGE)
    d.text(365, 40, "simulated time", anchor="start", weight="bold")
    d.line([(365, 66), (740, 66)])
    rows = (
        ("fitness of every robot, each 5 s", 5, BLUE),
        ("birth, each 15 s, if two are mature", 15, GREEN),
        ("removal of the least fit, each 30 s", 30, GREY),
    )
    for place, (text, every, colour) in enumerate(rows):
        y = 104 + 56 * place
        d.text(365, y - 14, text, size=13, anchor="start")
        d.line([(365, y + 10), (735, y + 10)], "#d5dae1", is_arrow=False, width=1)
        for second in range(every, 61, every):
            d.dot(365 + 6 * second, y + 10, 4.5, colour)
    d.text(365, 272, "Robots that touch are simulated in one model, all others\n"
           "in models of their own. Wall-clock time decides nothing.", size=13,
           anchor="start")  # fmt: skip
    d.save("arena")


def birth() -> None:
    """Draw the steps of a birth, and who does them."""
    d = Drawing("One birth: steps and processes", 290)
    lanes = (
        ("coordinator", BLUE, 60),
        ("analyzer", GREEN, 150),
        ("worker", ORANGE, 230),
    )
    for name, colour, y in lanes:
        d.line([(110, y), (745, y)], "#d5dae1", is_arrow=False, dash="2 4", width=1)
        d.text(14, y, name, anchor="start", colour=colour, weight="bold")
    d.box((118, 32, 96, 56), "choose\nparents", BLUE, size=13)
    d.line([(214, 60), (236, 60)])
    d.box((236, 32, 108, 56), "make genome,\ndevelop robot", BLUE, size=13)
    d.line([(290, 88), (290, 124)])
    d.box((236, 124, 108, 52), "do parts\nintersect?", GREEN, size=13)
    d.line([(236, 150), (166, 150), (166, 88)], GREEN, dash="5 4")
    d.text(160, 124, "no robot:\nnext attempt", size=12, colour=GREEN, anchor="end")
    d.line([(344, 150), (394, 150), (394, 88)], GREEN)
    d.text(400, 124, "viable", size=12, colour=GREEN, anchor="start")
    d.box((360, 32, 84, 56), "journal", BLUE, size=13)
    d.line([(428, 88), (428, 204)])
    d.box((376, 204, 118, 52), "simulate 12 s,\nfitness", ORANGE, size=13)
    d.line([(494, 230), (520, 230), (520, 88)], ORANGE)
    d.box((484, 32, 84, 56), "journal", BLUE, size=13)
    d.line([(568, 60), (592, 60)])
    d.box((592, 32, 148, 56), "commit in the\norder of births", BLUE, size=13)
    d.line([(666, 88), (666, 124)])
    d.text(666, 140, "rows of the tables", size=13)
    d.save("birth")


def epoch() -> None:
    """Draw the epochs of three islands of a ring."""
    d = Drawing("Epochs of migration on three islands", 300)
    ends = {0: (270, 440, 610), 1: (310, 480, 650), 2: (230, 440, 610)}
    begins = {0: (110, 310, 480), 1: (110, 310, 480), 2: (110, 310, 480)}
    y_of = {0: 70, 1: 140, 2: 210}
    for island_number, y in y_of.items():
        d.text(14, y, f"island {island_number}", anchor="start", weight="bold")
        pairs = zip(begins[island_number], ends[island_number], strict=True)
        for number, (begin, end) in enumerate(pairs):
            d.box(
                (begin, y - 15, end - begin - 4, 30), f"epoch {number}", BLUE, size=13
            )
            following = (*begins[island_number][1:], 650)[number]
            if following > end:
                d.line([(end, y), (following - 4, y)], GREY, is_arrow=False, dash="3 4")
    for sender, other in ((0, 1), (1, 0), (1, 2), (2, 1)):
        for number in range(2):
            x, to = ends[sender][number] - 8, begins[other][number + 1] + 10
            shift = 15 if y_of[other] > y_of[sender] else -15
            d.line([(x, y_of[sender] + shift), (to, y_of[other] - shift)], ORANGE)
    d.line([(110, 256), (735, 256)])
    d.text(735, 272, "time by the clock", size=12, anchor="end")
    d.line([(110, 278), (150, 278)], GREY, is_arrow=False, dash="3 4")
    d.text(
        158, 278, "waits for the migrants of its neighbours", size=12, anchor="start"
    )
    d.line([(430, 278), (465, 278)], ORANGE)
    d.text(473, 278, "migrants", size=12, anchor="start")
    d.save("epoch")


def journal() -> None:
    """Draw what is written when, and what a resumed run reads."""
    d = Drawing("The journal: written before acting, read again after a crash", 320)
    d.box((20, 40, 110, 60), "worker,\nanalyzer", ORANGE, size=13)
    d.line([(130, 70), (180, 70)])
    d.text(155, 54, "answer", size=12)
    d.box((180, 40, 118, 60), "check against\nthe request", BLUE, size=13)
    d.line([(298, 70), (342, 70)])
    d.box((342, 40, 118, 60), "append to\nthe journal", BLUE, size=13)
    d.line([(460, 70), (504, 70)])
    d.box((504, 40, 118, 60), "state machine\ndecides", BLUE, size=13)
    d.line([(622, 70), (660, 70)])
    d.box((660, 40, 84, 60), "tables", GREY, size=13)
    d.line([(401, 100), (401, 150)])
    for number in range(8):
        d.box((200 + 44 * number, 150, 40, 34), str(number), BLUE)
    d.box((552, 150, 40, 34))
    d.text(190, 167, "journal.bin", anchor="end", weight="bold")
    d.line([(548, 140), (574, 196)], ORANGE, is_arrow=False, width=3)
    d.text(606, 167, "killed while writing:\ndropped, asked again", size=12,
           anchor="start", colour=ORANGE)  # fmt: skip
    d.line([(360, 184), (360, 226)], GREEN)
    d.text(370, 206, "revolve resume", size=12, colour=GREEN, anchor="start")
    d.box((60, 226, 140, 60), "experiment\nand seed", GREY, size=13)
    d.line([(200, 256), (262, 256)], GREEN)
    d.box(
        (262, 226, 198, 60),
        "the same state machine\nreads the same answers",
        GREEN,
        size=13,
    )
    d.line([(460, 256), (520, 256)], GREEN)
    d.box((520, 226, 180, 60), "the same births,\nand the run goes on", GREEN, size=13)
    d.save("journal")


def evaluation() -> None:
    """Draw the clocks of an evaluation, and what is computed from its trace."""
    d = Drawing("Evaluation, trace, fitness and measures", 332)
    d.text(20, 34, "evaluation: 12 s of simulated time", anchor="start", weight="bold")
    rows = (
        ("physics: 2400 steps of 5 ms", 3.0, GREY, 2),
        ("brain and sensors: 8 times a second", 6.25, BLUE, 3),
        ("samples of the trace: 5 times a second", 10.0, ORANGE, 3.6),
    )
    for place, (text, gap, colour, radius) in enumerate(rows):
        y = 66 + 30 * place
        d.text(20, y, text, size=13, anchor="start")
        d.line([(300, y), (742, y)], "#d5dae1", is_arrow=False, width=1)
        count = int(440 / gap) + 1
        for number in range(count):
            d.dot(300 + gap * number, y, radius / 1.6, colour)
    d.line([(520, 140), (520, 168)], ORANGE)
    d.box((300, 168, 442, 58), "trace: core position, on request attitude, joints,\n"
          "torques, energy, contacts, sensor readings", ORANGE, size=13)  # fmt: skip
    d.line([(400, 226), (400, 256)])
    d.line([(640, 226), (640, 256)])
    d.box(
        (300, 256, 200, 56), "fitness function:\none number, maximised", BLUE, size=13
    )
    d.box((540, 256, 202, 56), "measures: named numbers,\nrecorded only", GREY, size=13)
    d.line([(300, 284), (240, 284)])
    d.text(232, 284, "selection", anchor="end", weight="bold")
    d.text(20, 197, "A failed evaluation has\na reason and no fitness.", size=13,
           anchor="start", colour=GREY)  # fmt: skip
    d.save("evaluation")


def main() -> int:
    """Draw all; return 0."""
    PLACE.mkdir(exist_ok=True)
    for draw in (island, arena, birth, epoch, journal, evaluation):
        draw()
    return 0


if __name__ == "__main__":
    sys.exit(main())
