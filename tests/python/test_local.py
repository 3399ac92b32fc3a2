"""The local mode: the same reports and the same setpoints as of the service, to the last bit, and refusals in its terms."""

import os
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
