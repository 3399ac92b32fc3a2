"""Holds the actions of `feedwave interpret` against those of LinuxCNC's interpreter.

    compare.py --feedwave BINARY --python PYTHON [--seed N] [--count N] [--turning N] [--keep DIR] [PROGRAM...]

Without programs: every one of `programs/`, COUNT generated ones and as many with turning cycles as `--turning` says. Ends with 1 where something differs that
`differences.json` does not name, or where fewer than 150 programs are equal. Programs that are refused for a code which is known
and not carried out yet are counted on their own.
"""

import argparse
import json
import math
import os
import pathlib
import re
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor

import generate
import turning

HERE = pathlib.Path(__file__).resolve().parent
INCH = 25.4
LETTERS = "xyzabcuvw"
TOLERANCE_MM = 1e-6
# A shorter move is rounding of inches there.
STILL_MM = 1e-9
LEAST_EQUAL = 150
FEED_SHARE = 1e-9


def normalised_reference(actions):
    """Without what moves nothing."""
    kept, last = [], [0.0] * 9
    for action in actions:
        if action["kind"] == "dwell":
            if action["seconds"] > 0.0:
                kept.append(action)
            continue
        moved = any(abs(one - other) > STILL_MM for one, other in zip(action["end"], last))
        if moved or action["kind"] in ("arc", "tap"):
            kept.append({**action, "start": last})
        last = action["end"]
    return kept


def nurbs_points(spline):
    """What LinuxCNC makes of a NURBS: a row of points on it."""
    order, points = spline["order"], list(zip(spline["first"], spline["second"], spline["weights"]))
    last = len(points) - 1
    knots = []
    for index in range(last + order + 1):
        knots.append(0.0 if index < order else (index - order + 1.0 if index <= last else last - order + 2.0))

    def basis(index, degree, u):
        if degree == 1:
            return 1.0 if knots[index] <= u <= knots[index + 1] else 0.0
        value = 0.0
        for weight, from_knot, to_knot, next_index in (
            (u - knots[index], knots[index], knots[index + degree - 1], index),
            (knots[index + degree] - u, knots[index + 1], knots[index + degree], index + 1),
        ):
            if to_knot > from_knot:
                value += weight / (to_knot - from_knot) * basis(next_index, degree - 1, u)
        return value

    def point(u):
        shares = [basis(index, order, u) * weight for index, (_, _, weight) in enumerate(points)]
        total = sum(shares)
        return [sum(share * at[axis] for share, at in zip(shares, points)) / total for axis in (0, 1)]

    most = last - order + 2.0
    pieces = len(points) * 15
    u, row = 0.0, []
    while u + most / pieces < most:
        u += most / pieces
        # A knot belongs to the span before it, where the basis of order 1 would count both.
        row.append(point(u - 1e-12 if any(abs(u - knot) < 1e-12 for knot in knots[order:last + 1]) else u))
    row.append(list(points[last][:2]))
    return row


def position(at):
    return [at[letter] for letter in LETTERS]


def normalised_ours(actions):
    kept = []
    for action in actions:
        kind = action["kind"].removeprefix("ACTION_KIND_").lower()
        if kind == "dwell" and action.get("dwellS", 0.0) > 0.0:
            kept.append({"kind": "dwell", "line": action["line"], "seconds": action["dwellS"]})
        if kind not in ("rapid", "line", "arc", "spline", "thread", "tap"):
            continue
        start, end, offset = (position(action[name]) for name in ("start", "machineEnd", "offset"))
        start = [value + shift for value, shift in zip(start, offset)]
        entry = {"kind": kind, "line": action["line"], "start": start, "end": end}
        if "feed" in action:
            mode = action["feed"]["mode"].removeprefix("ACTION_FEED_MODE_")
            entry["mode"] = {"PER_MINUTE": "min", "PER_REVOLUTION": "rev", "INVERSE_TIME": "inverse"}[mode]
            entry["feed"] = action["feed"]["value"]
        if kind == "thread":
            entry["kind"] = "line"
        if kind in ("arc", "spline"):
            plane = action["plane"].removeprefix("ACTION_PLANE_")
            first, second = ("XYZ".index(letter) for letter in plane)
        if kind == "arc":
            arc = action["arc"]
            centre = [arc["centerFirst"] + offset[first], arc["centerSecond"] + offset[second]]
            turns = -arc["turns"] if arc["clockwise"] else arc["turns"]
            entry.update(plane=plane, centre=centre, turns=turns)
        if kind == "spline":
            last = start
            for one, other in nurbs_points(action["spline"]):
                at = list(last)
                at[first], at[second] = one + offset[first], other + offset[second]
                if any(abs(one - other) > 1e-9 for one, other in zip(last, at)):
                    kept.append({**entry, "kind": "line", "start": last, "end": at})
                last = at
            continue
        if kind == "tap" and kept and kept[-1]["kind"] == "tap" and "back" not in kept[-1]:
            # In and out are one action there.
            kept[-1]["back"] = end
            continue
        if kind == "thread" and action["thread"]["pullOutMm"] > 0.0:
            # The chamfer at the end of a thread is a line of its own there.
            travel = min(action["thread"]["pullOutMm"], abs(end[2] - start[2]))
            at = list(end)
            at[2] -= math.copysign(travel, end[2] - start[2])
            kept.append({**entry, "end": at})
            end = list(end)
            end[0] += action["thread"]["pullOutRetreatMm"]
            entry = {**entry, "start": at, "end": end}
        moved = any(abs(one - other) > STILL_MM for one, other in zip(entry["start"], end))
        if moved or kind in ("arc", "tap"):
            kept.append({**entry, "thread": kind == "thread"})
    return kept


def length(start, action):
    if action["kind"] != "arc":
        linear = math.dist(start[:3], action["end"][:3])
        if linear == 0.0:
            linear = math.dist(start[6:], action["end"][6:])
        return linear if linear > 0.0 else math.dist(start[3:6], action["end"][3:6])
    first, second = ("XYZ".index(letter) for letter in action["plane"])
    centre = action["centre"]
    one = [start[first] - centre[0], start[second] - centre[1]]
    other = [action["end"][first] - centre[0], action["end"][second] - centre[1]]
    angle = math.atan2(one[0] * other[1] - one[1] * other[0], one[0] * other[0] + one[1] * other[1])
    turns = action["turns"]
    if turns > 0:
        angle = angle + 2 * math.pi if angle < 1e-12 else angle
        angle += 2 * math.pi * (turns - 1)
    else:
        angle = angle - 2 * math.pi if angle > -1e-12 else angle
        angle += 2 * math.pi * (turns + 1)
    third = ({0, 1, 2} - {first, second}).pop()
    return math.hypot(angle * math.hypot(*one), action["end"][third] - start[third])


def feeds_agree(ours, theirs):
    if "feed" not in ours or "feed" not in theirs:
        return True
    if ours.get("mode") != theirs["mode"]:
        return False
    if ours["mode"] == "inverse":
        wanted = ours["feed"] * length(ours["start"], ours)
        return math.isclose(theirs["feed"] * INCH, wanted, rel_tol=1e-6, abs_tol=1e-6)
    rotary = all(abs(ours["start"][axis] - ours["end"][axis]) < 1e-12 for axis in (0, 1, 2, 6, 7, 8))
    scales = (INCH, 1.0) if rotary else (INCH,)
    return any(math.isclose(theirs["feed"] * scale, ours["feed"], rel_tol=FEED_SHARE) for scale in scales)


def difference(ours, theirs):
    """How two actions differ, or None."""
    if ours["kind"] != theirs["kind"]:
        return f"{ours['kind']} instead of {theirs['kind']}"
    if ours["kind"] == "dwell":
        same = math.isclose(ours["seconds"], theirs["seconds"], rel_tol=1e-9)
        return None if same else f"dwell of {ours['seconds']} s instead of {theirs['seconds']} s"
    for axis, (one, other) in enumerate(zip(ours["end"], theirs["end"])):
        if abs(one - other) > TOLERANCE_MM:
            return f"ends at {LETTERS[axis].upper()}{one:.9g} instead of {other:.9g}"
    if ours["kind"] == "arc":
        if ours["plane"] != theirs["plane"] or ours["turns"] != theirs["turns"]:
            return f"{ours['plane']} {ours['turns']} turns instead of {theirs['plane']} {theirs['turns']}"
        if math.dist(ours["centre"], theirs["centre"]) > TOLERANCE_MM:
            return f"centre {ours['centre']} instead of {theirs['centre']}"
    if not feeds_agree(ours, theirs):
        return f"feed {ours.get('feed')} {ours.get('mode')} instead of {theirs['feed']} inch {theirs['mode']}"
    return None


def compare(ours, refused, reference):
    """How a program differs, or None. Actions end before the first refusal here, so that what follows it is not compared."""
    if "crash" in reference:
        return f"crashed there: {(refused or 'carried out here')[:300]}"
    theirs, refusal = normalised_reference(reference["actions"]), reference["refusal"]
    ours = normalised_ours(ours)
    for index, (one, other) in enumerate(zip(ours, theirs)):
        follows = ours[index + 1] if index + 1 < len(ours) else {}
        if one["kind"] == "rapid" and other["kind"] == "line" and follows.get("thread"):
            # The infeed to the tapered entry of a thread: see README.md, "Differences of form".
            other = {**other, "kind": "rapid"}
        found = difference(one, other)
        if found:
            return f"action {index}, line {one['line']} ({other['line']} there): {found}"
    if bool(refused) != bool(refusal):
        if refused:
            return f"refused here only: {refused[:300]}"
        return f"refused there only, line {refusal[0]}: {refusal[1]}"
    if not refused and len(ours) != len(theirs):
        longer = ours if len(ours) > len(theirs) else theirs
        there = "here" if longer is ours else "there"
        return f"{len(ours)} actions instead of {len(theirs)}, first only {there}: {longer[min(len(ours), len(theirs))]}"
    return None


def ours(binary, path):
    tools = ["--tools", str(HERE / "tools.toml")] if path.name.startswith("tool-") else []
    run = subprocess.run(
        [binary, "interpret", "--profile", str(HERE / "machine.toml"), *tools, "--format", "jsonl", str(path)],
        capture_output=True, text=True, timeout=120, check=False, env={**os.environ, "NO_COLOR": "1"},
    )
    if run.returncode not in (0, 1):
        raise SystemExit(f"{path}: feedwave ended with {run.returncode}: {run.stderr}")
    actions = [json.loads(line) for line in run.stdout.splitlines()]
    text = re.sub(r"\s+", " ", run.stderr)
    return actions, text if run.returncode == 1 else None


def reference(python, paths):
    environment = {name: value for name, value in os.environ.items() if name != "INI_FILE_NAME"}
    run = subprocess.run([python, str(HERE / "reference.py")], input="\n".join(map(str, paths)), capture_output=True,
                         text=True, check=True, env=environment)
    return {entry["path"]: entry for entry in map(json.loads, run.stdout.splitlines())}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--feedwave", required=True)
    parser.add_argument("--python", default=sys.executable)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--turning", type=int, default=100)
    parser.add_argument("--keep", type=pathlib.Path)
    parser.add_argument("programs", nargs="*", type=pathlib.Path)
    arguments = parser.parse_args()
    listed = json.loads((HERE / "differences.json").read_text())
    known = {name: entry for names, entry in listed.items() for name in names.split()}
    with tempfile.TemporaryDirectory() as scratch:
        folder = arguments.keep or pathlib.Path(scratch)
        folder.mkdir(parents=True, exist_ok=True)
        paths = list(arguments.programs)
        if not paths:
            paths = sorted((HERE / "programs").glob("*.ngc"))
            for name, module, count in (("generated", generate, arguments.count), ("turning", turning, arguments.turning)):
                for index in range(count):
                    path = folder / f"{name}-{arguments.seed}-{index}.ngc"
                    path.write_text(module.program(arguments.seed, index))
                    paths.append(path)
        theirs = reference(arguments.python, paths)
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            results = list(pool.map(lambda path: ours(arguments.feedwave, path), paths))
        equal, refused, deliberate, not_yet, wrong = 0, 0, 0, 0, []
        for path, (actions, refusal) in zip(paths, results):
            found = compare(actions, refusal, theirs[str(path)])
            expected = known.get(path.stem)
            if expected:
                deliberate += 1
                if not found:
                    wrong.append((path, "does not differ any more: remove it from differences.json"))
                elif not re.search(expected["differs"], found):
                    wrong.append((path, f"differs otherwise than differences.json says: {found}"))
            elif found and refusal and "PRG-UNSUPPORTED-CODE" in refusal:
                not_yet += 1
            elif found:
                wrong.append((path, found))
            else:
                equal += 1
                refused += refusal is not None
        for path, found in wrong:
            print(f"{path}: {found}")
        print(f"{len(paths)} programs: {equal} equal ({refused} of them refused by both), "
              f"{deliberate} deliberate differences, {not_yet} with codes that are not carried out yet, {len(wrong)} wrong")
        if not arguments.programs and equal < LEAST_EQUAL:
            print(f"fewer than {LEAST_EQUAL} are equal")
            return 1
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
