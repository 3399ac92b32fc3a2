"""The local mode: the same reports and the same setpoints as of the service, to the last bit, and refusals in its terms."""

import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

import feedwave
import feedwave.local
from conftest import FIXTURES, ROOT
from feedwave.v1 import programs_pb2, programs_pb2_grpc

TRAP, CURED, BAD = (FIXTURES / name for name in ("spec-trap.nc", "spec-trap-cured.nc", "bad.nc"))
SLOT = "G21 G90 G94 G17 S3000 M3\nG0 X10 Y0 Z0\nG1 X20 F1200\nG2 X30 Y10 R10\nG0 X30\nM30\n"
# Programs of every machining function that two generic machines can run.
PROGRAMS = [(path, kind) for kind in ("lathe", "mill") for path in sorted(FIXTURES.glob("*.nc"))]
MODES = ["ALONG_PATH", "TANGENTIAL", "SERVO_SIDE"]


def message_of(report):
    return report.proto.SerializeToString(deterministic=True)


@pytest.mark.parametrize(("path", "kind"), PROGRAMS, ids=lambda value: getattr(value, "name", value))
def test_a_report_is_that_of_the_service(client, path, kind):
    assert message_of(feedwave.local.validate(path, machine=kind)) == message_of(client.validate(path, machine=kind))


# One program of each machining function, with its machine, tools and overrides.
FIVE_AXIS, OSCILLATION = (FIXTURES / name for name in ("five-axis-mill.toml", "oscillation-mill.toml"))
CUTTER = {
    "name": "tools/face-mill", "number": 4, "max_spindle_rev_per_min": 2500.0, "length_mm": 68.4,
    "geometry": {
        "radius_mm": 60.0, "radial_edge_length_mm": 1.5, "axial_edge_height_mm": 5.0,
        "edges": [{"angle_deg": angle_deg} for angle_deg in (0.0, 90.0, 180.0, 270.0)],
    },
}
FUNCTIONS = {
    "path vibration": (CURED, "lathe", [], []),
    "five-axis thinning": (FIXTURES / "freeform.nc", FIVE_AXIS, [{"name": "tools/ball", "number": 1, "length_mm": 120.0}], []),
    "tool oscillation": (FIXTURES / "oscillation-mill.nc", OSCILLATION, [CUTTER], []),
    "adaptive feed": (SLOT, "mill", [], [(0.1, 0.85), (0.25, 0.72), (0.5, 1.2)]),
    "thread vibration": (FIXTURES / "thread-a.nc", "lathe", [], []),
}


@pytest.mark.parametrize("function", FUNCTIONS)
def test_all_of_a_machining_function_is_that_of_the_service(client, function):
    program, machine, tools, overrides = FUNCTIONS[function]
    profile = client.profile(machine) if isinstance(machine, str) else feedwave.load_profile(machine, generic=feedwave.local.profile("mill"))
    stored = function.replace(" ", "-")
    client.put_machine(stored, profile)
    for tool in tools:
        client.put_tool(tool)
    names = [tool["name"] for tool in tools]
    job = client.submit(program, machine=stored, tools=names).wait(120)
    plan = feedwave.local.plan(program, machine=profile, tools=tools)
    assert plan.ok and message_of(plan.report) == message_of(job.report())
    for options in ({}, {"overrides": overrides, "frame": "WORK"}):
        assert plan.setpoints(**options) == job.setpoints(**options)
    goals = {"margin": 1.2, "max_tolerance_mm": 0.01}
    improved = feedwave.local.improve(program, machine=profile, tools=tools, goals=goals)
    told = client.improve(program, machine=stored, tools=names, goals=goals)
    assert improved.message.SerializeToString(deterministic=True) == told.message.SerializeToString(deterministic=True)
    assert improved.program.read() == told.program.read() and str(improved) == str(told) and improved.diff() == told.diff()


STRANGE = {
    "empty": b"", "blank": b"\n\n", "no UTF-8": b"G21 (caf\xe9)\nG0 X\xff1\nM30\n", "NUL": b"G0 X1\x00\nM30\n", "a picture": b"\x89PNG\r\n\x1a\n" + bytes(200),
    "refused": b"G1 X10 F100\nM30\n", "one long line": b"G1 " + b"X1 " * 50_000 + b"\nM30\n", "carriage returns": SLOT.replace("\n", "\r").encode(),
}


@pytest.mark.parametrize("name", STRANGE)
def test_strange_programs_are_judged_as_by_the_service(client, name):
    program = STRANGE[name]
    here, there = (judge.validate(program, machine="mill") for judge in (feedwave.local, client))
    assert message_of(here) == message_of(there) and str(here) == str(there)
    plan = feedwave.local.plan(program, machine="mill")
    job = client.submit(program, machine="mill").wait(60)
    assert message_of(plan.report) == message_of(job.report())
    if plan.ok:
        assert plan.setpoints() == job.setpoints()
        return
    with pytest.raises(feedwave.FailedPrecondition):
        plan.setpoints()
    with pytest.raises(feedwave.FailedPrecondition):
        job.setpoints()
    improved, told = (judge.improve(program, machine="mill") for judge in (feedwave.local, client))
    assert improved.message == told.message and improved.program.read() == program


def refusal(call):
    """The type and the data of what a call raises."""
    with pytest.raises(Exception) as raised:
        call()
    error = raised.value
    if not isinstance(error, feedwave.ServiceError):
        return type(error), str(error)
    return type(error), error.code, error.reason, [violation.field for violation in error.violations]


def test_refusals_are_of_the_types_of_the_service(client):
    empty = client.profile("mill")
    empty.machine.ClearField("axes")
    for arguments in (
        {"machine": empty},
        {"machine": {"machin": {}}},
        {"machine": 3},
        {"machine": "mill", "settings": feedwave.Settings(generation_mode="SIDEWAYS")},
        {"machine": "mill", "settings": feedwave.Settings(interpolation_period_us=-1)},
        {"machine": "mill", "overrides": [(0.1, 9.0)]},
        {"machine": "mill", "overrides": [(0.1,)]},
        {"machine": "mill", "overrides": 3},
        {"machine": "mill", "files": [SLOT]},
        {"machine": "mill", "files": {"A.nc": SLOT, "a.nc": SLOT}},
        {"machine": "mill", "tools": "T1"},
    ):
        here, there = (refusal(lambda judge=judge: judge.validate(SLOT, **arguments)) for judge in (feedwave.local, client))
        assert here == there, arguments
    for goals in ({"margin": 0.5}, {"min_frequency_hz": 5.0}, {"marge": 1.0}, 3):
        here, there = (refusal(lambda judge=judge: judge.improve(SLOT, machine="mill", goals=goals)) for judge in (feedwave.local, client))
        assert here == there, goals
    for program in ("no.nc", 3, FIXTURES):
        here, there = (refusal(lambda judge=judge: judge.validate(program, machine="mill")) for judge in (feedwave.local, client))
        assert here == there, program


# Work that has no end: with motion, without motion behind an error, and where setpoints, actions and improvements come from.
ENDLESS = "G21 G90 G94 S3000 M3 F3000\n#1=0\nWHILE[#1 LT 900000000]DO1\n{}#1=#1+1\nEND1\nM30\n"
LASTING = {
    "validate": ("validate(PROGRAM, machine=MILL)", "G1 X[#1 MOD 7]\n", ""),
    "refused": ("validate(PROGRAM, machine=MILL)", "", "G9999\n"),
    "interpret": ("print(len(list(feedwave.local.interpret(PROGRAM, machine=MILL))))", "", ""),
    "improve": ("improve(PROGRAM, machine=MILL)", "G1 X[#1 MOD 7]\n", ""),
}


@pytest.mark.parametrize("name", LASTING)
def test_long_work_is_interrupted(name):
    call, body, before = LASTING[name]
    program = before + ENDLESS.format(body)
    script = (
        "import sys, feedwave.local\nfrom feedwave.local import *\n"
        f"PROGRAM = {program!r}\nMILL = feedwave.local.profile('mill')\n"
        "MILL.language.max_executed_blocks = MILL.language.max_still_blocks = 1_000_000_000\n"
        f"print('begun', flush=True)\n{call}\n"
    )
    with subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "begun\n"
        time.sleep(0.5)
        assert process.poll() is None, process.stderr.read()
        process.send_signal(signal.SIGINT)
        _, told = process.communicate(timeout=60)
    assert "KeyboardInterrupt" in told, told


@pytest.mark.parametrize("mode", MODES)
def test_setpoints_are_those_of_the_service(client, mode):
    settings = feedwave.Settings(generation_mode=mode, interpolation_period_us=500)
    job = client.submit(CURED, machine="lathe", settings=settings).wait(60)
    plan = feedwave.local.plan(CURED, machine=client.profile("lathe"), settings=settings)
    assert plan.ok and message_of(plan.report) == message_of(job.report())
    whole = plan.setpoints()
    assert whole == job.setpoints() and whole.layout.setpoint_count == whole.count == plan.report.summary.setpoint_count
    for options in (
        {"start": 700, "count": 333, "batch": 100},
        {"start_time_s": 0.1234, "columns": ["AXIS_POSITION", "FEED"]},
        {"overrides": [(0.1, 0.5), (0.3, 0.0), (0.5, 1.5)], "frame": "WORK"},
        {"interpolation_period_us": 2000, "generation_mode": "ALONG_PATH"},
        {"generation_mode": "SERVO_SIDE", "servo_output": "EXPANDED", "start": 10, "count": 1000},
        {"start": whole.count},
    ):
        assert plan.setpoints(**options) == job.setpoints(**options), options


def test_batches_hold_no_more_than_asked_for_and_share_their_memory():
    plan = feedwave.local.plan(CURED, machine="lathe")
    batches = list(plan.batches(batch=1000))
    assert [batch.count for batch in batches[:-1]] == [1000] * (len(batches) - 1) and 0 < batches[-1].count <= 1000
    assert feedwave.Setpoints.joined(batches[0].layout, batches) == plan.setpoints()
    column = batches[0]["X_mm"]
    assert not column.flags.owndata and not column.flags.writeable and column.dtype == np.float64


def test_actions_are_those_of_the_service(client, channel):
    for path, kind in PROGRAMS:
        request = programs_pb2.InterpretRequest(inline_program=path.read_bytes(), machine=f"machines/{kind}")
        told = list(programs_pb2_grpc.ProgramsStub(channel).Interpret(request))
        found = list(feedwave.local.interpret(path, machine=kind))
        actions = [[action.SerializeToString(deterministic=True) for message in messages for action in message.actions] for messages in (told, found)]
        assert actions[0] == actions[1], path
        assert [message.complete for message in found] == [False] * (len(found) - 1) + [True]
        assert found[-1].findings == told[-1].findings


def test_tools_files_and_overrides_count(client):
    main = "G21 G90 G94 T8 M6 G43 H8\nS3000 M3\nG0 X0 Y0 Z5\nM98 P1000\nM30\n"
    files = {"O1000.nc": "O1000\nG1 X20 F600\nM99\n"}
    tool = {"name": "tools/eight", "number": 8, "length_mm": 80.0, "diameter_mm": 10.0}
    client.put_tool(tool)
    options = {"machine": "mill", "files": files, "overrides": [(0.2, 0.5)]}
    local = feedwave.local.validate(main, tools=[tool], **options)
    assert message_of(local) == message_of(client.validate(main, tools=["eight"], **options))
    assert any(finding.code.startswith("PRG-") for finding in feedwave.local.validate(main, machine="mill").errors)


def test_what_cannot_be_is_refused_as_the_service_refuses_it():
    with pytest.raises(feedwave.InvalidArgument, match="lathe and mill"):
        feedwave.local.validate(CURED, machine="laser")
    with pytest.raises(feedwave.InvalidArgument) as refused:
        feedwave.local.validate(CURED, machine="lathe", settings=feedwave.Settings(interpolation_period_us=7), tools=[{"number": 0}])
    assert refused.value.reason == "INVALID_FIELDS"
    assert {violation.field for violation in refused.value.violations} == {"interpolation_period_us", "tools[0].number"}
    plan = feedwave.local.plan(CURED, machine="lathe")
    with pytest.raises(feedwave.OutOfRange) as refused:
        plan.setpoints(start=10**9)
    assert refused.value.reason == "START_BEYOND_END"
    with pytest.raises(feedwave.InvalidArgument, match="is not a column|servo-side"):
        plan.setpoints(columns=["SERVO_PHASE"])
    # Options and settings are held to the same as of a service.
    for read in (plan.setpoints, plan.batches):
        with pytest.raises(TypeError, match="'override': did you mean 'overrides'"):
            read(override=[(2.0, 0.5)])
        with pytest.raises(feedwave.SourceError, match="start is -1"):
            read(start=-1)
    with pytest.raises(TypeError, match="settings: feedwave.Settings"):
        feedwave.local.validate(SLOT, machine="mill", settings={})
    with pytest.raises(feedwave.SourceError, match="rounds"):
        plan.setpoints(encoding="FIXED_POINT_DELTA")
    refused_plan = feedwave.local.plan(BAD, machine="lathe")
    assert not refused_plan.ok and refused_plan.report.errors
    with pytest.raises(feedwave.FailedPrecondition, match="bad.nc is refused"):
        refused_plan.setpoints()


def test_a_file_that_changes_gives_no_setpoints(tmp_path):
    path = tmp_path / "part.nc"
    path.write_text(SLOT)
    plan = feedwave.local.plan(path, machine="mill")
    path.write_text(SLOT.replace("X20", "X25"))
    with pytest.raises(feedwave.SourceError, match="part.nc: the file changed"):
        plan.setpoints()
    path.unlink()
    with pytest.raises(OSError):
        plan.setpoints()


def long_program(lines):
    return "G21 G90 G94 G17 S3000 M3\nG0 X0 Y0 Z0\n" + "".join(f"G1 X{n % 7} Y{n % 5} F3000\n" for n in range(lines)) + "M30\n"


def test_other_threads_go_on_meanwhile():
    ticks, done = [], threading.Event()

    def tick():
        while not done.is_set():
            ticks.append(time.monotonic())
            time.sleep(0.001)

    thread = threading.Thread(target=tick)
    thread.start()
    # A loop without input: the lock is free all the time.
    program = "#1=0\nG21 G90 G94 S3000 M3\nWHILE[#1 LT 3000]DO1\nG1 X[#1 MOD 7] F3000\n#1=#1+1\nEND1\nM30\n"
    try:
        before = len(ticks)
        report = feedwave.local.validate(program, machine="mill")
        during = len(ticks) - before
    finally:
        done.set()
        thread.join()
    assert report.ok, report
    assert during > 1


def test_memory_does_not_grow_with_the_program(tmp_path):
    # Peaks of processes of their own: only differences between them count.
    script = (
        "import resource, sys, feedwave.local\n"
        "plan = feedwave.local.plan(sys.argv[1], machine='mill')\n"
        "print(sum(batch.count for batch in plan.batches()), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)\n"
    )
    peaks = []
    for lines in (2_000, 40_000):
        path = tmp_path / f"{lines}.nc"
        path.write_text(long_program(lines))
        done = subprocess.run([sys.executable, "-c", script, path], capture_output=True, text=True, check=True, timeout=300)
        count, peak_kib = map(int, done.stdout.split())
        peaks.append(peak_kib)
    # All setpoints at once would be seven columns of doubles.
    assert count * 7 * 8 > 4 * 1024 * (peaks[1] - peaks[0]), (count, peaks)


def test_the_wheel_with_the_native_part_needs_nothing_else():
    script = (
        "import hashlib, sys, feedwave.local\n"
        "plan = feedwave.local.plan(sys.argv[1], machine='lathe')\n"
        "print(hashlib.sha256(plan.report.proto.SerializeToString(deterministic=True)).hexdigest())\n"
        "print(hashlib.sha256(b''.join(column.tobytes() for column in plan.setpoints().values())).hexdigest())\n"
        "print('matplotlib' in sys.modules, feedwave.local.__file__)\n"
    )
    python = os.environ["FEEDWAVE_FRESH_NATIVE_PYTHON"]
    told = [
        subprocess.run([one, "-c", script, CURED], capture_output=True, text=True, check=True, timeout=120).stdout.split() for one in (python, sys.executable)
    ]
    assert told[0][:3] == told[1][:3] and told[0][2] == "False"
    assert told[0][3].startswith(os.path.dirname(os.path.dirname(python))), "it is not the one that was installed there"


def test_a_package_without_the_native_part_says_so():
    python = os.environ["FEEDWAVE_FRESH_PYTHON"]
    done = subprocess.run([python, "-c", "import feedwave; import feedwave.local"], capture_output=True, text=True, cwd=ROOT / "tests", timeout=60)
    assert done.returncode != 0 and "ImportError: feedwave.local needs the package with its native part" in done.stderr
