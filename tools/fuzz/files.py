"""Random CAM files: words, cycles, arcs, repeats and feeds of every seat, right and wrong ones."""

from __future__ import annotations

import math
import random
from collections.abc import Callable

SEATS = (
    "nx", "solidworks", "creo", "catia", "camworks", "fusion", "hsmworks", "mfgsuite", "camplete",
    "manusnc", "postworks", "surfcam", "apt",
)  # fmt: skip
_HEADS = {
    "nx": "TOOL PATH/MILL,TOOL,T1\nTLDATA/MILL,10.0,0.0,50.0,0.0,0.0\nMSYS/0,0,0,1,0,0,0,1,0\n",
    "fusion": "PARTNO/'x'\nMODE/MILL\nUNITS/MM\nMULTAX/OFF\nPPRINT/'x'\nLOADTL/1, 0, 60, 1\n",
    "hsmworks": "PARTNO/'x'\nUNITS/MM\nLOADTL/1, IN, 0, LENGTH, 60, OSETNO, 1\n",
    "mfgsuite": "BEGIN\nOPNAME/'a'\nUNITS/MM\nAPPLY/MILL\nMCSYS/NUM,1,POINT,0,0,0,VECTOR,1,0,0,"
    "VECTOR,0,1,0\n",
    "camplete": "MCS/1,0,0,$\n0,1,0,$\n0,0,1,$\n0,0,0\nUNITS/MM\n",
    "manusnc": "START/'OPERATION'\nMCS/1,0,0,0,1,0,0,0,1,0,0,0\nUNITS/MM\n",
    "catia": "$$*CATIA0\n$$ A\n$$ 1 0 0 0\n$$ 0 1 0 0\n$$ 0 0 1 0\nPARTNO X\nMULTAX\n",
    "camworks": "OPFEATSTART/A\nUNIT/MM\n",
    "creo": "$$*         Pro/CLfile  Version 8.0\nPARTNO / X\nUNITS / MM\nLOADTL / 1\n",
    "solidworks": "UNIT/MM\nCSYS/1,0,0,0,0,1,0,0,0,0,1,0\nLOAD/TOOL,1\n",
    "postworks": "PARTNO/X\nUNITS/MM\nLOADTL/1,LENGTH,60\n",
    "surfcam": "$$ SURFCAM\nUNITS/MM\nLOADTL/1\n",
    "apt": "PARTNO/X\nUNITS/MM\nLOADTL/1\n",
}
_WORDS = (
    "CUTCOM/LEFT", "MODE/INCR,ON", "MYWORD/1", "AUXFUN/8", "PLUNGE/100", "RETRCT",
    "CLEARP/XYPLAN,80", "GOHOME", "FROM/0,0,100", "OPSKIP/ON", "INSERT/M8", "PPRINT/TEXT",
    "ROTABL/90,CLW,CAXIS", "ORIGIN/0,0,0", "TRANS/0,0,0", "SAFETY/1", "LINTOL/.01",
    "TLAXIS/0,0,1", "LOADTL/2", "CLAMP/ALL", "HEAD/2", "ZERO/1", "MULTAX/ON", "MULTAX/OFF",
    "SELECT/TOOL,3", "TRACUT/1", "CYCLE/ON", "CYCLE/OFF", "FEDRAT/INVERS,AUTO", "SPINDL/LOCK",
    "GODLTA/5,0,0", "GODLTA/-5", "PREFUN/54", "UNITS/MM",
)  # fmt: skip


class Writer:
    """Writes one file; ``random`` decides everything, so a seed gives the same file."""

    def __init__(self, rng: random.Random) -> None:
        self.rng = rng
        self.seat = rng.choice(SEATS)
        self.lines: list[str] = []
        self.at = [0.0, 0.0, 60.0]
        self.wild = rng.random() < 0.3
        """Whether words that a program may have to refuse occur."""

    def text(self) -> str:
        """Return the file."""
        self.lines += _HEADS[self.seat].splitlines()
        self._spindle()
        self.rapid()
        steps = (
            (6, self.cut), (3, self.rapid), (3, self.cycle), (2, self.arc), (2, self.feed),
            (1, self._spindle), (1, self._coolant), (1, self._pause), (2, self.again),
            (1, self._turned), (1, self._change), (1, self.same_place), (1, self.slot),
            (1 if self.wild else 0, self._word),
        )  # fmt: skip
        choice: list[Callable[[], None]] = [step for weight, step in steps for _ in range(weight)]
        self.feed()
        for _ in range(self.rng.randint(1, 9)):
            self.rng.choice(choice)()
        if self.rng.random() < 0.5:
            self.rapid(high=True)
        if self.rng.random() < 0.6:
            self.add("SPINDL/OFF")
        self.add("END-OF-PATH" if self.seat == "nx" else "FINI")
        return "\n".join(self._odd(line) for line in self.lines) + "\n"

    def add(self, line: str) -> None:
        """Add a line."""
        self.lines.append(line)

    def _odd(self, line: str) -> str:
        """Return the line as it is, or in lower case, with blanks, or continued."""
        dice = self.rng.random()
        if "'" in line or "$" in line or "/" not in line:
            return line
        if dice < 0.03:
            return line.lower()
        if dice < 0.05:
            return line.replace("/", " / ", 1).replace(",", " , ")
        if dice < 0.08 and line.count(",") > 2:
            at = line.index(",", len(line) // 2) if "," in line[len(line) // 2 :] else 0
            return f"{line[: at + 1]}$\n{line[at + 1 :]}" if at else line
        return line

    def number(self, low: float, high: float) -> float:
        """Return a number of few digits."""
        return round(self.rng.uniform(low, high), self.rng.choice((0, 1, 3)))

    def goto(self, axis: str = "") -> None:
        """Go to where the tool is said to be."""
        self.add(f"GOTO/{self.at[0]:g},{self.at[1]:g},{self.at[2]:g}{axis}")

    def rapid(self, *, high: bool = False) -> None:
        """Go somewhere in rapid."""
        self.add("RAPID")
        self.at = [self.number(-120, 120), self.number(-120, 120), self.number(20, 80)]
        self.at[2] = 80.0 if high else self.at[2]
        self.goto()

    def cut(self) -> None:
        """Mill some lines, there and back now and then, some with the tool axis."""
        axis = ""
        if self.rng.random() < 0.3:
            i, j = self.rng.uniform(-0.3, 0.3), self.rng.uniform(-0.3, 0.3)
            axis = f",{i:.7f},{j:.7f},{math.sqrt(1.0 - i * i - j * j):.7f}"
        for _ in range(self.rng.randint(1, 4)):
            old = list(self.at)
            self.at = [self.at[0] + self.number(-40, 40), self.at[1] + self.number(-40, 40),
                       self.number(-5, 2)]  # fmt: skip
            self.goto(axis)
            if self.rng.random() < 0.2:
                self.at = old
                self.goto(axis)

    def again(self) -> None:
        """Repeat the last point, once or more."""
        for _ in range(self.rng.randint(1, 3)):
            self.goto()

    def _turned(self) -> None:
        """Turn the tool on the spot."""
        angle = self.rng.uniform(-0.4, 0.4)
        self.goto(f",{math.sin(angle):.7f},0,{math.cos(angle):.7f}")

    def feed(self) -> None:
        """Set a feed, up to more than the axes can do."""
        value = self.rng.choice((5.0, 120.0, 600.0, 3000.0, 9000.0, 40000.0, 90000.0))
        form = self.rng.choice(("FEDRAT/{0:g},MMPM", "FEDRAT/MMPM,{0:g}", "FEDRAT/{0:g}"))
        if self.rng.random() < 0.1:
            form, value = "FEDRAT/{0:g},MMPR", self.rng.choice((0.05, 0.3, 5.0))
        if self.wild and self.rng.random() < 0.1:
            form = "FEDRAT/{0:g},IPM"
        self.add(form.format(value))

    def _spindle(self) -> None:
        forms = ("SPINDL/{},RPM,CLW", "SPINDL/RPM,{},CLW", "SPINDL/{},CLW", "SPINDL/ON")
        if self.wild:
            forms += ("SPINDL/{},RPM,CCLW", "SPINDL/-{},RPM", "SPINDL/OFF", "SPINDL/SFM,{},CLW")
        self.add(self.rng.choice(forms[: 3 if not self.wild else None]).format(
            self.rng.choice((300, 900, 3000, 18000))
        ))  # fmt: skip

    def _coolant(self) -> None:
        kinds = ("ON", "OFF", "MIST", "FLOOD", "flood", "AIR", "THRU", "TAP", "CUSTOM2")
        self.add(f"COOLNT/{self.rng.choice(kinds + (('FOAM',) if self.wild else ()))}")

    def _pause(self) -> None:
        self.add(self.rng.choice(("DELAY/.5", "DELAY/3,REV", "STOP", "OPSTOP", "DELAY/0")))

    def _change(self) -> None:
        """Change the tool, mostly to one that cells with two tools know."""
        if self.rng.random() < 0.5:
            return
        number = self.rng.choice((1, 2, 2))
        word = "LOAD/TOOL" if self.seat in ("nx", "solidworks", "camworks") else "LOADTL"
        self.add(f"{word},{number}" if "/" in word else f"{word}/{number}")
        if self.rng.random() < 0.7:
            self._spindle()
        self.rapid()

    def slot(self) -> None:
        """Mill there and back, over arcs too, at feeds that change on the way."""
        ends = [list(self.at), [self.at[0] + self.number(-40, 40), self.at[1], self.number(-5, 2)]]
        for k in range(self.rng.randint(2, 5)):
            if self.rng.random() < 0.5:
                self.feed()
            self.at = list(ends[(k + 1) % 2])
            self.goto()
        if self.rng.random() < 0.3:
            self.at[2] -= self.rng.choice((4.0, 15.0))
            self.goto()
            self.at[2] += 20.0
            self.goto()

    def same_place(self) -> None:
        """Make holes at one place by more than one cycle, along more than one axis now and then."""
        self.at = [self.number(-100, 100), self.number(-100, 100), self.number(-5, 5)]
        for _ in range(self.rng.randint(1, 3)):
            self.add(self._cycle_words())
            for axis in ("", ",0.28,0,0.96", ",0,0,1")[: self.rng.choice((1, 1, 1, 3))]:
                self.goto(axis)
            self.add("CYCLE/OFF")

    def _word(self) -> None:
        self.add(self.rng.choice(_WORDS))

    def arc(self) -> None:
        """Mill an arc of any sweep, some of them helices, in the seat's own form."""
        radius, start = self.number(2, 40) or 1.0, self.rng.uniform(0, 360)
        sweep = self.rng.choice((30.0, 90.0, 180.0, 270.0, 360.0, self.rng.uniform(1, 359)))
        sign = self.rng.choice((1, -1))
        rise = self.rng.choice((0.0, 0.0, 0.0, -2.0))
        z = self.number(-3, 1)
        x, y = self.number(-60, 60), self.number(-60, 60)

        def point(degrees: float) -> list[float]:
            angle = math.radians(degrees)
            return [x + radius * math.cos(angle), y + radius * math.sin(angle), z]

        def put(where: list[float], up: float) -> str:
            self.at = [round(where[0], 6), round(where[1], 6), where[2] + up]
            return f"GOTO/{self.at[0]:.6f},{self.at[1]:.6f},{self.at[2]:.6f}"

        self.add(put(point(start), 0.0))
        self.lines += [*self._arc_form((x, y, z), radius, sweep, sign, rise),
                       put(point(start + sign * sweep), rise)]  # fmt: skip

    def _arc_form(
        self, c: tuple[float, float, float], r: float, sweep: float, sign: int, rise: float
    ) -> list[str]:
        centre = f"{c[0]:g},{c[1]:g},{c[2]:g}"
        if self.seat in ("fusion", "hsmworks"):
            return [f"MOVARC/{centre},0,0,{sign},{r:g},ANGLE,{sweep:.6f}"]
        if self.seat == "mfgsuite":
            slope = [f"ARCSLP/ {rise:g}"] if rise else []
            return [*slope, f"MOVARC/ CENTER,{centre}, AXIS,0,0,{sign}, RADIUS,{r:g}"]
        if self.seat in ("camplete", "manusnc"):
            return [f"CIRCLE/{centre},0,0,{-sign},{r:g},{sweep:.6f},0.0,0.0,0.0"]
        if self.seat == "nx":
            return [f"CIRCLE/{centre},0,0,{-sign},{r:g},0.06,0.5,10.0,0.0"]
        if self.seat == "camworks":
            way = "COUNTERCLOCKWISE" if sign > 0 else "CLOCKWISE"
            return [f"CIRCLE/{centre},0,0,1,{r:g},{way}"]
        return [f"CIRCLE/{centre},0,0,{sign},{r:g}"]

    def cycle(self) -> None:
        """Make holes by a cycle of the seat, with rapids, changes and repeats between."""
        self.add(self._cycle_words())
        for _ in range(self.rng.randint(1, 3)):
            self.at = [self.number(-100, 100), self.number(-100, 100), self.number(-5, 5)]
            self.goto()
            dice = self.rng.random()
            if dice < 0.15:
                self.again()
            elif dice < 0.3:
                self.rapid()
            elif dice < 0.36:
                self._spindle()
            elif dice < 0.4:
                self.lines += ["CYCLE/OFF", "CYCLE/ON"]
        if self.rng.random() < 0.95:
            self.add("CYCLE/OFF")

    def _cycle_words(self) -> str:
        rng = self.rng
        d, p, f = self.number(1, 30), rng.choice((1.0, 3.0, 7.5)), rng.choice((40, 300, 2500))
        c, r = rng.choice((1, 3, 10)), rng.choice((12, 25))
        kind = rng.choice(("DRILL", "DRILL", "DEEP", "BRKCHP", "REAM", "BORE", "TAP", "FACE"))
        if self.wild:
            kind = rng.choice((kind, "CSINK", "RIGID", "REVERS", "BORE8", "THRU", "MILL", "CIRCUL"))
        wait = rng.choice(("", "", ",DWELL,.5", ",DWELL,2,REV"))
        step = f",STEP,{p:g}" if kind in ("DEEP", "BRKCHP", "THRU") else ""
        own = self._by_position(kind, (d, p, f, c, r), step, wait)
        if own:
            return own
        depth = -d if self.seat == "nx" else d
        if rng.random() < 0.15:
            return f"CYCLE/{kind},FEDTO,{depth:g}{step},MMPR,.1,RAPTO,{c:g}{wait}"
        if kind in ("TAP", "RIGID", "REVERS"):
            return f"CYCLE/{kind},FEDTO,{depth:g},PITCH,1,RAPTO,{c:g}"
        return f"CYCLE/{kind},FEDTO,{depth:g}{step},MMPM,{f:g},RAPTO,{c:g},RTRCTO,{r:g}{wait}"

    def _by_position(
        self, kind: str, numbers: tuple[float, float, float, float, float], step: str, wait: str
    ) -> str:
        """Return the cycle by the positions of the seat, empty where it writes words."""
        d, p, f, c, r = numbers
        rng = self.rng
        if self.seat in ("fusion", "hsmworks") and rng.random() < 0.8:
            step = step.replace("STEP", "INCR")
            level = c + 20 if self.seat == "fusion" else d + c + 20
            return f"CYCLE/{kind}, {d:g}{step}, MMPM, {f:g}, {level:g}, RAPTO, 20{wait}"
        if self.seat == "surfcam" and rng.random() < 0.5:
            return f"CYCLE/{kind},{d:g},{f:g},MMPM,{c:g}"
        if self.seat == "catia" and rng.random() < 0.5:
            return f"CYCLE/{kind},{d:g},{c:g},{f:g},MMPM"
        if self.seat == "camworks":
            peck = f",PECKING,{p:g},{p:g}" if step else ""
            return f"CYCLE/ {kind},G98,{d:g}{peck},MMPM,{f:g},{c:g},{r:g} {r:g} DWELL,0."
        return ""
