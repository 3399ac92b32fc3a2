"""The package against the built service: validation, jobs, setpoints, errors; and without it: how findings are shown."""

import asyncio
import inspect
import json
import math
import os
import subprocess
from types import SimpleNamespace

import grpc
import numpy as np
import pytest

import feedwave
import feedwave.aio
import feedwave.plot
from conftest import FIXTURES, Service
from feedwave import _requests
from feedwave.setpoints import Decoder
from feedwave.v1 import decisions_pb2, feed_override_pb2, jobs_pb2, machines_pb2, report_pb2, setpoints_pb2

TRAP, CURED, BAD = (FIXTURES / name for name in ("spec-trap.nc", "spec-trap-cured.nc", "bad.nc"))
SLOT = "G21 G90 G94 G17 S3000 M3\nG0 X10 Y0 Z0\nG1 X20 F1200\nG0 X30\nM30\n"


@pytest.fixture(scope="module")
def slot(client):
    return client.submit(SLOT, machine="mill", display_name="slot").wait(60)


def test_findings_print_under_their_source_lines(client):
    report = client.validate(BAD, machine="lathe")
    assert not report.ok and report.errors and report.findings[0].severity is feedwave.Severity.ERROR
    shown = """\
error[PRG-ARC-RADIUS-TOO-SMALL]: radius 0.5 mm cannot span the 22.522211 mm from start to end: it takes at least 11.261106 mm
  --> bad.nc:11:16
   |
11 | G2 X14.0 Z23.5 R0.5
   |                ^^^^
  = cure: use R11.2612 or more: write `R11.2612`
"""
    assert shown in str(report)
    assert f"bad.nc: rejected: {len(report.errors)} errors" in str(report).splitlines()[-1]
    page = report._repr_html_()
    assert "error[PRG-ARC-RADIUS-TOO-SMALL]" in page and page.count("^^^^") and "<script" not in page
    radius = next(finding for finding in report.findings if finding.code == "PRG-ARC-RADIUS-TOO-SMALL")
    assert radius.value("radius") == 0.5 and radius.cures[0].value.unit == "mm"


def test_a_fixed_program_is_valid(client):
    report = client.validate(TRAP, machine="machines/lathe")
    assert [finding.code for finding in report.warnings] == ["VIB-CHIP-UNBROKEN"]
    fixed = report.fixed()
    assert fixed.text == TRAP.read_text().replace("G200 F50 ", "G200 F41.667 ")
    assert report.fixed("PRG-FEED-MISSING").text == TRAP.read_text()
    again = client.validate(fixed, machine="lathe")
    assert not again.findings and again.sections[0].chip.broken


def test_a_program_is_improved_with_reasons_and_gains(client):
    improvement = client.improve(TRAP, machine="lathe")
    assert improvement.holds and improvement.after.ok
    # The vibration is blended out and in at its corner.
    assert 0.998 < improvement.after.sections[0].broken_share < 1.0
    assert [(change.old, change.new) for change in improvement.changes] == [("F50", "F41.65")]
    assert improvement.program.text == TRAP.read_text().replace("F50 A0.03", "F41.65 A0.03")
    changed = [line for line in improvement.diff().splitlines() if line[0] in "+-"]
    assert changed[2:] == ["-G200 F50 A0.03", "+G200 F41.65 A0.03"]
    assert "F50 becomes F41.65" in str(improvement) and "margin" in str(improvement)
    assert not improvement.stability_judged and str(improvement).endswith("stability is not judged: no lobes are given")
    bad = client.improve(BAD, machine="lathe")
    assert not bad.holds and not bad.steps and bad.before.errors and bad.program.read() == BAD.read_bytes()
    with pytest.raises(feedwave.InvalidArgument) as refused:
        client.improve(TRAP, machine="lathe", goals={"margin": 0.1})
    assert refused.value.violations[0].field == "goals.margin"


def test_an_improvement_keeps_to_the_lobes(client):
    lobes = {"chart": [{"spindle_rev_per_min": speed, "limit_mm": limit} for speed, limit in ((500, 1), (1100, 1), (1150, 3), (1500, 3))]}
    kept = client.improve(TRAP, machine="lathe", lobes=lobes, depth_mm=1.5)
    assert kept.stability_judged and not kept.holds and "speeds stay, as none are permitted" in str(kept)
    permitted = {"min_spindle_rev_per_min": 800, "max_spindle_rev_per_min": 1500}
    improvement = client.improve(TRAP, machine="lathe", goals=permitted, lobes=lobes, depth_mm=1.5, depth_tolerance=0.2)
    speeds = [span.spindle_rev_per_min for section in improvement.after.sections for span in section.chip_spans]
    # 3 mm of 1.8 mm from 1133 rev/min on, which may turn 2 % slower.
    assert improvement.holds and min(speeds) * 0.98 >= 1100 + 50 * (1.8 - 1) / 2, str(improvement)
    assert "stable with a margin of" in str(improvement)
    with pytest.raises(TypeError, match="go together"):
        client.improve(TRAP, machine="lathe", depth_mm=1.5)


def test_a_profile_and_settings_go_with_a_validation(client):
    machine = client.call("Machines/GetMachine", machines_pb2.GetMachineRequest(name="machines/lathe"), machines_pb2.GetMachineResponse)
    profile = machine.machine.profile
    settings = feedwave.Settings(interpolation_period_us=2000, generation_mode="tangential")
    report = client.validate(CURED, machine=profile, settings=settings)
    assert report.summary.interpolation_period_us == 2000
    assert report.sections[0].generation_mode == machines_pb2.GENERATION_MODE_TANGENTIAL
    with pytest.raises(feedwave.SourceError, match="ALONG_PATH"):
        client.validate(CURED, machine="lathe", settings=feedwave.Settings(generation_mode="sideways"))
    with pytest.raises(feedwave.SourceError, match="kinnd"):
        client.validate(CURED, machine={"machine": {"kinnd": "MACHINE_KIND_MILL"}})


def test_machines_and_tools_are_stored_and_replaced(client):
    profile = client.profile("mill")
    assert client.put_machine("mill-7", profile).profile == profile
    profile.language.block_delete = True
    assert client.put_machine("machines/mill-7", profile).profile.language.block_delete
    assert client.profile("mill-7") == profile and "machines/mill-7" in [machine.name for machine in client.machines()]
    for diameter_mm in (10.0, 12.0):
        tool = client.put_tool({"name": "end-mill-7", "number": 7, "diameter_mm": diameter_mm, "length_mm": 80.0})
        assert (tool.name, tool.diameter_mm) == ("tools/end-mill-7", diameter_mm)
    assert [tool.length_mm for tool in client.tools() if tool.number == 7] == [80.0]
    assert client.validate(SLOT, machine=profile, tools=["end-mill-7"]).ok


def test_further_files_are_called(client):
    main = "G21 G90 G94 G17 S3000 M3\nM98 P1000\nM30\n"
    called = {"O1000.nc": "O1000\nG1 X10 F1200\nG1 X20 Y..\nM99\n"}
    report = client.validate(main, machine="mill", files=called)
    assert [finding.place.file for finding in report.errors] == ["O1000.nc"]
    assert "--> O1000.nc:3:8" in str(report) and "3 | G1 X20 Y.." in str(report)
    job = client.submit(main, machine="mill", files=called).wait()
    assert job.state == "REJECTED" and "3 | G1 X20 Y.." in str(job.report())
    with pytest.raises(feedwave.SourceError, match="name"):
        client.validate(main, machine="mill", files=["M99\n\n"])


def test_setpoints_are_columns_with_units(client, slot):
    assert slot.state == "READY" and slot.is_ready and slot.summary.setpoint_count > 0
    setpoints = slot.setpoints()
    assert setpoints.count == setpoints.layout.setpoint_count == slot.summary.setpoint_count
    assert setpoints.units["X_mm"] == "mm" and setpoints.units["feed_mm_per_min"] == "mm/min"
    assert (setpoints["X_mm"][-1], setpoints["Y_mm"][-1]) == (30.0, 0.0)
    assert setpoints["X_mm"].dtype == np.float64 and setpoints["X_mm"].flags.writeable
    assert set(setpoints.line) == {0, 2, 3, 4}
    assert setpoints["time_s"][1] == 0.001 and list(setpoints) == [*setpoints.keys()]
    part = slot.setpoints(start=100, count=50, frame="work", columns=["axis_position"])
    assert list(part) == ["index", "time_s", "X_mm", "Y_mm", "Z_mm", "source_line"]
    assert part.first_index == 100 and np.array_equal(part["X_mm"], setpoints["X_mm"][100:150])
    assert [use.axis for use in slot.plan_summary().limit_use] == ["X", "Y", "Z"]
    assert slot.setpoints(start_time_s=0.1, count=1).first_index == 100
    assert slot.setpoints(count=0).count == 0
    assert part == slot.setpoints(frame="work", columns=["axis_position"]).rows(100, 150) != part.rows(0, 49)
    with pytest.raises(KeyError, match="X_mm"):
        setpoints["x"]


def test_batches_are_the_whole_and_no_larger_than_asked_for(slot):
    whole = slot.setpoints()
    batches = list(slot.batches(batch=100))
    assert max(batch.count for batch in batches) <= 100 < whole.count
    assert np.array_equal(np.concatenate([batch["X_mm"] for batch in batches]), whole["X_mm"])
    # Who stops asking ends the stream.
    iterator = slot.batches(batch=100)
    assert next(iterator).first_index == 0
    iterator.close()


def test_deltas_decode_within_their_resolution(slot):
    whole, rounded = slot.setpoints(), slot.setpoints(encoding="fixed_point_delta", batch=100)
    for name in whole.layout.names:
        assert np.abs(whole[name] - rounded[name]).max() <= 0.5e-6 + 1e-12 * np.abs(whole[name]).max(), name


def test_overrides_are_part_of_the_plan(client, slot):
    programmed = slot.summary.duration_s
    by_time = slot.setpoints(overrides=[(0.2, 0.5)])
    by_index = slot.setpoints(overrides=[feedwave.Override(0.5, setpoint_index=200)])
    assert np.array_equal(by_time["X_mm"], by_index["X_mm"])
    assert by_time.time_s[-1] > programmed and by_time["X_mm"][-1] == 30.0
    report = client.validate(SLOT, machine="mill", overrides=[(0.2, 0.5)])
    assert report.summary.setpoint_count == by_time.count
    with pytest.raises(feedwave.SourceError):
        slot.setpoints(overrides=[feedwave.Override(0.5)])


def test_data_frames_have_the_columns_of_setpoint_files(slot):
    setpoints = slot.setpoints()
    pandas, polars, arrow = setpoints.to_pandas(), setpoints.to_polars(), setpoints.to_arrow()
    assert list(pandas.columns) == list(setpoints)[1:] and pandas.index.name == "index"
    assert polars.columns == arrow.column_names == list(setpoints)
    assert pandas["X_mm"].iloc[-1] == polars["X_mm"][-1] == arrow["X_mm"][-1].as_py() == 30.0
    assert arrow.schema.field("feed_mm_per_min").metadata == {b"unit": b"mm/min"}
    assert arrow.schema.metadata[b"unit:X_mm"] == b"mm"


def test_a_chunk_that_is_not_made_as_its_header_says_is_refused():
    header = setpoints_pb2.StreamHeader(period_us=1000.0, columns=[{"name": "X_mm", "unit": "mm"}])
    decoder = Decoder(header)
    lines = [{"line": 2, "count": 2}]
    block = decoder.block(setpoints_pb2.SetpointChunk(first_index=7, count=2, line_runs=lines, columns=[{"values": [-0.0, math.inf]}]))
    assert block["X_mm"].tobytes() == np.array([-0.0, math.inf]).tobytes() and block.index.tolist() == [7, 8]
    for columns, runs in [([], lines), ([{"values": [1.0]}], lines), ([{"values": [1.0, 2.0]}], [])]:
        with pytest.raises(feedwave.ContractError):
            decoder.block(setpoints_pb2.SetpointChunk(count=2, line_runs=runs, columns=columns))


def test_raw_doubles_are_taken_over_without_a_copy():
    header = setpoints_pb2.StreamHeader(encoding=setpoints_pb2.ENCODING_RAW_DOUBLE, columns=[{"name": "X_mm", "unit": "mm"}])
    raw, lines = np.array([-0.0, math.inf], dtype="<f8").tobytes(), [{"line": 2, "count": 2}]
    column = Decoder(header).block(setpoints_pb2.SetpointChunk(count=2, line_runs=lines, columns=[{"raw": raw}]))["X_mm"]
    assert column.tobytes() == raw and not column.flags.owndata
    for broken in (raw[:-1], raw[:8], b""):
        with pytest.raises(feedwave.ContractError):
            Decoder(header).block(setpoints_pb2.SetpointChunk(count=2, line_runs=lines, columns=[{"raw": broken}]))


def test_extreme_deltas_are_infinite():
    header = setpoints_pb2.StreamHeader(encoding=setpoints_pb2.ENCODING_FIXED_POINT_DELTA, columns=[{"name": "low_mm", "resolution": 1e-6}])
    # Differences modulo 2^64: -inf, +inf, and back to 0.1.
    deltas = [-(2**63), -1, 100_001 - 2**63]
    chunk = setpoints_pb2.SetpointChunk(count=3, line_runs=[{"line": 1, "count": 3}], columns=[{"deltas": deltas}])
    assert Decoder(header).block(chunk)["low_mm"].tolist() == [-math.inf, math.inf, 0.1]


def test_large_programs_are_uploaded_and_read_back(client, tmp_path):
    path = tmp_path / "large.nc"
    path.write_text(SLOT.replace("G1 X20 F1200\n", "G1 X20 F1200\n" + "G1 X10\nG1 X20\n" * 60_000))
    job = client.submit(path, machine="mill")
    assert job.proto.program_bytes == path.stat().st_size > 512 * 1024
    again = client.submit(path, machine="mill", request_id="large-1")
    assert client.submit(path, machine="mill", request_id="large-1").name == again.name != job.name
    for one in (job, again):
        assert one.cancel().state == "CANCELLED"
        one.delete()
    with pytest.raises(feedwave.NotFound) as caught:
        job.refresh()
    assert caught.value.details.resource == job.name


def test_what_is_too_large_for_a_request_is_told_to_be_submitted(client):
    # More than is taken inline, and more than a message may have.
    for lines, kind in [(100_000, feedwave.InvalidArgument), (400_000, feedwave.ResourceExhausted)]:
        with pytest.raises(kind, match=r"client\.submit\(…\)\.wait\(\)\.report\(\) uploads it"):
            client.validate("G1 X10 F100\n" * lines, machine="mill")
    with pytest.raises(feedwave.InvalidArgument, match=r"client\.submit\(…\)\.wait\(\)\.report\(\) uploads it"):
        client.validate(SLOT, machine="mill", files={"O1.nc": "G1 X10 F100\n" * 100_000})
    report = client.submit("G21 G90 G94 G17 S3000 M3\nG0 X10 Y0 Z0\n" + "G1 X10 F1200\n" * 100_000 + "M30\n", machine="mill").wait().report()
    assert report.ok


def test_what_a_service_does_not_take_with_a_request_is_uploaded(tmp_path):
    service = Service(tmp_path, LIMITS__INLINE_PROGRAM_BYTES="60")
    try:
        with service.connect() as client:
            with pytest.raises(feedwave.InvalidArgument, match="more than the 60 allowed"):
                client.validate(SLOT, machine="mill")
            call = "G21 G90 G94 G17 S3000 M3\nG0 X10 Y0 Z0\nM98 P1\nM30\n"
            files = {"O1.nc": "G1 X20 F1200\nM99\n"}
            for program, further in [(SLOT, {}), (call, files)]:
                job = client.submit(program, machine="mill", files=further).wait()
                assert job.is_ready and job.proto.program_bytes == len(program), str(job.report())
            # What else is wrong is told before anything is uploaded.
            with pytest.raises(feedwave.InvalidArgument) as caught:
                client.submit(SLOT + "(more)\n", machine="mill", display_name="x" * 201)
            assert {one.field for one in caught.value.violations} == {"inline_program", "display_name"}
        service.end()
    finally:
        service.process.kill()


def test_waiting_looks_before_it_waits(client, slot):
    assert client.job(slot.name).wait(timeout_s=0).is_ready
    with pytest.raises(feedwave.SourceError, match="timeout_s is -1"):
        slot.wait(timeout_s=-1)


def test_waiting_ends_with_its_time():
    validating = jobs_pb2.GetJobResponse(job={"name": "jobs/x", "state": jobs_pb2.JOB_STATE_VALIDATING})
    # Without time it looks once, and opens no stream.
    flow = _requests.wait(feedwave.Retries(), "x", 0)
    assert next(flow).method == "Jobs/GetJob"
    with pytest.raises(feedwave.DeadlineExceeded, match="validation of jobs/x has not ended after 0 s"):
        flow.send(validating)
    # With time, the stream has what is left of it, and its end is told in the same words.
    flow = _requests.wait(feedwave.Retries(), "x", 1e6)
    next(flow)
    opened = flow.send(validating)
    assert opened.method == "Jobs/WatchJobs" and 0.0 < opened.timeout_s <= 1e6
    flow.send(SimpleNamespace(cancel=lambda: None))
    with pytest.raises(feedwave.DeadlineExceeded, match=r"validation of jobs/x has not ended after 1e\+06 s"):
        flow.throw(feedwave.DeadlineExceeded("Stream removed (Deadline Exceeded)"))


def test_jobs_are_listed_newest_first(client, slot):
    names = [job.name for job in client.jobs("READY", machine="mill")]
    assert slot.name in names and client.job(slot.name).display_name == "slot"
    newer = client.submit(SLOT, machine="mill").wait()
    names = [job.name for job in client.jobs("ready")]
    assert names.index(newer.name) < names.index(slot.name)
    newer.delete()


def test_errors_carry_code_reason_and_violations(client):
    with pytest.raises(feedwave.InvalidArgument) as caught:
        client.submit(SLOT, machine="Mill", settings=feedwave.Settings(interpolation_period_us=7))
    error = caught.value
    assert error.code is grpc.StatusCode.INVALID_ARGUMENT and (error.reason, error.details.domain) == ("INVALID_FIELDS", "feedwave")
    assert {violation.field for violation in error.violations} == {"machine", "interpolation_period_us"}
    assert not error.is_passing and error.method == "Jobs/CreateJob"
    with pytest.raises(feedwave.ServiceError) as caught:
        client.job("00000000-0000-0000-0000-000000000000")
    assert isinstance(caught.value, feedwave.NotFound)


def test_certificates_and_tokens_open_an_encrypted_service(tmp_path, monkeypatch):
    tls, clients = FIXTURES / "tls", tmp_path / "clients.toml"
    command = [os.environ["FEEDWAVE_BINARY"], "token", "dashboard", "--role", "viewer", "--clients", str(clients)]
    token = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    settings = {"TLS__CERT": tls / "server.pem", "TLS__KEY": tls / "server-key.pem", "TLS__CLIENT_CA": tls / "ca.pem", "AUTH__CLIENTS": clients}
    service = Service(tmp_path, **{name: str(path) for name, path in settings.items()})
    own = {"cert": tls / "client.pem", "key": tls / "client-key.pem", "domain": "feedwave.test"}
    try:
        with service.connect(ca=tls / "ca.pem", token=token, **own) as client:
            assert list(client.jobs()) == []
            with pytest.raises(feedwave.PermissionDenied) as caught:
                client.validate(SLOT, machine="mill")
            assert caught.value.reason == "ROLE_NEEDED" and caught.value.details.metadata["role"] == "planner"
        with service.connect(ca=tls / "ca.pem", **own) as client, pytest.raises(feedwave.Unauthenticated):
            list(client.jobs())
        # A service that another authority has signed, and a client without a certificate.
        hasty = feedwave.Retries(give_up_after_s=0.0)
        for options in [{"ca": tls / "other-ca.pem", **own}, {"ca": tls / "ca.pem", "domain": "feedwave.test"}]:
            with service.connect(token=token, retries=hasty, **options) as client, pytest.raises(feedwave.Unavailable):
                list(client.jobs())
        # As the commands are told, by the environment.
        for name, value in [("SERVER", f"https://{service.ports['grpc']}"), ("CA", tls / "ca.pem"), ("CERT", own["cert"]), ("KEY", own["key"])]:
            monkeypatch.setenv(f"FEEDWAVE_{name}", str(value))
        monkeypatch.setenv("FEEDWAVE_DOMAIN", "feedwave.test")
        monkeypatch.setenv("FEEDWAVE_TOKEN", token)
        with feedwave.connect() as client:
            assert list(client.jobs()) == []
        service.end()
    finally:
        service.process.kill()


def test_a_client_of_any_tenant_says_for_which_it_acts(tmp_path, monkeypatch):
    clients = tmp_path / "clients.toml"

    def token(name, tenant):
        command = [os.environ["FEEDWAVE_BINARY"], "token", name, "--role", "planner", "--tenant", tenant, "--clients", str(clients)]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()

    everywhere, north = token("everywhere", "*"), token("northern", "north")
    service = Service(tmp_path, AUTH__CLIENTS=str(clients))
    try:
        with service.connect(token=everywhere, tenant="north") as client:
            job = client.submit(SLOT, machine="mill")
        with service.connect(token=north) as client:
            assert [one.name for one in client.jobs()] == [job.name]
        with service.connect(token=everywhere, tenant="south") as client:
            assert list(client.jobs()) == []
        with service.connect(token=north, tenant="south") as client, pytest.raises(feedwave.PermissionDenied) as caught:
            list(client.jobs())
        assert caught.value.reason == "TENANT_DENIED"
        monkeypatch.setenv("FEEDWAVE_TENANT", "north")
        with service.connect(token=everywhere) as client:
            assert [one.name for one in client.jobs()] == [job.name]
        service.end()
    finally:
        service.process.kill()


def test_arguments_that_contradict_each_other_are_refused(tmp_path):
    for address, options in [("ftp://x", {}), ("http://x", {"ca": b"pem"}), ("x:1", {"cert": b"pem"})]:
        with pytest.raises(feedwave.SourceError):
            feedwave.connect(address, **options)
    with pytest.raises(feedwave.SourceError, match="no file"):
        feedwave.Program.of("G1 X10")
    profile = tmp_path / "mill.toml"
    profile.write_text('[machine]\nkind = "MACHINE_KIND_MILL"\n')
    assert feedwave.load_profile(profile).machine.kind == machines_pb2.MACHINE_KIND_MILL
    profile.write_text('[machine]\nkid = "MACHINE_KIND_MILL"\n')
    with pytest.raises(feedwave.SourceError, match="mill.toml"):
        feedwave.load_profile(profile)


def test_a_profile_is_completed_from_the_generic_machine(client, tmp_path):
    mill = client.profile("mill")
    path = tmp_path / "mill.toml"
    path.write_text('max_feed_override = 1.3\n[machine]\nmax_spindle_rev_per_min = 9000\n')
    assert not feedwave.load_profile(path).machine.axes
    profile = feedwave.load_profile(path, generic=mill)
    assert list(profile.machine.axes) == list(mill.machine.axes) and profile.machine.kind == mill.machine.kind
    assert (profile.machine.max_spindle_rev_per_min, profile.max_feed_override) == (9000.0, 1.3)
    # Nothing of the generic machine is taken twice.
    for fixture in ("five-axis-mill", "oscillation-mill", "oscillation-head", "five-axis-fitted"):
        profile = feedwave.load_profile(FIXTURES / f"{fixture}.toml", generic=mill)
        names = [axis.axis for axis in profile.machine.axes]
        assert len(names) == len(set(names)) >= 3 and client.validate(SLOT, machine=profile).ok
    (tmp_path / "stored.json").write_text(json.dumps({"name": "machines/a", "profile": {"machine": {"maxSpindleRevPerMin": 5.0}}}))
    assert feedwave.load_profile(tmp_path / "stored.json", generic=mill).machine.max_spindle_rev_per_min == 5.0
    for text, reason in [("[machine]\nkind = 'MACHINE_KIND_LATHE'\n", "kind is LATHE"), ("machine = 3\n", "machine")]:
        path.write_text(text)
        with pytest.raises(feedwave.SourceError, match=reason) as refused:
            feedwave.load_profile(path, generic=mill)
        assert str(refused.value).count("mill.toml") == 1
    (tmp_path / "list.json").write_text("[1]")
    with pytest.raises(feedwave.SourceError, match="list.json: the fields"):
        feedwave.load_profile(tmp_path / "list.json")


def test_pictures_are_drawn(client, slot, tmp_path):
    trap, cured = (client.validate(path, machine="lathe") for path in (TRAP, CURED))
    setpoints = slot.setpoints()
    thread = client.validate(FIXTURES / "thread-a.nc", machine="lathe").proto.threads[0]
    mode = {"frequency_hz": 900.0, "damping_ratio": 0.03, "stiffness_n_per_mm": 9000.0}
    dynamics = {"modes_x": [mode], "modes_y": [mode], "tangential_n_per_mm2": 700.0, "radial_ratio": 0.3}
    model = {"dynamics": dynamics, "milling": {"entry_deg": 0.0, "exit_deg": 90.0, "edge_count": 4}}
    lobes = client.lobes(model, {"lowest_rev_per_min": 3000.0, "highest_rev_per_min": 16000.0})
    pictures = {
        "path": feedwave.plot.path(setpoints),
        "feed": feedwave.plot.feed(setpoints),
        "chip": feedwave.plot.chip(trap.sections[0], cured.sections[0]),
        "thread": feedwave.plot.thread(thread),
        "lobes": feedwave.plot.lobes(lobes),
    }
    for name, picture in pictures.items():
        assert picture._repr_png_().startswith(b"\x89PNG")
        picture.save(tmp_path / f"{name}.svg")
    # The thickness that is drawn is the one that the service reports.
    for report in (trap, cured):
        section = report.sections[0]
        thickness = feedwave.plot.chip_thickness_mm(section.chip, section.amplitude_mm, np.linspace(0, 50, 200_001))
        assert abs(thickness.max() - section.chip.largest_thickness_mm) < 1e-6
        assert abs(np.mean(thickness <= 0) - section.chip.air_share) < 1e-3
    with pytest.raises(feedwave.SourceError):
        feedwave.plot.chip()


def finding(line, column, length, **more):
    return report_pb2.Finding(code="X-Y", severity=report_pb2.SEVERITY_WARNING, line=line, column=column, length=length, message="m", **more)


@pytest.mark.parametrize(
    ("line", "column", "length", "shown"),
    [
        (b"G1 X1", 4, 2, ["1 | G1 X1", "  |    ^^"]),
        # A point between bytes, also behind the last one.
        (b"G1 X1", 6, 0, ["1 | G1 X1", "  |      ^"]),
        (b"\tG1 X1", 5, 2, ["1 |     G1 X1", "  |        ^^"]),
        # Columns count bytes, carets stand under characters.
        ("(Größe) X1".encode(), 11, 2, ["1 | (Größe) X1", "  |         ^^"]),
        (b"(\xff\x07) X1", 6, 2, ["1 | (\ufffd.) X1", "  |      ^^"]),
        # A place that the line does not have.
        (b"G1", 90, 5, ["1 | G1", "  |   ^"]),
    ],
)
def test_carets_stand_under_the_span(line, column, length, shown):
    report = feedwave.Report(report_pb2.ValidationReport(findings=[finding(1, column, length)]), feedwave.Program(line + b"\n"))
    assert "\n".join(shown) in str(report)


def test_lines_end_as_the_service_reads_them(tmp_path):
    program = feedwave.Program("A\rB\r\nC\nD")
    assert program.lines({1, 2, 3, 4, 5}) == {1: b"A", 2: b"B", 3: b"C", 4: b"D"}
    program.save(tmp_path / "p.nc")
    assert feedwave.Program.file(tmp_path / "p.nc").lines({2, 4}) == {2: b"B", 4: b"D"}


def test_what_was_met_again_and_other_places_are_told():
    related = {"message": "called here", "line": 2, "column": 1, "length": 3, "is_call": True}
    occurrence = {"name": "pass", "number": 3}
    proto = finding(9, 1, 1, occurrences=4, first=occurrence, related=[related])
    text = str(feedwave.Report(report_pb2.ValidationReport(findings=[proto]), feedwave.Program("A\nM98\n")))
    assert "m (4 times, first in pass 3)" in text and "note: called here\n --> program:2:1\n  |\n2 | M98\n  | ^^^" in text
    # Without the program there is a place, and no line.
    assert " --> program:9:1\n" in str(feedwave.Report(report_pb2.ValidationReport(findings=[proto])))


def test_replacements_do_not_disturb_each_other():
    def cure(line, column, length, replacement):
        return finding(line, column, length, suggestions=[{"message": "write", "replacement": replacement}])

    found = [cure(1, 1, 2, "G01"), cure(1, 4, 2, ""), cure(1, 5, 1, "lost"), cure(2, 3, 0, " F1"), cure(9, 1, 1, "beyond")]
    report = feedwave.Report(report_pb2.ValidationReport(findings=found), feedwave.Program("G1 X1 Y2\r\nG1\n"))
    assert report.fixed().text == "G01  Y2\r\nG1 F1\n"


def test_overrides_are_written_as_the_contract_has_them():
    change = feedwave.Override(0.5, time_s=1.5).message()
    assert change == feed_override_pb2.FeedOverrideChange(time_s=1.5, ratio=0.5)


def test_both_clients_have_the_same_methods():
    for one, other in [(feedwave.Client, feedwave.aio.Client), (feedwave.Job, feedwave.aio.Job), (feedwave.Run, feedwave.aio.Run), (feedwave.Telemetry, feedwave.aio.Telemetry)]:
        def methods(kind):
            members = inspect.getmembers(kind, lambda member: inspect.isfunction(member) or isinstance(member, property))
            return {name: member for name, member in members if not name.startswith("_")}

        found, twins = methods(one), methods(other)
        assert found.keys() == twins.keys()
        for name, member in found.items():
            assert inspect.getdoc(member) == inspect.getdoc(twins[name]), name
            if inspect.isfunction(member):
                parameters = [str(parameter) for parameter in inspect.signature(member).parameters.values()]
                assert parameters == [str(parameter) for parameter in inspect.signature(twins[name]).parameters.values()], name
    assert str(inspect.signature(feedwave.connect)).split("->")[0] == str(inspect.signature(feedwave.aio.connect)).split("->")[0]


def test_asyncio_does_the_same(server, slot):
    async def scene():
        async with feedwave.aio.connect(server.ports["grpc"]) as client:
            report = await client.validate(TRAP, machine="lathe")
            job = await client.job(slot.name)
            setpoints = await job.setpoints()
            batches = [batch.count async for batch in job.batches(batch=100)]
            names = [job.name async for job in client.jobs()]
            with pytest.raises(feedwave.InvalidArgument) as caught:
                await client.submit(SLOT, machine="Mill")
            waited = await (await client.submit(SLOT, machine="mill")).wait(60)
            return report, setpoints, batches, names, caught.value, waited

    report, setpoints, batches, names, error, waited = asyncio.run(scene())
    assert [finding.code for finding in report.findings] == ["VIB-CHIP-UNBROKEN"]
    assert np.array_equal(setpoints["X_mm"], slot.setpoints()["X_mm"]) and sum(batches) == setpoints.count
    assert slot.name in names and error.violations and waited.is_ready


def test_a_closed_client_says_so(server):
    client = server.connect()
    client.close()
    for call in (lambda: client.validate(TRAP, machine="lathe"), lambda: list(client.jobs())):
        with pytest.raises(feedwave.ClosedError, match="the client is closed: "):
            call()

    async def scene():
        other = feedwave.aio.connect(server.ports["grpc"])
        await other.close()
        with pytest.raises(feedwave.ClosedError, match="the client is closed: "):
            await other.validate(TRAP, machine="lathe")

    asyncio.run(scene())


def test_a_decision_says_why_nothing_was_judged():
    proto = decisions_pb2.Decision(sensor_time_ns=1_099_000_000)
    proto.span.samples, proto.span.valid, proto.span.removed.out_of_range = 100, 46, 54
    proto.outcome.action, proto.outcome.reason = decisions_pb2.DECISION_ACTION_HOLD, decisions_pb2.DECISION_REASON_DATA
    proto.outcome.hold_reason, proto.outcome.after.feed = decisions_pb2.HOLD_REASON_TOO_FEW_SAMPLES, 1.0
    told = "decision 0 at 1.099 s: HOLD, DATA (TOO_FEW_SAMPLES, 46 of 100 samples valid: 54 out_of_range), feed 100 %"
    assert str(feedwave.Decision.of(proto)) == told
