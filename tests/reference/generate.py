"""Programs for the comparison with the reference interpreter, the same for the same seed."""

import math
import random

PLANES = {17: ("X", "Y", "Z", "I", "J"), 18: ("Z", "X", "Y", "K", "I"), 19: ("Y", "Z", "X", "J", "K")}


class Writer:
    """Writes lines and follows the position as far as arcs need it."""

    def __init__(self, chance):
        self.chance = chance
        self.lines = []
        self.at = {"X": 0.0, "Y": 0.0, "Z": 0.0}
        self.absolute = True
        self.plane = 17

    def line(self, text):
        number = f"N{len(self.lines) * 10} " if self.chance.random() < 0.1 else ""
        self.lines.append(number + text)

    def value(self, low=-50.0, high=50.0, digits=3):
        return round(self.chance.uniform(low, high), digits)

    def word(self, letter, target):
        """The word that goes to a place, as the distance mode has it."""
        written = round(target if self.absolute else target - self.at[letter], 6)
        self.at[letter] = round(written if self.absolute else self.at[letter] + written, 6)
        return f"{letter}{self.number(written)}"

    def number(self, value):
        """A number in one of the ways to write it."""
        text = f"{value:.6f}".rstrip("0").rstrip(".")
        if text in ("-0", ""):
            text = "0"
        kind = self.chance.random()
        if kind < 0.08:
            part = round(self.chance.uniform(-5, 5), 2)
            return f"[{text} + {part} - {part:+g}]".replace("- -", "+ ").replace("- +", "- ")
        if kind < 0.12:
            return f"[{2 * value:.6f} / 2]"
        if kind < 0.15 and value >= 0:
            return f"SQRT[{text} * {text}]" if value < 1000 else text
        return text

    def move(self, code=None, letters=None):
        letters = letters or self.chance.sample("XYZ", self.chance.randint(1, 3))
        words = " ".join(self.word(letter, self.value()) for letter in letters)
        self.line(f"{code} {words}" if code else words)

    def set_plane(self):
        self.plane = self.chance.choice((17, 18, 19))
        self.line(f"G{self.plane}")

    def set_distance(self):
        self.absolute = self.chance.random() < 0.6
        self.line("G90" if self.absolute else "G91")

    def arc(self, radius_form=None):
        first, second, third, first_centre, second_centre = PLANES[self.plane]
        radius = self.value(1, 40)
        start_angle, sweep = self.chance.uniform(0, 2 * math.pi), self.chance.uniform(0.2, 6.0)
        clockwise = self.chance.random() < 0.5
        centre = [self.at[first] - radius * math.cos(start_angle), self.at[second] - radius * math.sin(start_angle)]
        end_angle = start_angle - sweep if clockwise else start_angle + sweep
        end = [centre[0] + radius * math.cos(end_angle), centre[1] + radius * math.sin(end_angle)]
        if self.chance.random() < 0.1:
            end = [self.at[first], self.at[second]]
        code = "G2" if clockwise else "G3"
        offsets = [round(centre[0] - self.at[first], 6), round(centre[1] - self.at[second], 6)]
        helix = " " + self.word(third, self.value(-5, 5)) if self.chance.random() < 0.3 else ""
        full = end == [self.at[first], self.at[second]]
        words = "" if full and self.chance.random() < 0.5 else " ".join(
            self.word(letter, round(value, 6)) for letter, value in zip((first, second), end))
        radius_form = self.chance.random() < 0.25 if radius_form is None else radius_form
        if radius_form and not full and sweep < 5.8:
            sign = "-" if sweep > math.pi else ""
            if abs(sweep - math.pi) < 0.05:
                sign = ""
            self.line(f"{code} {words}{helix} R{sign}{radius:.6f}")
            return
        turns = f" P{self.chance.randint(1, 4)}" if self.chance.random() < 0.15 else ""
        self.line(f"{code} {words}{helix} {first_centre}{self.number(offsets[0])} {second_centre}{self.number(offsets[1])}{turns}")


def contour(w):
    w.line(f"G1 F{w.value(50, 900, 1)}")
    for _ in range(w.chance.randint(8, 25)):
        kind = w.chance.random()
        if kind < 0.3:
            w.move(w.chance.choice(("G0", "G1", "G1")))
        elif kind < 0.65:
            w.arc()
        elif kind < 0.75:
            w.set_plane()
        elif kind < 0.85:
            w.set_distance()
        elif kind < 0.9:
            w.line(f"F{w.value(20, 2000, 2)}")
        elif kind < 0.95:
            w.line(f"G4 P{w.value(0.1, 3, 2)}")
        else:
            w.line(w.chance.choice(("G61", "G61.1", "G64", "G64 P0.05", "G64 P0.02 Q0.01", "G64 Q0.01")))


def feeds(w):
    w.line("S900 M3")
    mode = 94
    w.line(f"G94 F{w.value(50, 500, 1)}")
    for _ in range(w.chance.randint(6, 16)):
        kind = w.chance.random()
        if kind < 0.3:
            mode = w.chance.choice((93, 94, 95))
            feed = {93: w.value(0.5, 10, 2), 94: w.value(50, 900, 1), 95: w.value(0.05, 0.6, 3)}[mode]
            letter = w.chance.choice("XYZ")
            w.line(f"G{mode} G1 {w.word(letter, w.value())} F{feed}")
        elif kind < 0.5:
            letters = w.chance.sample("XYZ", w.chance.randint(1, 3))
            words = " ".join(w.word(letter, w.value()) for letter in letters)
            w.line(f"G1 {words}" + (f" F{w.value(0.5, 10, 2)}" if mode == 93 else ""))
        elif kind < 0.6:
            w.move("G0")
        elif kind < 0.7:
            w.line(f"G1 A{w.value(-90, 90, 1)}" + (f" F{w.value(0.5, 10, 2)}" if mode == 93 else ""))
        elif kind < 0.8:
            # A stopped spindle never advances a feed per revolution: see differences.json.
            w.line(w.chance.choice(("M3", "M4", "S1200", "M8", "M9", "M7")))
        elif kind < 0.9:
            w.line(f"G4 P{w.value(0.1, 2, 2)}")
        else:
            w.line(f"F{w.value(0.1, 300, 2)}" if mode != 93 else "M8")


def inches(w):
    w.line("G20")
    w.line(f"G1 F{w.value(1, 50, 2)}")
    for _ in range(w.chance.randint(5, 15)):
        kind = w.chance.random()
        if kind < 0.35:
            w.move(w.chance.choice(("G0", "G1")))
        elif kind < 0.6:
            w.arc()
        elif kind < 0.7:
            w.line(f"G21 F{w.value(10, 500, 1)}")
            w.move("G1", ["X", "Y", "Z"])
            w.line("G20")
            w.absolute = True
            w.line("G90 G0 X0 Y0 Z0")
            w.at = {"X": 0.0, "Y": 0.0, "Z": 0.0}
            w.line(f"F{w.value(1, 50, 2)}")
        elif kind < 0.8:
            w.set_distance()
        else:
            w.set_plane()


def drilling(w):
    w.line(f"S600 M3 G1 F{w.value(50, 300, 1)}")
    w.plane = 17
    if w.chance.random() < 0.3:
        w.set_plane()
    first, second, third = PLANES[w.plane][:3]
    w.line(f"G0 {third}{w.value(5, 30)}")
    for _ in range(w.chance.randint(2, 5)):
        # Tapping beside the XY plane and repeats of G74 are faults there: see differences.json.
        code = w.chance.choice((73, 81, 82, 83, 85, 86, 89) + ((84, 74) if w.plane == 17 else ()))
        incremental = w.chance.random() < 0.3
        w.line("G91" if incremental else "G90")
        w.line(w.chance.choice(("G98", "G99")))
        if incremental:
            depth, level = w.value(-12, -1, 2), w.value(-8, 3, 2)
        else:
            level = w.value(-2, 5, 2)
            depth = round(level - w.chance.uniform(1, 15), 2)
        words = f"{first}{w.value(-30, 30, 2)} {second}{w.value(-30, 30, 2)} {third}{depth} R{level}"
        if code in (73, 83):
            words += f" Q{w.value(0.5, 6, 2)}"
        if code in (82, 86, 89, 84, 74) and (code in (82, 86, 89) or w.chance.random() < 0.5):
            words += f" P{w.value(0, 1, 2)}"
        if code != 74 and w.chance.random() < 0.3:
            words += f" L{w.chance.randint(1, 3)}"
        if code == 74:
            w.line("M4")
        w.line(f"G{code} {words}")
        for _ in range(w.chance.randint(0, 3)):
            w.line(f"{first}{w.value(-30, 30, 2)}" + (f" {second}{w.value(-30, 30, 2)}" if w.chance.random() < 0.6 else ""))
        if code == 74:
            w.line("G80")
            w.line("M3")
        elif w.chance.random() < 0.5:
            w.line("G80")
            w.line(f"G90 G0 {third}{w.value(5, 30)}")
            if w.chance.random() < 0.3:
                w.line(f"F{w.value(30, 400, 1)}")
    w.line("G80")


def compensation(w):
    """A closed contour of lines and tangent or cornered arcs, outside or inside, in the XY plane."""
    radius = w.value(0.5, 4, 2)
    left = w.chance.random() < 0.5
    w.line(f"G0 X{w.value(-60, -40)} Y{w.value(-60, -40)}")
    w.line(f"F{w.value(50, 900, 1)}")
    code = "G41.1" if left else "G42.1"
    corners, angle = [], w.chance.uniform(0, 1)
    count = w.chance.randint(3, 7)
    for index in range(count):
        at = angle + (1 if left else -1) * -2 * math.pi * index / count
        size = w.value(18, 38)
        corners.append((round(size * math.cos(at), 3), round(size * math.sin(at), 3)))
    first = corners[0]
    w.line(f"{code} D{2 * radius:g} G1 X{first[0] + w.value(-3, 3)} Y{first[1] + w.value(-3, 3)}")
    w.at.update(X=first[0], Y=first[1])
    w.line(f"G1 X{first[0]} Y{first[1]}" if w.chance.random() < 0.5 else f"X{first[0]} Y{first[1]}")
    for corner in corners[1:] + [first]:
        dx, dy = corner[0] - w.at["X"], corner[1] - w.at["Y"]
        distance = math.hypot(dx, dy)
        if distance > 6 and w.chance.random() < 0.35:
            bend = round(distance * w.chance.uniform(0.6, 2.0), 4)
            w.line(f"{w.chance.choice(('G2', 'G3'))} X{corner[0]} Y{corner[1]} R{bend}")
        elif w.chance.random() < 0.1:
            w.line(f"G1 Z{w.value(-3, 3)}")
            w.line(f"G1 X{corner[0]} Y{corner[1]}")
        else:
            w.line(f"G1 X{corner[0]} Y{corner[1]}")
        w.at.update(X=corner[0], Y=corner[1])
    if w.chance.random() < 0.4:
        name_point(w, {"X": corners[0][0], "Y": corners[0][1]}, "Z", is_drilled=True)
    else:
        w.line(f"G40 G{w.chance.randint(0, 1)} X{w.value(-70, -60)} Y{w.value(-60, 60)}")
    w.line("G0 Z10")


def name_point(w, point, normal, is_drilled):
    """`G40`, and a move whose words name the point that is programmed already, beside which the tool stands."""
    letters = w.chance.choice((list(point), list(point), *([letter] for letter in point)))
    absolute = " ".join(f"{letter}{point[letter]}" for letter in letters)
    moves = [f"G{w.chance.randint(0, 1)} {absolute}", f"G91 G{w.chance.randint(0, 1)} {' '.join(f'{letter}0' for letter in letters)}\nG90"]
    if is_drilled:
        moves += [f"G81 {absolute} {normal}-5 R2\nG80", f"G28 {absolute}"]
    before = w.chance.choice(("G40 ", "G40\n", "G40\nM8\n", "G40\nG4 P0.1\n"))
    for line in (before + w.chance.choice(moves)).split("\n"):
        w.line(line)


def nose(w):
    w.line("G18 G8")
    w.line(f"G0 X{w.value(30, 40)} Z{w.value(5, 12)}")
    w.line(f"F{w.value(50, 300, 1)}")
    radius = w.chance.choice((0.2, 0.4, 0.8, 1.2))
    w.line(f"G42.1 D{2 * radius:g} L{w.chance.randint(0, 9)} G1 X{w.value(5, 10)} Z{w.value(2, 4)}")
    x, z = w.value(5, 10), -w.value(3, 8)
    for _ in range(w.chance.randint(2, 6)):
        kind = w.chance.random()
        if kind < 0.4:
            z = round(z - w.value(3, 10), 3)
            w.line(f"G1 X{x} Z{z}")
        elif kind < 0.7:
            x, z = round(x + w.value(3, 8), 3), round(z - w.value(3, 8), 3)
            w.line(f"G1 X{x} Z{z}")
        else:
            size = w.value(3, 8)
            x, z = round(x + size, 3), round(z - size, 3)
            w.line(f"{w.chance.choice(('G2', 'G3'))} X{x} Z{z} R{size}")
    w.line(f"G1 X{round(x + 10, 3)}")
    if w.chance.random() < 0.4:
        name_point(w, {"X": round(x + 10, 3), "Z": z}, "Y", is_drilled=False)
        w.line(f"G0 X{round(x + 20, 3)} Z5")
    else:
        w.line(f"G40 G0 X{round(x + 20, 3)} Z5")


def expression(w, depth=0):
    kind = w.chance.random()
    if depth > 3 or kind < 0.25:
        return w.chance.choice((f"{w.value(-9, 9, 2)}", f"#{w.chance.randint(1, 6)}", "#<width>", f"{w.chance.randint(0, 7)}"))
    if kind < 0.7:
        operator = w.chance.choice(("+", "-", "*", "+", "-", "EQ", "NE", "GT", "GE", "LT", "LE", "AND", "OR", "XOR", "MOD 3 +"))
        return f"[{expression(w, depth + 1)} {operator} {expression(w, depth + 1)}]"
    function = w.chance.choice(("ABS", "ROUND", "FIX", "FUP", "SIN", "COS", "SQRT[ABS", "ATAN", "EXP[SIN", "TAN[SIN", "LN[1 + ABS"))
    inner = expression(w, depth + 1)
    if function == "ATAN":
        return f"ATAN[{inner}]/[{expression(w, depth + 1)}]"
    if "[" in function:
        return f"{function}[{inner}]]"
    return f"{function}[{inner}]"


def expressions(w):
    w.line("F200")
    for number in range(1, 7):
        w.line(f"#{number} = {w.value(-20, 20, 2)}")
    w.line(f"#<width> = {w.value(1, 9, 1)}")
    for _ in range(w.chance.randint(8, 20)):
        kind = w.chance.random()
        if kind < 0.35:
            w.line(f"#{w.chance.randint(1, 6)} = [{expression(w)}]")
        elif kind < 0.4:
            w.line(f"#<width> = [{expression(w)}]")
        elif kind < 0.5:
            w.line(f"#1 = {w.value(-5, 5, 1)} #2 = #1 G1 X#1")
        else:
            letter = w.chance.choice("XYZ")
            w.line(f"G1 {letter}[[{expression(w)}] MOD 100]")


def flow(w):
    w.line("F300")
    label = 100
    w.line("#<depth> = 0")
    w.line("#10 = 1")
    subs = []
    body = []
    for _ in range(w.chance.randint(2, 5)):
        label += 1
        kind = w.chance.randint(0, 6)
        count = w.chance.randint(1, 5)
        if kind == 0:
            body += [f"#1 = 0", f"o{label} while [#1 LT {count}]", "G1 X[#1 * 2] Y#10", "#1 = [#1 + 1]",
                     # A break here would end the next do there: see differences.json.
                     f"o{label}1 if [#1 EQ {w.chance.randint(1, 6)}]", f"o{label} continue",
                     f"o{label}1 endif", "G1 Z-#1", f"o{label} endwhile"]
        elif kind == 1:
            body += ["#2 = 0", f"o{label} do", "G1 Y[#2 / 2]", "#2 = [#2 + 1]", f"o{label} while [#2 LT {count}]"]
        elif kind == 2:
            rounds = w.chance.choice((str(count), f"{count}.4", f"{count}.6", "0", "-1", "#10"))
            body += [f"o{label} repeat [{rounds}]", "G91 G1 X1 Y0.5", "G90", f"o{label} endrepeat"]
        elif kind == 3:
            value = w.chance.randint(0, 3)
            body += [f"#3 = {value}", f"o{label} if [#3 EQ 0]", "G1 X11", f"o{label} elseif [#3 EQ 1]", "G1 X12",
                     f"o{label} elseif [#3 EQ 2]", "G1 X13", f"o{label} else", "G1 X14", f"o{label} endif"]
        elif kind == 4:
            name = f"<part{label}>" if w.chance.random() < 0.5 else str(label)
            subs += [f"o{name} sub", "G1 X#1 Y#2", "#<inner> = [#1 + #2]", f"o{label}7 if [#<inner> GT {count}]",
                     f"o{name} return [#<inner>]", f"o{label}7 endif", "#40 = [#1 * 3]", "#1 = 77", f"o{name} endsub [#1]"]
            body += ["#1 = 5", f"o{name} call [{w.value(0, 9, 1)}] [{w.value(0, 9, 1)}]", "G1 Z#<_value>", "G1 X#1"]
        elif kind == 5:
            subs += [f"o{label} sub", f"o{label}1 if [#1 GT 0]", "G1 X#1", f"o{label} call [#1 - 1]", f"o{label}1 endif",
                     "G1 Y#1", f"o{label} endsub"]
            body += [f"o{label} call [{w.chance.randint(0, 6)}]"]
        else:
            body += [f"#<_shared> = {count}", "#<depth> = [#<depth> + #<_shared>]", "G1 Z[0 - #<depth>]",
                     "#10 = [EXISTS[#<depth>] + EXISTS[#<nothing>]]"]
    for line in subs + body:
        w.line(line)


def threads(w):
    w.line("S400 M3 F100")
    w.line("G18")
    kind = w.chance.random()
    if kind < 0.6:
        diameter = w.chance.random() < 0.3
        w.line("G7" if diameter else "G8")
        w.line(f"G0 X{w.value(12, 30)} Z{w.value(3, 10)}")
        inner = w.chance.random() < 0.3
        offset = w.value(1, 3, 2) * (1 if inner else -1)
        words = f"P{w.value(0.5, 3, 2)} Z{-w.value(10, 40)} I{offset} J{w.value(0.2, 0.4, 3)} K{w.value(0.5, 1.2, 3)}"
        if w.chance.random() < 0.6:
            words += f" R{w.value(1, 2.5, 2)}"
        if w.chance.random() < 0.6:
            words += f" Q{w.value(0, 30, 1)}"
        if w.chance.random() < 0.5:
            words += f" H{w.chance.randint(0, 3)}"
        if w.chance.random() < 0.3:
            words += f" E{w.value(0.5, 4, 2)} L{w.chance.randint(0, 3)}"
        w.line(f"G76 {words}")
    elif kind < 0.8:
        w.line(f"G0 X{w.value(12, 30)} Z5")
        w.line(f"G33 Z-{w.value(10, 30)} K{w.value(0.5, 3, 2)}")
        w.line(f"G0 X{w.value(40, 50)}")
        w.line(f"G33 X{w.value(20, 30)} Z{w.value(-40, -31)} K1.5")
    else:
        w.line(f"G17 G0 X{w.value()} Y{w.value()} Z5")
        w.line(f"G33.1 Z-{w.value(5, 20)} K{w.value(0.5, 2, 2)}")
        w.line(f"G0 X{w.value()}")
    w.line("G0 X60 Z20")


def splines(w):
    w.line("F400 G17")
    w.line(f"G0 X{w.value()} Y{w.value()}")
    for _ in range(w.chance.randint(1, 4)):
        kind = w.chance.randint(0, 2)
        if kind == 0:
            w.line(f"G5 I{w.value(-9, 9)} J{w.value(1, 9)} P{w.value(-9, 9)} Q{w.value(-9, -1)} X{w.value()} Y{w.value()}")
            if w.chance.random() < 0.5:
                w.line(f"G5 P{w.value(-9, 9)} Q{w.value(-9, 9)} X{w.value()} Y{w.value()}")
        elif kind == 1:
            w.line(f"G5.1 I{w.value(1, 9)} J{w.value(1, 9)} X{w.value()} Y{w.value()}")
        else:
            w.line(f"G5.2 X{w.value()} Y{w.value()} P{w.value(0.5, 2, 2)} L{w.chance.randint(3, 4)}")
            for _ in range(w.chance.randint(3, 6)):
                w.line(f"X{w.value()} Y{w.value()} P{w.value(0.5, 2, 2)}")
            w.line("G5.3")
        w.line(f"G1 X{w.value()}")


def modes(w):
    """G7, G8, G90.1, G91.1, rotary axes, tool length, path control."""
    w.line("F250")
    for _ in range(w.chance.randint(5, 12)):
        kind = w.chance.randint(0, 8)
        if kind == 0:
            w.line(w.chance.choice(("G7", "G8")))
            w.line(f"G90 G1 X{w.value()} Z{w.value()}")
        elif kind == 1:
            w.line("G8 G17 G90 G0 X10 Y0")
            w.line("G90.1")
            w.line(f"G{w.chance.randint(2, 3)} X0 Y10 I0 J0")
            w.line("G91.1")
        elif kind == 2:
            w.line(f"G43.1 Z{w.value(10, 60)}" + (f" X{w.value(-5, 5)}" if w.chance.random() < 0.3 else ""))
            w.line(f"G90 G1 Z{w.value()} X{w.value()}")
        elif kind == 3:
            w.line("G49")
        elif kind == 4:
            w.line(f"G0 A{w.value(-300, 300, 1)} C{w.value(-90, 90, 1)}")
        elif kind == 5:
            w.line(f"G1 U{w.value(-9, 9)} W{w.value(-9, 9)} X{w.value()}")
        elif kind == 6:
            w.line(f"G53 G{w.chance.randint(0, 1)} X{w.value()} Y{w.value()}")
        elif kind == 7:
            w.line(f"M70\nG91 G20 F{w.value(5, 20, 1)}\nG1 X{w.value(-1, 1)}\nM72")
        else:
            w.line(f"G90 G1 X{w.value()} Y{w.value()} Z{w.value()}")


def coordinates(w):
    w.line("F250")
    for _ in range(w.chance.randint(6, 14)):
        kind = w.chance.randint(0, 11)
        if kind == 0:
            words = " ".join(f"{letter}{w.value()}" for letter in w.chance.sample("XYZ", w.chance.randint(1, 3)))
            turned = f" R{w.value(-90, 90, 1)}" if w.chance.random() < 0.3 else ""
            w.line(f"G10 L2 P{w.chance.randint(0, 6)} {words}{turned}")
        elif kind == 1:
            w.line(f"G10 L20 P{w.chance.randint(0, 6)} X{w.value()} Z{w.value()}")
        elif kind == 2:
            w.line(w.chance.choice(("G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3")))
        elif kind == 3:
            w.line(f"G52 X{w.value()}" + (f" Y{w.value()}" if w.chance.random() < 0.5 else ""))
        elif kind == 4:
            w.line(f"G92 X{w.value()}" + (f" Z{w.value()}" if w.chance.random() < 0.5 else ""))
        elif kind == 5:
            w.line(w.chance.choice(("G92.1", "G92.2", "G92.3")))
        elif kind == 6:
            w.line(w.chance.choice(("G28", "G30", f"G28 X{w.value()}", f"G28 Z{w.value()} Y{w.value()}", f"G91 G28 Z0\nG90")))
        elif kind == 7:
            w.line(w.chance.choice(("G28.1", "G30.1")))
        elif kind == 8:
            w.line(f"G53 G0 X{w.value()} Z{w.value()}")
        elif kind == 9 and w.chance.random() < 0.7:
            w.plane = 17
            w.line(f"G17 G90 G0 X{w.value()} Y{w.value()}")
            w.line(f"G{w.chance.randint(2, 3)} I{w.value(2, 9)} J{w.value(2, 9)}")
        else:
            w.move(w.chance.choice(("G0", "G1")))


def mistakes(w):
    """A contour with one line that the interpreter refuses."""
    contour(w)
    wrong = ("G2 X1 Y1", "G1 X1 X2", "G99.9", "G1 F0 X5", "G2 X900 Y1 R2", "G81 X1 Y1 Z-1", "X[1/0]", "#1 = SQRT[0-1]",
             "G1 X#<unknown>", "o1 call", "M72", "G40 G2 X1 Y1 I1", "G17 G2 X10 Y0 I3 J1", "G1 X1 ( comment", "G1 G2 X1", "M3 M4",
             "G93 G1 X1", "G5 X1 Y1", "G41 G42 X1", "G33 X1", "M62", "T-1", "S-5", "G4", "o9 endwhile", "G10 L99 P1 X0",
             "G83 X1 Y1 Z-5 R2", "G76 X1", "X1 I", "G53 G2 X1 Y1 I1", "M900", "G28.1 X1", "ACOS[2]", "X ACOS[2]", "G1 X1 $", "#6000 = 1")
    w.lines.insert(w.chance.randint(2, len(w.lines)), w.chance.choice(wrong))


FAMILIES = [contour, feeds, inches, drilling, compensation, nose, expressions, flow, threads, splines, modes, coordinates, mistakes]


def program(seed, index, family=None):
    """The text of a program."""
    chance = random.Random(f"{seed}/{index}")
    family = family or FAMILIES[index % len(FAMILIES)]
    w = Writer(chance)
    w.lines.append(f"({family.__name__} {seed}/{index})")
    w.lines.append("G21 G90 G17 G94 G40 G49 G80 G54 G91.1")
    family(w)
    w.lines.append("M2")
    return "\n".join(w.lines) + "\n"
