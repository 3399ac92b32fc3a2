"""A client in another language, with nothing but the contract: submits, validates, streams, checks numbers."""

import math
import uuid

import grpc
import pytest
from google.protobuf.descriptor_pool import DescriptorPool
from google.rpc import error_details_pb2
from grpc_health.v1 import health_pb2, health_pb2_grpc
from grpc_reflection.v1alpha.proto_reflection_descriptor_database import ProtoReflectionDescriptorDatabase
from grpc_status import rpc_status

from feedwave.v1 import jobs_pb2, machines_pb2, report_pb2, setpoints_pb2

# The example of the specification: at S1000, 50 Hz are three vibrations per revolution, and the chip never breaks.
PROGRAM = """\
M3 S1000
G0 X6. Z10.
G200 F{frequency_hz} A0.03
G01 X10.0 Z20.0 F0.01
G02 X14.0 Z23.5 R4.0
G201
M30
"""
LINE_OF_VIBRATION, LINE_OF_LINE, LINE_OF_ARC = 3, 4, 5
AMPLITUDE_MM = 0.03
CURED_FREQUENCY_HZ = 41.667
PERIOD_S = 1e-3


def submit(service, program):
    """Creates a job and follows its events until validation has ended."""
    request = jobs_pb2.CreateJobRequest(
        request_id=str(uuid.uuid4()), machine="machines/lathe", inline_program=program.encode()
    )
    job = service.jobs.CreateJob(request, timeout=60).job
    ends = {jobs_pb2.JOB_STATE_READY, jobs_pb2.JOB_STATE_REJECTED, jobs_pb2.JOB_STATE_FAILED}
    events = service.jobs.WatchJobs(jobs_pb2.WatchJobsRequest(after=0, job=job.name), timeout=120)
    state = next(message.event.state for message in events if message.event.state in ends)
    events.cancel()
    report = service.jobs.GetReport(jobs_pb2.GetReportRequest(job=job.name), timeout=60).report
    return job.name, state, report


def stream(service, **request):
    """Reads a whole stream; answers with its header, its columns by name, and the line of every setpoint."""
    header, columns, lines = None, {}, []
    for message in service.setpoints.StreamSetpoints(setpoints_pb2.StreamSetpointsRequest(**request), timeout=300):
        if message.WhichOneof("message") == "header":
            assert header is None
            header = message.header
            columns = {column.name: [] for column in header.columns}
            continue
        chunk = message.chunk
        assert chunk.first_index == header.first_index + len(lines)
        for info, column in zip(header.columns, chunk.columns, strict=True):
            values = list(column.values)
            if header.encoding == setpoints_pb2.ENCODING_FIXED_POINT_DELTA:
                assert not values
                steps = 0
                for delta in column.deltas:
                    steps += delta
                    values.append(steps * info.resolution)
            assert len(values) == chunk.count
            columns[info.name].extend(values)
        for run in chunk.line_runs:
            lines.extend([run.line] * run.count)
    assert all(len(values) == len(lines) for values in columns.values())
    return header, columns, lines


@pytest.fixture(scope="module")
def cured(service):
    """A valid job whose chip breaks, and its whole stream."""
    name, state, report = submit(service, PROGRAM.format(frequency_hz=CURED_FREQUENCY_HZ))
    assert state == jobs_pb2.JOB_STATE_READY
    return name, report, stream(service, job=name)


def test_the_trap_is_caught_and_its_cure_suggested(service):
    _, state, report = submit(service, PROGRAM.format(frequency_hz=50))
    assert state == jobs_pb2.JOB_STATE_READY
    finding = next(finding for finding in report.findings if finding.code == "VIB-CHIP-UNBROKEN")
    assert finding.severity == report_pb2.SEVERITY_WARNING
    assert finding.line == LINE_OF_VIBRATION and finding.column >= 1
    suggested = [suggestion.value.value for suggestion in finding.suggestions]
    assert any(abs(value - 41.667) < 1e-3 for value in suggested), suggested
    assert any(abs(value - 58.333) < 1e-3 for value in suggested), suggested


def test_the_cure_breaks_the_chip(cured):
    _, report, _ = cured
    assert "VIB-CHIP-UNBROKEN" not in [finding.code for finding in report.findings]
    assert len(report.sections) == 1
    assert (report.sections[0].first_line, report.sections[0].last_line) == (LINE_OF_LINE, LINE_OF_ARC)


def test_setpoints_are_evenly_timed_and_end_on_the_programmed_point(cured):
    _, report, (header, columns, lines) = cured
    assert header.period_us == 1000.0 and header.first_index == 0
    assert len(lines) == header.setpoint_count == report.summary.setpoint_count
    assert columns["X_mm"][-1] == 14.0 / 2 and columns["Z_mm"][-1] == 23.5
    path = columns["path_position_mm"]
    assert all(later >= earlier for earlier, later in zip(path, path[1:]))
    # Line 0: where the machine is before the first block.
    assert lines[0] == 0 and set(lines) == {0, 2, LINE_OF_LINE, LINE_OF_ARC}
    duration_s = report.summary.duration_s
    assert abs(duration_s - len(lines) * PERIOD_S) <= 2 * PERIOD_S


def test_the_vibration_is_a_sine_of_the_programmed_amplitude_and_frequency(cured):
    _, _, (_, columns, lines) = cured
    offset = next(values for name, values in columns.items() if name.startswith("vibration"))
    start = lines.index(LINE_OF_LINE)
    assert not any(offset[:start])
    assert AMPLITUDE_MM * 0.99 < max(map(abs, offset)) <= AMPLITUDE_MM + 1e-12
    # The tool follows A·e(d/L)·sin(2πft) with t from the section's start; L is 1.2 amplitudes at this slow feed.
    path = columns["path_position_mm"]
    for sample in (1, 50, 100, 150, 200, 2_001, 5_000, 12_345, 30_000):
        x = min((path[start + sample - 1] - path[start - 1]) / (1.2 * AMPLITUDE_MM), 1.0)
        amplitude_mm = AMPLITUDE_MM * (6 * x**5 - 15 * x**4 + 10 * x**3)
        expected = amplitude_mm * math.sin(2 * math.pi * CURED_FREQUENCY_HZ * sample * PERIOD_S)
        assert abs(offset[start + sample - 1] - expected) < 1e-9, sample
    # The displacement is along the path: the straight line from (3, 10) to (5, 20), back and forth.
    x, z = columns["X_mm"], columns["Z_mm"]
    length = math.hypot(2, 10)
    for index in (start + 5_000, start + 12_345):
        along = path[index] - path[start - 1] + offset[index]
        assert abs(x[index] - (3 + along * 2 / length)) < 1e-9
        assert abs(z[index] - (10 + along * 10 / length)) < 1e-9


def test_fixed_point_deltas_decode_within_their_resolution(service, cured):
    name, _, (_, exact, lines) = cured
    encoding = setpoints_pb2.ENCODING_FIXED_POINT_DELTA
    header, compact, compact_lines = stream(service, job=name, encoding=encoding, chunk_size=1000)
    assert compact_lines == lines
    for column in header.columns:
        worst = max(abs(a - b) for a, b in zip(exact[column.name], compact[column.name], strict=True))
        scale = max(map(abs, exact[column.name]))
        assert worst <= column.resolution / 2 + scale * 2**-52, (column.name, worst)


def test_a_resumed_stream_is_the_original(service, cured):
    name, _, (_, whole, lines) = cured
    header, rest, rest_lines = stream(service, job=name, start_index=54_321)
    assert header.first_index == 54_321 and rest_lines == lines[54_321:]
    assert all(rest[column] == values[54_321:] for column, values in whole.items())


def test_errors_carry_details(service):
    request = jobs_pb2.CreateJobRequest(machine="lathe", interpolation_period_us=7, inline_program=b"M30\n")
    with pytest.raises(grpc.RpcError) as caught:
        service.jobs.CreateJob(request, timeout=60)
    assert caught.value.code() == grpc.StatusCode.INVALID_ARGUMENT
    details = {detail.TypeName(): detail for detail in rpc_status.from_call(caught.value).details}
    bad_request, info = error_details_pb2.BadRequest(), error_details_pb2.ErrorInfo()
    assert details["google.rpc.BadRequest"].Unpack(bad_request)
    assert details["google.rpc.ErrorInfo"].Unpack(info)
    assert {violation.field for violation in bad_request.field_violations} == {"machine", "interpolation_period_us"}
    assert (info.reason, info.domain) == ("INVALID_FIELDS", "feedwave")

    with pytest.raises(grpc.RpcError) as caught:
        service.machines.GetMachine(machines_pb2.GetMachineRequest(name="machines/nowhere"), timeout=60)
    assert caught.value.code() == grpc.StatusCode.NOT_FOUND


@pytest.mark.parametrize("compression", [grpc.Compression.NoCompression, grpc.Compression.Gzip])
def test_a_refusal_with_many_violations_reaches_the_client(service, compression):
    tools = [f"tools/No Tool {index} {'x' * 500}" for index in range(50)]
    request = jobs_pb2.CreateJobRequest(machine="machines/lathe", tools=tools, inline_program=b"M30\n")
    with pytest.raises(grpc.RpcError) as caught:
        service.jobs.CreateJob(request, timeout=60, compression=compression)
    assert caught.value.code() == grpc.StatusCode.INVALID_ARGUMENT
    details = {detail.TypeName(): detail for detail in rpc_status.from_call(caught.value).details}
    bad_request, info = error_details_pb2.BadRequest(), error_details_pb2.ErrorInfo()
    assert details["google.rpc.BadRequest"].Unpack(bad_request)
    assert details["google.rpc.ErrorInfo"].Unpack(info)
    assert len(bad_request.field_violations) + int(info.metadata["violations_not_listed"]) == len(tools)


@pytest.mark.parametrize("compression", [grpc.Compression.NoCompression, grpc.Compression.Gzip])
def test_a_message_that_is_too_large_is_told_as_such(service, compression):
    request = machines_pb2.GetMachineRequest(name="x" * (5 << 20))
    with pytest.raises(grpc.RpcError) as caught:
        service.machines.GetMachine(request, timeout=60, compression=compression)
    assert caught.value.code() == grpc.StatusCode.RESOURCE_EXHAUSTED
    info = error_details_pb2.ErrorInfo()
    details = {detail.TypeName(): detail for detail in rpc_status.from_call(caught.value).details}
    assert details["google.rpc.ErrorInfo"].Unpack(info)
    assert (info.reason, info.metadata["limit_bytes"]) == ("MESSAGE_TOO_LARGE", str(4 << 20))


def test_the_service_describes_itself(channel):
    database = ProtoReflectionDescriptorDatabase(channel)
    services = set(database.get_services())
    names = ["Jobs", "Machines", "Setpoints", "Threads", "Tools"]
    assert {f"feedwave.v1.{name}" for name in names} | {"grpc.health.v1.Health"} <= services
    described = DescriptorPool(database).FindServiceByName("feedwave.v1.Setpoints")
    assert "StreamSetpoints" in {method.name for method in described.methods}


def test_health(channel):
    health = health_pb2_grpc.HealthStub(channel)
    response = health.Check(health_pb2.HealthCheckRequest(service="feedwave.v1.Jobs"), timeout=60)
    assert response.status == health_pb2.HealthCheckResponse.SERVING
