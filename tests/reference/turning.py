"""Programs with `G70` to `G72.2` for the comparison with the reference interpreter, the same for the same seed.

Contours go forward and up in a frame of their own, along and across the passes, with lines and arcs of both senses, and are then laid
into Z and X in each of the eight ways. Starts are where a programmer would put them, and where he would not: on the wrong side of
the contour, inside it, beyond its end, level with its first point, at it.
"""

import math
import random

FORMS = ("G71", "G71", "G71.1", "G71.2", "G72", "G72", "G72.1", "G72.2", "G70", "G70")
STARTS = ("above", "above", "above", "above", "low", "low", "inside", "beyond", "wrong", "level", "at", "beside", "anywhere")


class Contour:
    """Points and arcs in the frame, along and across."""

    def __init__(self, chance):
        self.chance = chance
        self.at = [round(chance.uniform(-3, 3), 3), round(chance.uniform(0, 8), 3)]
        self.first = list(self.at)
        self.pieces = []

    def add(self, to, center=None, is_hill=False):
        to = [round(value, 5) for value in to]
        self.pieces.append((list(self.at), to, center, is_hill))
        self.at = to

    def line(self):
        kind = self.chance.random()
        if kind < 0.5 and self.pieces and self.pieces[-1][2] is None:
            # Two lines in one direction with D are refused there: see differences.json.
            kind = 0.3 if self.pieces[-1][0][1] == self.at[1] else 0.0
        along, across = self.chance.uniform(0.5, 8), self.chance.uniform(-6, 8)
        if kind < 0.3:
            across = 0.0
        elif kind < 0.5:
            along = 0.0
        elif kind < 0.52:
            # Against the direction of the passes.
            along = -self.chance.uniform(0.0005, 2)
        self.add([self.at[0] + along, self.at[1] + across])

    def arc(self):
        is_hill = self.chance.random() < 0.5
        radius = self.chance.uniform(0.8, 9)
        one, other = sorted(self.chance.choice((0.0, 0.5 * math.pi, math.pi, self.chance.uniform(0, math.pi)))
                            for _ in range(2))
        if other - one < 0.15:
            one, other = 0.2, 2.6
        if self.chance.random() < 0.02:
            other += self.chance.uniform(0.01, 0.6)
        begin, end = (other, one) if is_hill else (2 * math.pi - other, 2 * math.pi - one)
        if not is_hill and self.chance.random() < 0.1:
            # A short one, whose ends are on one side of its middle.
            begin, end = sorted((begin, 0.5 * (begin + end)))
        center = [self.at[0] - radius * math.cos(begin), self.at[1] - radius * math.sin(begin)]
        self.add([center[0] + radius * math.cos(end), center[1] + radius * math.sin(end)], center, is_hill)

    def heights(self):
        ends = [piece[1] for piece in self.pieces] + [self.first]
        return [min(end[1] for end in ends), max(end[1] for end in ends), max(end[0] for end in ends)]


def start_of(contour, chance):
    """Where the cycle starts, in the frame."""
    low, high, last = contour.heights()
    along, across = contour.first
    kind = chance.choice(STARTS)
    before = along - chance.choice((0.0, 0.0, chance.uniform(0.2, 4)))
    if kind == "above":
        return [before, high + chance.choice((0.0, chance.uniform(0.1, 5)))]
    if kind == "low":
        return [before, chance.uniform(across, high)]
    if kind == "inside":
        return [before + chance.uniform(0, last - along), across + chance.uniform(-3, 0.5 * (high - across))]
    if kind == "beyond":
        return [last + chance.uniform(0, 4), high + chance.uniform(-2, 4)]
    if kind == "wrong":
        return [before, low - chance.uniform(0, 5)]
    if kind == "level":
        return [along - chance.uniform(-2, 4), across]
    if kind == "at":
        return [along, across]
    if kind == "beside":
        return [along + chance.choice((-1, 1)) * chance.uniform(0.001, 0.5), across + chance.uniform(-0.5, 2)]
    return [chance.uniform(along - 5, last + 5), chance.uniform(low - 5, high + 5)]


class Layout:
    """From the frame to Z and X."""

    def __init__(self, chance, facing):
        self.facing = facing
        self.signs = [chance.choice((-1, 1)), chance.choice((-1, 1, 1))]
        self.origin = [round(chance.uniform(-20, 20), 2), round(chance.uniform(25, 45), 2)]

    def place(self, point):
        along, across = (value * sign for value, sign in zip(point, self.signs))
        z, x = (across, along) if self.facing else (along, across)
        return [self.origin[0] + z, self.origin[1] + x]

    def code(self, is_hill):
        sense = self.signs[0] * self.signs[1] * (-1 if self.facing else 1)
        return "G2" if is_hill == (sense > 0) else "G3"


class Program:
    def __init__(self, chance):
        self.chance = chance
        self.form = chance.choice(FORMS)
        facing = self.form.startswith("G72") or self.form == "G70" and chance.random() < 0.4
        self.layout = Layout(chance, facing)
        self.diameter = chance.random() < 0.4
        self.inch = chance.random() < 0.1
        self.contour = Contour(chance)
        for _ in range(chance.randint(1, 7)):
            if chance.random() < 0.6:
                self.contour.line()
            else:
                self.contour.arc()
        self.start = start_of(self.contour, chance)

    def words(self, point):
        z, x = self.layout.place(point)
        return f"X{self.number(x * (2 if self.diameter else 1))} Z{self.number(z)}"

    def number(self, value):
        text = f"{value / (25.4 if self.inch else 1.0):.{8 if self.inch else 6}f}".rstrip("0").rstrip(".")
        return "0" if text in ("-0", "") else text

    def is_followed_by_line(self, index):
        """Whether a corner can be behind a piece; its tolerances are lengths in the program's unit there."""
        return not self.inch and index + 1 < len(self.contour.pieces) and self.contour.pieces[index + 1][2] is None

    def contour_lines(self):
        chance = self.chance
        yield f"{chance.choice(('G0', 'G0', 'G1'))} {self.words(self.contour.first)}"
        for index, (begin, end, center, is_hill) in enumerate(self.contour.pieces):
            if center is None:
                corner = ""
                if self.is_followed_by_line(index) and chance.random() < 0.1:
                    corner = f" {chance.choice('AC')}{self.number(chance.uniform(0.1, 1.5))}"
                yield f"G1 {self.words(end)}{corner}"
                continue
            code = self.layout.code(is_hill)
            if chance.random() < 0.25 and math.dist(begin, end) < 1.99 * math.dist(begin, center):
                yield f"{code} {self.words(end)} R{self.number(math.dist(begin, center))}"
                continue
            from_z, from_x = self.layout.place(begin)
            z, x = self.layout.place(center)
            yield f"{code} {self.words(end)} I{self.number(x - from_x)} K{self.number(z - from_z)}"

    def cycle_words(self):
        chance = self.chance
        words = ""
        if self.form == "G70":
            offsets = len(self.contour.pieces) > 1
            if offsets and chance.random() < 0.5:
                words += f" D{self.number(chance.uniform(-0.5, 2))}"
            if offsets and chance.random() < 0.3:
                words += f" E{self.number(chance.uniform(-0.2, 0.5))}"
            return words + (f" P{chance.randint(1, 4)}" if chance.random() < 0.5 else "")
        if chance.random() < 0.8:
            words += f" I{self.number(chance.choice((0.5, 1, 2, chance.uniform(0.3, 4))))}"
        if chance.random() < 0.7:
            words += f" R{self.number(chance.choice((0.25, 0.5, 1, chance.uniform(0.05, 2))))}"
        # The side of D on a contour of one piece is a matter of rounding there: see differences.json.
        if len(self.contour.pieces) > 1 and chance.random() < 0.5:
            words += f" D{self.number(chance.choice((0.2, 0.5, chance.uniform(-0.5, 1.5))))}"
        return words

    def text(self):
        chance = self.chance
        unit = "G20" if self.inch else "G21"
        yield f"{unit} G90 G18 {'G7' if self.diameter else 'G8'} G94 G40"
        yield f"F{8 if self.inch else 200}"
        yield "o100 sub"
        yield from self.contour_lines()
        yield "o100 endsub"
        here = self.start
        place = ""
        if chance.random() < 0.3:
            place, here = f" {self.words(self.start)}", [here[0] - 3, here[1] + 4]
        yield f"G0 {self.words(here)}"
        yield f"{self.form} Q100{place}{self.cycle_words()}"
        if self.form != "G70" and chance.random() < 0.3:
            yield f"G0 {self.words(self.start)}"
            yield "G70 Q100"
        # The motion code of the last move is in force behind a cycle; behind an arc this is refused.
        yield f"{'' if chance.random() < 0.2 else 'G0 '}X{self.number(120.0)}"


def program(seed, index):
    """The text of a program."""
    chance = random.Random(f"turning/{seed}/{index}")
    return "\n".join([f"(turning {seed}/{index})", *Program(chance).text(), "M2"]) + "\n"
