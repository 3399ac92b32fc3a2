"""The client in an event loop."""

from __future__ import annotations

from collections.abc import AsyncGenerator, AsyncIterator, Callable, Iterable, Mapping
from contextlib import aclosing
from types import TracebackType
from typing import Any, TypeVar

import grpc
import grpc.aio
from google.protobuf.message import Message
from typing_extensions import Self, Unpack

from .. import _requests, _services, improvement
from .._connection import Pem, Target, target
from .._flow import Flow, Retries, call
from .._ingest import Ingest
from .._job import JobInfo, name_of
from .._live import LiveRun
from .._names import resource
from .._options import Machine, RunOptions, Said, Settings, StreamOptions, files_of, tools_of
from .._telemetry import RECONNECT_FOR_S
from ..events import Decision
from ..improvement import Improvement
from ..program import Program, ProgramSource
from ..report import Report
from ..setpoints import Override, Setpoints
from ..v1 import (
    improvement_pb2,
    jobs_pb2,
    learning_pb2,
    lobes_pb2,
    machines_pb2,
    monitoring_pb2,
    runs_pb2,
    setpoints_pb2,
    stability_pb2,
    telemetry_pb2,
    threads_pb2,
    tools_pb2,
)
from .run import Run, Telemetry
from .transport import Transport

T = TypeVar("T")
M = TypeVar("M", bound=Message)


class Client:
    """A service of feedwave. Made by `feedwave.aio.connect`; an asynchronous context manager that closes the connection.

    The twin of `feedwave.Client`, whose methods say more. What cannot be reached for a moment is tried again with growing random pauses, or after the
    time that the service names; every other error is a `feedwave.ServiceError`.
    """

    def __init__(self, target: Target, retries: Retries, timeout_s: float) -> None:
        """A client of `target`; use `feedwave.aio.connect`."""
        options = list(target.options)
        if target.credentials is None:
            channel = grpc.aio.insecure_channel(target.address, options)
        else:
            channel = grpc.aio.secure_channel(target.address, target.credentials, options)
        self._retries = retries
        self._transport = Transport(channel, target.metadata, timeout_s)

    async def close(self) -> None:
        """Closes the connection; calls that are under way end."""
        self._transport.is_closed = True
        await self._transport.channel.close()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        await self.close()

    async def _do(self, make: Callable[..., Flow[T]], *arguments: Any, **options: Any) -> T:
        return await self._transport.run(make(self._retries, *arguments, **options))

    def _each(self, make: Callable[..., Flow[None]], *arguments: Any, **options: Any) -> AsyncGenerator[Any, None]:
        return self._transport.iterate(make(self._retries, *arguments, **options))

    async def call(self, method: str, request: Message, response: type[M]) -> M:
        """Any method of the contract with one request and one response, as in
        `call("Machines/GetMachine", GetMachineRequest(name="machines/lathe"), GetMachineResponse)`, with retries and errors as everywhere."""
        return await self._transport.run(call(self._retries, method, request, response))

    async def validate(
        self,
        program: ProgramSource,
        *,
        machine: Machine,
        tools: Iterable[str] = (),
        files: Mapping[str, ProgramSource] | Iterable[ProgramSource] = (),
        settings: Settings = Settings(),
        overrides: Iterable[Override | tuple[float, float]] = (),
    ) -> Report:
        """Validates a program without storing anything.

        It travels with the request: a service takes up to 1 MiB, further files included, or what `limits.inline_program_bytes` says. A
        larger one is uploaded by `submit(…)`, and `.wait().report()` is its report; that stores a job.

        Args:
            program: a path, or a text of more than one line.
            machine: a machine of the service, `lathe` or `machines/lathe`, or a profile (`load_profile`).
            tools: names of the tools that the program may use; any without them.
            files: further program files, in which calls look for subprograms; with their names, or as paths.
            settings: how it is planned.
            overrides: changes of the feed override; a pair is a time in s and a ratio (1 = programmed).

        Returns:
            What was found. A program full of errors is a report, too: `report.ok` says whether it can be run.

        Raises:
            InvalidArgument, ResourceExhausted: for a program that is too large for this service, with what to do instead.
            SourceError: for one that is too large for any, before it is read.
        """
        further = files_of(files)
        return await self._do(_requests.validate, Program.of(program), machine, tools_of(tools), further, settings, overrides)

    async def improve(
        self,
        program: ProgramSource,
        *,
        machine: Machine,
        tools: Iterable[str] = (),
        files: Mapping[str, ProgramSource] | Iterable[ProgramSource] = (),
        settings: Settings = Settings(),
        goals: Said[improvement_pb2.ImprovementGoals] = {},
        lobes: Said[lobes_pb2.StabilityLobes] | None = None,
        depth_mm: float | None = None,
        depth_tolerance: float | None = None,
    ) -> Improvement:
        """Improves a program: words that make chips break, feeds and tolerances that save time, each with its reason and gain. Nothing is
        stored.

        Args:
            program: at most 64 MiB, and with further files what a request may have, 4 MiB or what `limits.message_bytes` says.
            machine, tools, files: as in `validate`.
            settings: of these offsets matter.
            goals: what is wanted (`feedwave.v1.improvement_pb2.ImprovementGoals`, or a mapping with its fields), such as
                `{"margin": 1.2, "max_feed_per_rev_mm": 0.25}`; defaults without it.
            lobes: lobes of the tool, as `lobes` answers; with `depth_mm`. No speed is changed to one that is not stable, and what is not
                stable gets a speed that is, of those that the goals permit. Without it stability is not judged.
            depth_mm: depth of cut, in turning its width, mm; with `lobes`.
            depth_tolerance: share by which it may be smaller or larger, 0 to 0.5; 0.1 without it.

        Returns:
            What came of it: the program, its changes, and reports before and after.
        """
        options = (Program.of(program), machine, tools_of(tools), files_of(files), settings, improvement.goals_of(goals, lobes, depth_mm, depth_tolerance))
        return await self._do(improvement.improve, *options)

    async def submit(
        self,
        program: ProgramSource,
        *,
        machine: str,
        tools: Iterable[str] = (),
        files: Mapping[str, ProgramSource] | Iterable[ProgramSource] = (),
        settings: Settings = Settings(),
        display_name: str | None = None,
        request_id: str | None = None,
    ) -> Job:
        """Makes a job of a program and returns at once; `job.wait()` waits for its validation.

        Programs of any size: large ones are uploaded in pieces, and go on where a broken upload ended.

        Args:
            program, machine, tools, files, settings: as in `validate`.
            display_name: name for people; the file's without it.
            request_id: submitting again with the same one returns the first job; a new one without it.
        """
        options = (Program.of(program), machine, tools_of(tools), files_of(files), settings, display_name, request_id)
        return Job(self, await self._do(_requests.submit, *options))

    async def job(self, name: str) -> Job:
        """The job of this name, `jobs/…`."""
        return Job(self, await self._do(_requests.get_job, name))

    def jobs(self, *states: str, machine: str | None = None) -> AsyncIterator[Job]:
        """Jobs, newest first: of these states (`READY`), or all; of this machine, or of any."""
        return (Job(self, job) async for job in self._each(_requests.list_jobs, list(states), machine))

    async def setpoints(self, job: str | JobInfo, **options: Unpack[StreamOptions]) -> Setpoints:
        """The setpoints of a job as columns of NumPy, such as `X_mm`, `feed_mm_per_min` and `time_s`.

        Args:
            job: a job that is READY.
            options: which setpoints, columns, overrides: `feedwave.StreamOptions`.

        Raises:
            TypeError: for an option that does not exist.
            SourceError: for a value that cannot be meant.
        """
        return _requests.joined([item async for item in self._each(_requests.stream_setpoints, name_of(job), options)])

    def batches(self, job: str | JobInfo, **options: Unpack[StreamOptions]) -> AsyncIterator[Setpoints]:
        """The same in batches, in bounded memory however long the program is: only what is asked for is read. A connection that breaks is
        taken up where it was."""
        return _batches(self._each(_requests.stream_setpoints, name_of(job), options))

    def run(self, job: str | JobInfo, **options: Unpack[RunOptions]) -> Run:
        """Begins a live run of a job that is READY and has monitoring: a context manager, and an iterator over its events.

        Args:
            job: the job.
            options: how it is made: `feedwave.RunOptions`.
        """
        return Run(self._transport, LiveRun(self._retries, name_of(job), None, 0, 0, options))

    def take_up(self, run: str, *, start: int = 0, decided: int = 0, **options: Unpack[RunOptions]) -> Run:
        """Takes up a run that another process has left open.

        Args:
            run: the run, `runs/…`.
            start: setpoints that the machine has taken.
            decided: decisions that are known already; later ones come as events.
            options: as in `run`; what the run was made with stays.
        """
        return Run(self._transport, LiveRun(self._retries, None, resource("runs", run), start, decided, options))

    def ingest(self, job: str | JobInfo, *, sensor_time_ns: int | None = None, reconnect_for_s: float = RECONNECT_FOR_S) -> Telemetry:
        """Begins to judge telemetry of a job that has monitoring, on a machine that has its setpoints from elsewhere.

        Args:
            job: the job.
            sensor_time_ns: time of the sensors' clock now, ns, so that telemetry that waited is known to be stale.
            reconnect_for_s: time for which it is tried to take the run up again after a break, s.
        """
        return Telemetry(self._transport, Ingest(self._retries, name_of(job), None, 0, reconnect_for_s, sensor_time_ns))

    def take_up_ingest(self, run: str, *, decided: int = 0, reconnect_for_s: float = RECONNECT_FOR_S) -> Telemetry:
        """Takes up telemetry that another process has left open.

        Args:
            run: the run, `runs/…`.
            decided: decisions that are known already; later ones come as events.
            reconnect_for_s: as in `ingest`.
        """
        return Telemetry(self._transport, Ingest(self._retries, None, resource("runs", run), decided, reconnect_for_s, None))

    async def set_monitoring(self, job: str | JobInfo, config: Said[monitoring_pb2.MonitoringConfig]) -> monitoring_pb2.MonitoringConfig:
        """Sets how the telemetry of a job is judged; the answer has every default filled in."""
        return await self._do(_services.set_monitoring, name_of(job), config)

    async def monitoring(self, job: str | JobInfo) -> monitoring_pb2.MonitoringConfig:
        """How the telemetry of a job is judged."""
        return await self._do(_services.get_monitoring, name_of(job))

    def decisions(self, of: str | JobInfo | None = None, *, after: int = 0) -> AsyncIterator[Decision]:
        """Decisions of a run or of a job's runs, or all, in their order; those after a place in the log of all runs."""
        return self._each(_services.list_decisions, name_of(of) if of else None, after)

    def watch_decisions(self, of: str | JobInfo | None = None, *, after: int | None = None) -> AsyncIterator[Decision]:
        """Decisions as they are made, each once; with `after`, those after a place in the log first."""
        return self._each(_services.watch_decisions, name_of(of) if of else None, after)

    async def run_info(self, run: str) -> telemetry_pb2.Run:
        """What is known of a run."""
        return await self._do(_services.get_run, run)

    async def acknowledge(self, run: str, *, by: str, note: str = "", decision_number: int | None = None) -> telemetry_pb2.RunCondition:
        """Acknowledges what holds the feed of a run: the newest condition, or that of a decision.

        Args:
            run: the run, `runs/…`.
            by: who acknowledges, 1 to 200 characters.
            note: anything to be remembered with it.
            decision_number: the decision that raised it.
        """
        return await self._do(_services.acknowledge, run, by, note, decision_number)

    async def replay(self, run: str) -> runs_pb2.ReplayRunResponse:
        """Proves that a run follows from its log, bit for bit."""
        return await self._do(_services.replay, run)

    def machines(self) -> AsyncIterator[machines_pb2.Machine]:
        """The machines of the service, by their names."""
        return self._each(_services.list_machines)

    async def profile(self, machine: str) -> machines_pb2.MachineProfile:
        """The profile of a machine of the service: to be changed, and validated with."""
        return await self._do(_services.profile, machine)

    async def put_machine(self, name: str, profile: Said[machines_pb2.MachineProfile]) -> machines_pb2.Machine:
        """Adds a machine to the service, or replaces the profile of one. Jobs keep the profile that they were made with."""
        return await self._do(_services.put_machine, name, profile)

    async def put_tool(self, tool: Said[tools_pb2.Tool]) -> tools_pb2.Tool:
        """Adds a tool to the service, or replaces the one of its name. Jobs keep the tools that they were made with."""
        return await self._do(_services.put_tool, tool)

    def tools(self) -> AsyncIterator[tools_pb2.Tool]:
        """The tools of the service, by their names."""
        return self._each(_services.list_tools)

    async def lobes(
        self, model: Said[stability_pb2.StabilityModel], search: Said[stability_pb2.PocketSearch], *, chart_speeds: int | None = None
    ) -> lobes_pb2.StabilityLobes:
        """At which spindle speeds (rev/min) a tool cuts how deep (mm) without chatter."""
        return await self._do(_services.lobes, model, search, chart_speeds)

    async def learn(self, source: Said[learning_pb2.LearningSource]) -> learning_pb2.ToolProposal:
        """What the cuts that runs kept say of a tool, with its uncertainty, and what the tool would become. It changes nothing."""
        return await self._do(_services.learn, source)

    async def adopt(self, source: Said[learning_pb2.LearningSource], digest: str) -> tools_pb2.Tool:
        """Writes a proposal of `learn` into its tool, by its digest; the tool as it is then.

        Raises:
            Aborted: when the proposal is another one by now.
        """
        return await self._do(_services.adopt, source, digest)

    async def plan_thread(self, request: Said[threads_pb2.PlanThreadRequest], *, machine: Machine = "lathe") -> threads_pb2.PlanThreadResponse:
        """The passes of a thread whose chip breaks, as data and as a program."""
        return await self._do(_services.plan_thread, machine, request)


class Job(JobInfo):
    """A job: a program on a machine, validated, ready to be streamed. As it last was; `refresh` and `wait` ask again."""

    def __init__(self, client: Client, proto: jobs_pb2.Job) -> None:
        """A job of this client."""
        super().__init__(proto)
        self.client = client

    async def refresh(self) -> Self:
        """Reads it again."""
        self.proto = await self.client._do(_requests.get_job, self.name)
        return self

    async def wait(self, timeout_s: float | None = None) -> Self:
        """Waits until validation has ended, in whatever state. With `timeout_s=0` it only looks.

        Raises:
            DeadlineExceeded: where it has not ended after this time, s; it is a TimeoutError.
        """
        self.proto = await self.client._do(_requests.wait, self.name, timeout_s)
        return self

    async def report(self) -> Report:
        """What validation found."""
        return await self.client._do(_requests.report, self.name)

    async def plan_summary(self) -> setpoints_pb2.PlanSummary:
        """Figures of its plan, and how close each axis comes to its limits."""
        return await self.client._do(_services.plan_summary, self.name)

    async def setpoints(self, **options: Unpack[StreamOptions]) -> Setpoints:
        """Its setpoints; see `Client.setpoints`."""
        return await self.client.setpoints(self, **options)

    def batches(self, **options: Unpack[StreamOptions]) -> AsyncIterator[Setpoints]:
        """Its setpoints in batches; see `Client.batches`."""
        return self.client.batches(self, **options)

    def run(self, **options: Unpack[RunOptions]) -> Run:
        """Begins a live run of it; see `Client.run`."""
        return self.client.run(self, **options)

    async def set_monitoring(self, config: Said[monitoring_pb2.MonitoringConfig]) -> monitoring_pb2.MonitoringConfig:
        """Sets how its telemetry is judged; the answer has every default filled in."""
        return await self.client.set_monitoring(self, config)

    async def cancel(self) -> Self:
        """Cancels it: validation and open streams end, and no new stream starts."""
        self.proto = await self.client._do(_services.cancel_job, self.name)
        return self

    async def delete(self) -> None:
        """Deletes it with its report."""
        await self.client._do(_services.delete_job, self.name)


async def _batches(items: AsyncGenerator[Any, None]) -> AsyncIterator[Setpoints]:
    # Who stops asking ends the stream.
    async with aclosing(items):
        async for item in items:
            if isinstance(item, Setpoints):
                yield item


def connect(
    address: str | None = None,
    *,
    token: str | None = None,
    tenant: str | None = None,
    ca: Pem | None = None,
    cert: Pem | None = None,
    key: Pem | None = None,
    domain: str | None = None,
    retries: Retries = Retries(),
    timeout_s: float = 60.0,
) -> Client:
    """A client of the service at an address. The connection is made with the first call.

    Args:
        address: `HOST:PORT`, `http://HOST:PORT`, or `https://HOST:PORT` for TLS; of `FEEDWAVE_SERVER` without it, or 127.0.0.1:50051. With
            `http` and `https` the port may be left away: it is 80 and 443.
        token: shown with every call, without white space around it; of `FEEDWAVE_TOKEN_FILE` or `FEEDWAVE_TOKEN` without it.
        tenant: to act for, where the client acts for any; of `FEEDWAVE_TENANT` without it, or the client's own.
        ca: certificates that the service must be signed by, PEM; with it the connection is encrypted.
        cert, key: certificate of the client and its key, PEM.
        domain: name that the service's certificate must have, where it differs from the address.
        retries: how often it is tried again what did not come through.
        timeout_s: time for one attempt of a call with one answer, s.

    Raises:
        SourceError: for an address that is none, arguments that contradict each other, and a token that no header can carry.
    """
    return Client(target(address, token, tenant, ca, cert, key, domain), retries, timeout_s)
