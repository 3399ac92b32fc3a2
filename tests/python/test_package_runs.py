"""Live runs and broken connections: the service is killed (`kill -9`), and the caller hears everything once."""

import asyncio
import itertools
import threading

import grpc
import numpy as np
import pytest

import feedwave
import feedwave.aio
from feedwave import _flow, errors
from feedwave.v1 import telemetry_pb2

SLOT = "G21 G90 G94 G17 S3000 M3\nG0 X10 Y0 Z0\nG1 X60 F1200\nG0 X70\nM30\n"
TENTH = {"duration_s": 0.1}
MONITORING = {
    "sample_rate_hz": 1000.0,
    "grouping": {"samples_per_point": 10},
    "baseline": TENTH,
    "window": TENTH,
    "settling_s": 0.0,
    "tool": {"quantity": "SENSOR_QUANTITY_DISPLACEMENT", "max": 10.0},
    "tool_check": {"max_run_out": 0.5},
    # The telemetry of these tests goes on where it stood, however long the service was away.
    "quality": {"min_valid_samples": 50, "stuck_samples": 20, "silence_s": 3000.0, "stale_s": 3000.0},
    "rules": {"feed": {"lower": 0.003, "upper": 0.01}},
}


class Sensor:
    """A displacement sensor on a tool that bends with the feed in line 3."""

    def __init__(self):
        self.noise = np.random.default_rng(1)
        self.clock_ns = 1_000_000_000

    def samples(self, bent_mm):
        time_ns = self.clock_ns + 1_000_000 * np.arange(1, len(bent_mm) + 1)
        self.clock_ns = int(time_ns[-1])
        x, y = self.noise.normal(1.0, 1e-6, (2, len(bent_mm)))
        return {"time_ns": time_ns, "tool": (x + bent_mm, y), "contact": bent_mm > 0}

    def idle(self):
        return self.samples(np.zeros(150))

    def along(self, setpoints):
        return self.samples(np.where(setpoints.line == 3, 0.02 * setpoints["feed_mm_per_min"] / 1200, 0.0))


class Heard:
    """Everything that a run told."""

    def __init__(self):
        self.blocks, self.decisions, self.changes, self.end = [], [], [], None

    def take(self, event):
        if isinstance(event, feedwave.Setpoints):
            assert event.first_index == self.taken, "setpoints come once and without gaps"
            self.blocks.append(event)
        elif isinstance(event, feedwave.Decision):
            assert event.number == len(self.decisions), "decisions come once and in order"
            self.decisions.append(event)
        elif isinstance(event, feedwave.FeedChange):
            self.changes.append(event)
        elif isinstance(event, feedwave.Ended):
            assert self.end is None
            self.end = event
        else:
            assert isinstance(event, (feedwave.Acknowledged, feedwave.Refused)), event

    @property
    def taken(self):
        return self.blocks[-1].end_index if self.blocks else 0

    def is_proved_by(self, client, job, run):
        """What was heard is what the log has, and what the plan is under the changes of the feed."""
        assert self.end.state == "FINISHED" and self.end.setpoint_count == self.taken
        assert [one.proto for one in client.decisions(run)] == [one.proto for one in self.decisions]
        overrides = [feedwave.Override(change.ratio, setpoint_index=change.setpoint_index) for change in self.changes]
        plan = client.setpoints(job, overrides=overrides)
        for name in plan.layout.names:
            assert np.array_equal(plan[name], np.concatenate([block[name] for block in self.blocks])), name
        replayed = client.replay(run)
        assert replayed.identical and self.end.digest in ("", replayed.digest)


def monitored(client, program=SLOT):
    job = client.submit(program, machine="mill").wait(60)
    job.set_monitoring(MONITORING)
    return job


def test_a_run_survives_kills_and_everything_is_heard_once(own_server):
    sensor, heard, kills = Sensor(), Heard(), 0
    with own_server.connect() as client:
        job = monitored(client)
        with job.run(ahead_s=0.0) as run:
            assert run.state == "BASELINE" and run.period_us == 1000.0
            run.send(**sensor.idle())
            run.flush()
            run.ahead_s = 0.2
            for count, event in enumerate(run):
                heard.take(event)
                if isinstance(event, feedwave.Setpoints):
                    run.send(**sensor.along(event))
                if count in (5, 20, 21, 60, 130):
                    own_server.kill()
                    own_server.start()
                    kills += 1
        assert kills == 5 and len(heard.decisions) > 10 and len(heard.changes) > 3
        assert any(change.cause == "DECISION" for change in heard.changes)
        heard.is_proved_by(client, job, run.name)
    own_server.end()


@pytest.mark.parametrize("stop", ["kill", "end"])
def test_asyncio_runs_survive_kills_and_restarts(own_server, stop):
    sensor, heard = Sensor(), Heard()

    def restart():
        getattr(own_server, stop)()
        own_server.start()

    async def scene(job):
        async with feedwave.aio.connect(own_server.ports["grpc"]) as client, client.run(job, ahead_s=0.0) as run:
            await run.send(**sensor.idle())
            await run.flush()
            run.ahead_s = 0.2
            count = 0
            async for event in run:
                heard.take(event)
                if isinstance(event, feedwave.Setpoints):
                    await run.send(**sensor.along(event))
                count += 1
                if count in (10, 40):
                    await asyncio.to_thread(restart)
            assert count > 40
            return run.name

    with own_server.connect() as client:
        job = monitored(client)
        heard.is_proved_by(client, job, asyncio.run(scene(job.name)))
    own_server.end()


def test_asyncio_runs_go_on_where_who_waits_is_cancelled(server, client, monkeypatch):
    sensor, heard = Sensor(), Heard()
    opened = []
    transport = feedwave.aio.transport.Transport
    open_stream = transport._open
    monkeypatch.setattr(transport, "_open", lambda self, operation: opened.append(operation.method) or open_stream(self, operation))

    async def scene(job):
        async with feedwave.aio.connect(server.ports["grpc"]) as connected, connected.run(job, ahead_s=0.0) as run:
            await run.send(**sensor.idle())
            await run.flush()
            run.ahead_s = 0.2
            cancelled = 0
            while True:
                waiting = asyncio.ensure_future(anext(run))
                # One round of the loop: hardly ever enough for an answer of the service.
                await asyncio.sleep(0)
                if not waiting.done() and cancelled < 2_000:
                    waiting.cancel()
                    cancelled += 1
                    await asyncio.gather(waiting, return_exceptions=True)
                    await asyncio.sleep(0)
                    continue
                try:
                    event = await waiting
                except StopAsyncIteration:
                    break
                heard.take(event)
                if isinstance(event, feedwave.Setpoints):
                    await run.send(**sensor.along(event))
            return run.name, cancelled

    job = monitored(client)
    name, cancelled = asyncio.run(scene(job.name))
    assert cancelled == 2_000 and len(opened) == 1, opened
    heard.is_proved_by(client, job, name)


def test_telemetry_alone_survives_kills(own_server):
    sensor, heard = Sensor(), Heard()
    with own_server.connect() as client:
        job = monitored(client)
        with client.ingest(job) as telemetry:
            telemetry.send(**sensor.idle(), events=[{"tool": 3}, {"rebaseline": True}])
            telemetry.flush()
            assert telemetry.state == "WAITING_FOR_CONTACT"
            for count in range(40):
                telemetry.send(**sensor.samples(np.full(50, 0.02)))
                for event in telemetry.heard():
                    heard.take(event)
                if count in (10, 25):
                    own_server.kill()
                    own_server.start()
                    telemetry.flush()
            assert telemetry.feed < 1.0
            telemetry.finish()
            for event in telemetry:
                heard.take(event)
        assert heard.end.state == "FINISHED" and len(heard.decisions) > 15
        assert [one.proto for one in client.decisions(telemetry.name)] == [one.proto for one in heard.decisions]
        assert {one.proto.tool for one in heard.decisions} == {3} and client.replay(telemetry.name).identical
    own_server.end()


def test_telemetry_alone_is_taken_up(server, client):
    job, sensor = monitored(client), Sensor()

    async def scene(run):
        async with feedwave.aio.connect(server.ports["grpc"]) as other, other.take_up_ingest(run, decided=1) as telemetry:
            for _ in range(10):
                await telemetry.send(**sensor.samples(np.full(50, 0.02)))
            telemetry.finish()
            return [event async for event in telemetry]

    with client.ingest(job) as telemetry:
        telemetry.send(**sensor.idle())
        telemetry.flush()
        assert [event.number for event in telemetry.heard() if isinstance(event, feedwave.Decision)] == [0]
    events = asyncio.run(scene(telemetry.name))
    numbers = [event.number for event in events if isinstance(event, feedwave.Decision)]
    assert numbers == list(range(1, len(numbers) + 1)) and len(numbers) >= 3
    assert isinstance(events[-1], feedwave.Ended) and events[-1].state == "FINISHED"
    with pytest.raises(feedwave.SourceError, match="shape"):
        telemetry.send(np.arange(3), tool=(np.zeros(3), np.zeros(2)))


def test_telemetry_may_come_from_another_thread(client):
    job, sensor, heard = monitored(client), Sensor(), Heard()
    with job.run(ahead_s=0.0) as run:
        def pour():
            # What it waits for comes to the other thread, which waits for setpoints meanwhile.
            for _ in range(10):
                run.send(**sensor.idle())
                run.flush()
            run.ahead_s = 0.1

        sender = threading.Thread(target=pour)
        sender.start()
        for event in run:
            heard.take(event)
        sender.join()
    heard.is_proved_by(client, job, run.name)


def test_telemetry_may_come_from_another_task(server, client):
    job, sensor, heard = monitored(client), Sensor(), Heard()

    async def scene():
        async with feedwave.aio.connect(server.ports["grpc"]) as other, other.run(job.name, ahead_s=0.0) as run:
            async def pour():
                for _ in range(10):
                    await run.send(**sensor.idle())
                    await run.flush()
                run.ahead_s = 0.1

            pouring = asyncio.create_task(pour())
            async for event in run:
                heard.take(event)
            await pouring
            return run.name

    heard.is_proved_by(client, job, asyncio.run(scene()))


def test_the_operator_holds_resumes_and_aborts(client):
    job = monitored(client)
    with job.run() as run:
        events = iter(run)
        causes = []
        commands = {200: run.hold, 600: run.resume, 900: run.abort}
        for event in events:
            if isinstance(event, feedwave.FeedChange):
                causes.append(event.cause)
                assert run.held == (event.cause != "RESUME" and "RESUME" not in causes)
            for index in [index for index in commands if run.taken >= index]:
                commands.pop(index)()
        assert causes == ["HOLD", "RESUME", "ABORT"]
        assert run.ended is not None and run.ended.state == "ABORTED"
        assert next(events, None) is None
    assert client.run_info(run.name).state == telemetry_pb2.RUN_STATE_ABORTED


def test_a_held_feed_is_acknowledged_and_resumed(client):
    job, sensor = client.submit(SLOT, machine="mill").wait(60), Sensor()
    escalating = {"feed": {"lower": 0.003, "upper": 0.01, "step": 0.5}, "feed_bounds": {"lower": 0.5, "upper": 1.5}, "escalation": {"windows": 2}}
    job.set_monitoring({**MONITORING, "rules": escalating})
    told = []
    # Too far however slow it is, until somebody looks at the tool.
    bent_mm = 0.02
    with job.run(ahead_s=0.0) as run:
        run.send(**sensor.idle())
        run.flush()
        run.ahead_s = 0.1
        for event in run:
            if isinstance(event, feedwave.Setpoints):
                run.send(**sensor.samples(np.where(event.line == 3, bent_mm, 0.0)))
                continue
            if not isinstance(event, feedwave.Acknowledged):
                told.append(event)
            if isinstance(event, feedwave.FeedChange) and event.cause == "ESCALATION":
                assert run.feed_held and event.ratio == 0.0
                run.resume()
            elif isinstance(event, feedwave.Refused):
                assert (event.command, event.reason) == ("RESUME", "CONDITION_NOT_ACKNOWLEDGED") and run.feed_held
                bent_mm = 0.005
                condition = client.acknowledge(run.name, by="who minds the machine", note="tool looked at")
                assert condition.acknowledged_by == "who minds the machine"
                run.resume()
            elif isinstance(event, feedwave.FeedChange) and event.cause == "RESUME":
                assert not run.feed_held and event.ratio == 0.5
                run.abort()
    actions = [event.action for event in told if isinstance(event, feedwave.Decision)]
    assert "HOLD_FEED" in actions and told[-1].state == "ABORTED"
    info = client.run_info(run.name)
    assert info.open_conditions == 0 and len(info.conditions) == 1
    # The same decisions are watched from the log, each once.
    watched = list(itertools.islice(client.watch_decisions(run.name, after=0), len(actions)))
    assert [decision.number for decision in watched] == list(range(len(actions)))


def test_closing_a_run_ends_who_waits_for_it(client):
    run = monitored(client).run(ahead_s=0.0)
    threading.Thread(target=run.close).start()
    with pytest.raises(feedwave.Cancelled):
        next(run)
    assert client.run_info(run.name).state == telemetry_pb2.RUN_STATE_OPEN


def test_a_run_is_taken_up_by_another_process(server, client):
    job, heard = monitored(client), Heard()
    run = job.run()
    for event in run:
        heard.take(event)
        if heard.taken >= 500:
            break
    # Only the latest client of a run can write to it; the one before is told.
    with server.connect() as other, other.take_up(run.name, start=heard.taken, decided=len(heard.decisions)) as again:
        with pytest.raises(feedwave.Aborted) as caught:
            for _ in run:
                pass
        assert caught.value.details.metadata["run"] == run.name
        for event in again:
            heard.take(event)
    heard.is_proved_by(client, job, run.name)


def test_the_end_of_a_run_is_heard_of_late(client):
    job, heard, late = monitored(client), Heard(), Heard()
    with job.run() as run:
        for event in run:
            heard.take(event)
    # As after a connection that broke between the last receipt and its answer.
    with client.take_up(run.name, start=heard.taken) as again:
        late.blocks = heard.blocks
        for event in again:
            late.take(event)
    assert (late.end.state, late.end.setpoint_count) == (heard.end.state, heard.end.setpoint_count)
    assert [one.proto for one in late.decisions] == [one.proto for one in heard.decisions]


def test_a_stream_goes_on_where_it_broke(own_server):
    # Larger than what is on its way at any time.
    program = "G21 G90 G94 G17 S3000 M3\nG0 X10 Y0 Z0\nG4 X300.\nG1 X20 F1200\nM30\n"
    with own_server.connect() as client:
        job = client.submit(program, machine="mill").wait(60)
        whole = job.setpoints()
        batches = []
        for place, batch in enumerate(job.batches()):
            batches.append(batch)
            if place in (3, 8):
                own_server.kill()
                own_server.start()
        assert np.array_equal(np.concatenate([batch["X_mm"] for batch in batches]), whole["X_mm"])
        assert batches[-1].end_index == whole.count
    own_server.end()


def test_an_upload_goes_on_where_it_broke(own_server):
    class Watched(feedwave.Program):
        """A program during whose upload the service is killed once."""

        offsets = []

        def pieces(self, offset=0):
            self.offsets.append(offset)
            for count, piece in enumerate(super().pieces(offset)):
                # The first time it is read for its name.
                if len(self.offsets) == 2 and count == 8:
                    own_server.kill()
                    own_server.start()
                yield piece

    program = Watched("G21 G90 G94 G17 S3000 M3\n" + "G1 X10 F1200\nG1 X20\n" * 200_000 + "M30\n", "long.nc")
    with own_server.connect() as client:
        job = client.submit(program, machine="mill")
        assert job.proto.program_bytes == program.size and job.proto.program == f"programs/{program.sha256()}"
        assert len(program.offsets) >= 3
        job.cancel()
    own_server.end()


def test_calls_wait_for_the_service_and_give_up(own_server):
    with own_server.connect() as client, own_server.connect(retries=feedwave.Retries(give_up_after_s=0.0)) as hasty:
        assert list(client.jobs()) == []
        own_server.kill()
        with pytest.raises(feedwave.Unavailable) as caught:
            list(hasty.jobs())
        assert caught.value.code is grpc.StatusCode.UNAVAILABLE and isinstance(caught.value, ConnectionError)
        starting = threading.Thread(target=own_server.start)
        starting.start()
        assert list(client.jobs()) == []
        starting.join()
    own_server.end()


def attempts(retries, *outcomes):
    """Pauses between attempts that end like this, and what comes out."""
    pauses, left = [], iter(outcomes)

    def attempt():
        outcome = next(left)
        if isinstance(outcome, Exception):
            raise outcome
        return outcome
        yield

    flow = _flow.retried(retries, attempt)
    operation = None
    try:
        while True:
            operation = next(flow)
            assert isinstance(operation, _flow.Sleep)
            pauses.append(operation.seconds)
    except StopIteration as end:
        return pauses, end.value


def test_pauses_are_random_and_never_shorter_than_told():
    retries = feedwave.Retries(give_up_after_s=1e9, first_pause_s=0.1, longest_pause_s=0.4)
    lost = errors.Unavailable("gone")
    pauses, result = attempts(retries, *itertools.repeat(lost, 40), "here")
    assert result == "here" and len(pauses) == 40 and len(set(pauses)) > 20
    assert all(0.0 <= pause <= 0.4 for pause in pauses) and pauses[0] <= 0.1
    told = errors.ResourceExhausted("busy", details=errors.Details(domain="feedwave", retry_after_s=3.0))
    pauses, _ = attempts(retries, told, told, "here")
    assert all(3.0 <= pause <= 3.4 for pause in pauses)


@pytest.mark.parametrize(
    "error",
    [
        errors.ResourceExhausted("too large", details=errors.Details(domain="feedwave")),
        errors.InvalidArgument("wrong", details=errors.Details(domain="feedwave")),
        errors.Internal("a fault", details=errors.Details(domain="feedwave")),
        # Of this side, and of something between that is no such service.
        errors.Unknown("Exception iterating requests!"),
        errors.Internal("Exception serializing request!"),
        errors.Internal("Invalid metadata"),
        errors.Cancelled("Channel closed!"),
        errors.Unknown("no message"),
        errors.Aborted("taken up elsewhere"),
    ],
)
def test_what_does_not_pass_is_not_tried_again(error):
    with pytest.raises(type(error)):
        attempts(feedwave.Retries(), error, "here")


@pytest.mark.parametrize(
    "error",
    [
        errors.Unavailable("Socket closed"),
        errors.Unknown("Stream removed"),
        errors.Internal("RST_STREAM (Received RST_STREAM with error code 2)"),
        errors.Internal("Internal error from Core"),
        errors.Cancelled("Received RST_STREAM with error code 8"),
        errors.Unknown("GOAWAY received"),
        errors.ResourceExhausted("busy", details=errors.Details(domain="feedwave", retry_after_s=0.0)),
    ],
)
def test_a_connection_that_breaks_is_made_again(error):
    pauses, result = attempts(feedwave.Retries(), error, "here")
    assert result == "here" and len(pauses) == 1


def test_attempts_end_in_time():
    with pytest.raises(feedwave.Unavailable):
        attempts(feedwave.Retries(give_up_after_s=0.0), errors.Unavailable("gone"), "here")
