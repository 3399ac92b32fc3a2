"""The canonical motion of programs by LinuxCNC's interpreter, with full precision.

Debian's package has the interpreter as a Python module, `gcode`, which calls a canon object for every canonical action. Its
lengths are inches, its positions program coordinates; they become machine coordinates in mm here, by what LinuxCNC defines:
machine = origin of the work system + rotation about Z of (program + G92 shift) + tool offset.
"""

import ctypes
import math
import os
import sys
import tempfile
import tomllib

INCH = 25.4
AXES = 9
# LinuxCNC's orientation by FANUC's number of the tip.
ORIENTATIONS = [0, 4, 3, 2, 1, 5, 8, 7, 6, 9]
NO_TOOL = (0,) + (0.0,) * (AXES + 3) + (0,)
# Rotary axes keep degrees.
SCALE = [INCH, INCH, INCH, 1.0, 1.0, 1.0, INCH, INCH, INCH]
# What takes longer or has more actions never ends: programs here take milliseconds.
CPU_S = 2
MOST_ACTIONS = 50_000
ENDLESS = 7
PLANES = {1: (0, 1, 2), 2: (1, 2, 0), 3: (2, 0, 1)}


class Canon:
    """Collects actions. Every method is called by the interpreter."""

    def __init__(self, folder, tools):
        # By their places in the table; the place 0 is the spindle.
        self.tools = tools
        self.parameter_file = os.path.join(folder, "parameters")
        open(self.parameter_file, "a").close()
        self.actions = []
        self.line = 0
        self.metric = True
        self.origin = [0.0] * AXES
        self.shift = [0.0] * AXES
        self.tool = [0.0] * AXES
        self.rotation = 0.0
        self.plane = 1
        self.feed = 0.0
        self.feed_mode = "min"

    def next_line(self, state):
        self.line = state.sequence_number

    def get_external_length_units(self):
        return 1.0

    def get_external_angular_units(self):
        return 1.0

    def get_axis_mask(self):
        return 0x1FF

    def get_block_delete(self):
        return True

    def check_abort(self):
        return False

    def get_tool(self, place):
        return self.tools[place] if place < len(self.tools) else NO_TOOL

    def change_tool(self, place):
        self.tools[0] = self.tools[place]

    def set_g5x_offset(self, _index, *offset):
        self.origin = self.scaled(offset)

    def set_g92_offset(self, *offset):
        self.shift = self.scaled(offset)

    def set_xy_rotation(self, degrees):
        self.rotation = math.radians(degrees)

    def tool_offset(self, *offset):
        self.tool = self.scaled(offset)

    def set_plane(self, plane):
        # 1 is XY, 2 YZ, 3 ZX.
        self.plane = plane

    def set_feed_rate(self, rate):
        self.feed = rate

    def comment(self, text):
        for words, mode in (("per minute", "min"), ("per revolution", "rev"), ("inverse time", "inverse")):
            if text.startswith("interpreter: feed mode set to") and text.endswith(words):
                self.feed_mode = mode

    @staticmethod
    def scaled(values):
        values = [0.0 if value is None else value for value in values]
        return [value * scale for value, scale in zip(values, SCALE)]

    def turned(self, x, y):
        cosine, sine = math.cos(self.rotation), math.sin(self.rotation)
        return x * cosine - y * sine, x * sine + y * cosine

    def machine(self, position):
        values = [value + shift for value, shift in zip(self.scaled(position), self.shift)]
        values[0], values[1] = self.turned(values[0], values[1])
        return [value + origin + tool for value, origin, tool in zip(values, self.origin, self.tool)]

    def add(self, kind, **more):
        if len(self.actions) >= MOST_ACTIONS:
            os._exit(ENDLESS)
        self.actions.append({"kind": kind, "line": self.line, **more})

    def straight_traverse(self, *position):
        self.add("rapid", end=self.machine(position))

    def straight_feed(self, *position):
        self.add("line", end=self.machine(position), feed=self.feed, mode=self.feed_mode)

    def straight_probe(self, *position):
        self.add("line", end=self.machine(position), feed=self.feed, mode=self.feed_mode)

    def rigid_tap(self, x, y, z):
        last = next((action["end"] for action in reversed(self.actions) if "end" in action), [0.0] * AXES)
        self.add("tap", end=self.machine((x, y, z) + (0.0,) * 6)[:3] + last[3:])

    def arc_feed(self, first_end, second_end, first_centre, second_centre, turns, third_end, *rest):
        first, second, third = PLANES[self.plane]
        end = [0.0] * AXES
        end[first], end[second], end[third] = first_end, second_end, third_end
        end[3:] = rest
        centre = [0.0] * AXES
        centre[first], centre[second], centre[third] = first_centre, second_centre, third_end
        centre = self.machine(centre)
        self.add("arc", end=self.machine(end), centre=[centre[first], centre[second]], plane="XYZXYZ"[first] + "XYZXYZ"[second],
                 turns=turns, feed=self.feed, mode=self.feed_mode)

    def dwell(self, seconds):
        self.add("dwell", seconds=seconds)

    def __getattr__(self, name):
        if name.startswith("__"):
            raise AttributeError(name)
        return lambda *_: None


def load_tools(folder):
    """The rows of the table of tools, in mm. The interpreter of this process gets their numbers as well, in the file of the
    home directory that it looks for places in the table in."""
    with open(os.path.join(os.path.dirname(os.path.abspath(__file__)), "tools.toml"), "rb") as file:
        tools = [tool_row(tool) for tool in tomllib.load(file)["tools"]]
    table = os.path.join(folder, "tools")
    with open(table, "w") as file:
        file.writelines(f"T{number} P{number}\n" for number, *_ in tools)
    os.environ["HOME"] = folder
    library = ctypes.CDLL("libtooldata.so.0")
    library._Z17tool_mmap_creatorPK13EMC_TOOL_STATi(None, 0)
    library._Z13tooldata_initb(False)
    if library._Z13tooldata_loadPKcPPc(table.encode(), None) != 0:
        raise SystemExit("the table of tools cannot be loaded")
    return [NO_TOOL, *tools]


def tool_row(tool):
    """Number, offsets, diameter, angles of the edges and orientation of a tool of the contract, as the interpreter asks for it."""
    offset = tool.get("offset", {"z": tool.get("length_mm", 0.0)})
    offsets = (float(offset.get(letter, 0.0)) for letter in "xyzabcuvw")
    diameter = float(tool.get("diameter_mm", 2.0 * tool.get("nose_radius_mm", 0.0)))
    angles = (float(tool.get("front_angle_deg", 0.0)), float(tool.get("back_angle_deg", 0.0)))
    return tool["number"], *offsets, diameter, *angles, ORIENTATIONS[tool.get("tip", 0)]


def interpret(path):
    """The actions of a program, and (line, message) where it is refused or None."""
    import gcode

    with tempfile.TemporaryDirectory() as folder:
        tools = load_tools(folder) if os.path.basename(path).startswith("tool-") else []
        canon = Canon(folder, tools)
        result, line = gcode.parse(path, canon, "G21", "")
    refusal = (line, gcode.strerror(result)) if result > gcode.MIN_ERROR else None
    return canon.actions, refusal


def main(paths):
    """Interprets each program in a process of its own, as the interpreter keeps some state, and writes one JSON line for each."""
    import json
    import resource
    import signal

    for path in paths:
        out = sys.stdout.fileno()
        reader, writer = os.pipe()
        child = os.fork()
        if child == 0:
            os.close(reader)
            # A program that never ends would go on without anybody, and fill the memory with its actions.
            resource.setrlimit(resource.RLIMIT_CPU, (CPU_S, CPU_S + 1))
            resource.setrlimit(resource.RLIMIT_AS, (1 << 30, 1 << 30))
            # The interpreter writes messages to both streams.
            quiet = os.open(os.devnull, os.O_WRONLY)
            os.dup2(quiet, out)
            os.dup2(quiet, sys.stderr.fileno())
            actions, refusal = interpret(path)
            with os.fdopen(writer, "w") as pipe:
                json.dump({"path": path, "actions": actions, "refusal": refusal}, pipe)
            os._exit(0)
        os.close(writer)
        with os.fdopen(reader) as pipe:
            text = pipe.read()
        _, status = os.waitpid(child, 0)
        if os.waitstatus_to_exitcode(status) in (ENDLESS, -signal.SIGXCPU):
            text = json.dumps({"path": path, "actions": [], "refusal": (0, "it never ends")})
        elif status != 0 or not text:
            text = json.dumps({"path": path, "crash": status})
        print(text, flush=True)


if __name__ == "__main__":
    main([line.strip() for line in sys.stdin])
