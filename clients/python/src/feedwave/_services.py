"""Flows of further methods: what is decided, machines and tools, lobes and threads."""

from __future__ import annotations

from ._flow import Emit, Flow, Open, Read, Retries, Stream, call, cancelling, pages, retried
from ._names import resource, whole
from ._options import Machine, Said, message_of
from .errors import AlreadyExists, NotFound, ServiceError
from .events import Decision
from .v1 import (
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


def cancel_job(retries: Retries, job: str) -> Flow[jobs_pb2.Job]:
    """Cancels a job."""
    request = jobs_pb2.CancelJobRequest(name=resource("jobs", job))
    response = yield from call(retries, "Jobs/CancelJob", request, jobs_pb2.CancelJobResponse)
    return response.job


def delete_job(retries: Retries, job: str) -> Flow[None]:
    """Deletes a job with its report."""
    request = jobs_pb2.DeleteJobRequest(name=resource("jobs", job))
    tried = 0

    def attempt() -> Flow[None]:
        nonlocal tried
        tried += 1
        try:
            # One attempt: what happened to the others is known here.
            yield from call(Retries(give_up_after_s=0.0), "Jobs/DeleteJob", request, jobs_pb2.DeleteJobResponse)
        except NotFound:
            # An attempt whose answer was lost has deleted it.
            if tried == 1:
                raise

    return retried(retries, attempt)


def plan_summary(retries: Retries, job: str) -> Flow[setpoints_pb2.PlanSummary]:
    """The figures of a job's plan."""
    request = setpoints_pb2.GetPlanSummaryRequest(job=resource("jobs", job))
    response = yield from call(retries, "Setpoints/GetPlanSummary", request, setpoints_pb2.GetPlanSummaryResponse)
    return response.plan_summary


def set_monitoring(retries: Retries, job: str, config: Said[monitoring_pb2.MonitoringConfig]) -> Flow[monitoring_pb2.MonitoringConfig]:
    """Sets how the telemetry of a job is judged."""
    request = telemetry_pb2.SetMonitoringRequest(job=resource("jobs", job), config=message_of(monitoring_pb2.MonitoringConfig, config))
    response = yield from call(retries, "Telemetry/SetMonitoring", request, telemetry_pb2.SetMonitoringResponse)
    return response.config


def get_monitoring(retries: Retries, job: str) -> Flow[monitoring_pb2.MonitoringConfig]:
    """Reads how the telemetry of a job is judged."""
    request = telemetry_pb2.GetMonitoringRequest(job=resource("jobs", job))
    response = yield from call(retries, "Telemetry/GetMonitoring", request, telemetry_pb2.GetMonitoringResponse)
    return response.config


def _filters(of: str | None) -> dict[str, str]:
    if not of:
        return {}
    return {"run": of} if of.startswith("runs/") else {"job": resource("jobs", of)}


def list_decisions(retries: Retries, of: str | None, after: int) -> Flow[None]:
    """Emits decisions in the order in which they were made."""
    request = telemetry_pb2.ListDecisionsRequest(after=whole("after", after), page_size=500, **_filters(of))
    decisions = telemetry_pb2.ListDecisionsResponse
    return pages(retries, "Telemetry/ListDecisions", request, decisions, lambda page: map(Decision.of, page.decisions))


def watch_decisions(retries: Retries, of: str | None, after: int | None) -> Flow[None]:
    """Emits decisions as they become durable, each once."""
    request = telemetry_pb2.WatchDecisionsRequest(after=None if after is None else whole("after", after), **_filters(of))

    def watch() -> Flow[None]:
        stream: Stream = yield Open("Telemetry/WatchDecisions", request, telemetry_pb2.WatchDecisionsResponse.FromString)
        began = False
        with cancelling(stream):
            try:
                while message := (yield Read(stream)):
                    began, request.after = True, message.decision.sequence
                    yield Emit(Decision.of(message.decision))
            except ServiceError as error:
                if not (began and error.is_passing):
                    raise

    while True:
        yield from retried(retries, watch)


def get_run(retries: Retries, run: str) -> Flow[telemetry_pb2.Run]:
    """Reads a run."""
    request = telemetry_pb2.GetRunRequest(name=resource("runs", run))
    response = yield from call(retries, "Telemetry/GetRun", request, telemetry_pb2.GetRunResponse)
    return response.run


def acknowledge(retries: Retries, run: str, by: str, note: str, decision_number: int | None) -> Flow[telemetry_pb2.RunCondition]:
    """Acknowledges a condition of a run."""
    request = telemetry_pb2.AcknowledgeConditionRequest(
        run=resource("runs", run), acknowledged_by=by, note=note, decision_number=decision_number
    )
    response = yield from call(retries, "Telemetry/AcknowledgeCondition", request, telemetry_pb2.AcknowledgeConditionResponse)
    return response.condition


def replay(retries: Retries, run: str) -> Flow[runs_pb2.ReplayRunResponse]:
    """Makes a run again from its log."""
    request = runs_pb2.ReplayRunRequest(run=resource("runs", run))
    response = yield from call(retries, "Runs/ReplayRun", request, runs_pb2.ReplayRunResponse)
    return response


def list_machines(retries: Retries) -> Flow[None]:
    """Emits the machines in the order of their names."""
    request = machines_pb2.ListMachinesRequest(page_size=500)
    return pages(retries, "Machines/ListMachines", request, machines_pb2.ListMachinesResponse, lambda page: page.machines)


def list_tools(retries: Retries) -> Flow[None]:
    """Emits the tools in the order of their names."""
    request = tools_pb2.ListToolsRequest(page_size=500)
    return pages(retries, "Tools/ListTools", request, tools_pb2.ListToolsResponse, lambda page: page.tools)


def profile(retries: Retries, machine: str) -> Flow[machines_pb2.MachineProfile]:
    """Reads the profile of a machine."""
    request = machines_pb2.GetMachineRequest(name=resource("machines", machine))
    response = yield from call(retries, "Machines/GetMachine", request, machines_pb2.GetMachineResponse)
    return response.machine.profile


def put_machine(retries: Retries, name: str, given: Said[machines_pb2.MachineProfile]) -> Flow[machines_pb2.Machine]:
    """Adds a machine, or replaces the profile of one."""
    machine = machines_pb2.Machine(
        name=resource("machines", name), profile=message_of(machines_pb2.MachineProfile, given)
    )
    create = machines_pb2.CreateMachineRequest(machine_id=machine.name.partition("/")[2], machine=machine)
    try:
        created = yield from call(retries, "Machines/CreateMachine", create, machines_pb2.CreateMachineResponse)
    except AlreadyExists:
        update = machines_pb2.UpdateMachineRequest(machine=machine, update_mask={"paths": ["profile"]})
        updated = yield from call(retries, "Machines/UpdateMachine", update, machines_pb2.UpdateMachineResponse)
        return updated.machine
    return created.machine


def put_tool(retries: Retries, given: Said[tools_pb2.Tool]) -> Flow[tools_pb2.Tool]:
    """Adds a tool, or replaces one."""
    tool = tools_pb2.Tool()
    tool.CopyFrom(message_of(tools_pb2.Tool, given))
    tool.name = resource("tools", tool.name)
    create = tools_pb2.CreateToolRequest(tool_id=tool.name.partition("/")[2], tool=tool)
    try:
        created = yield from call(retries, "Tools/CreateTool", create, tools_pb2.CreateToolResponse)
    except AlreadyExists:
        update = tools_pb2.UpdateToolRequest(tool=tool, update_mask={"paths": ["*"]})
        updated = yield from call(retries, "Tools/UpdateTool", update, tools_pb2.UpdateToolResponse)
        return updated.tool
    return created.tool


def lobes(
    retries: Retries, model: Said[stability_pb2.StabilityModel], search: Said[stability_pb2.PocketSearch], chart_speeds: int | None
) -> Flow[lobes_pb2.StabilityLobes]:
    """Computes stability lobes."""
    request = tools_pb2.ComputeStabilityLobesRequest(
        model=message_of(stability_pb2.StabilityModel, model),
        search=message_of(stability_pb2.PocketSearch, search),
        chart_speeds=chart_speeds,
    )
    response = yield from call(retries, "Tools/ComputeStabilityLobes", request, tools_pb2.ComputeStabilityLobesResponse)
    return response.lobes


def learn(retries: Retries, source: Said[learning_pb2.LearningSource]) -> Flow[learning_pb2.ToolProposal]:
    """Learns from runs."""
    request = learning_pb2.ComputeToolProposalRequest(source=message_of(learning_pb2.LearningSource, source))
    response = yield from call(retries, "Tools/ComputeToolProposal", request, learning_pb2.ComputeToolProposalResponse)
    return response.proposal


def adopt(retries: Retries, source: Said[learning_pb2.LearningSource], digest: str) -> Flow[tools_pb2.Tool]:
    """Writes what was learnt into the tool."""
    request = learning_pb2.AdoptToolProposalRequest(source=message_of(learning_pb2.LearningSource, source), digest=digest)
    response = yield from call(retries, "Tools/AdoptToolProposal", request, tools_pb2.AdoptToolProposalResponse)
    return response.tool


def plan_thread(retries: Retries, machine: Machine, request: Said[threads_pb2.PlanThreadRequest]) -> Flow[threads_pb2.PlanThreadResponse]:
    """Plans a thread."""
    planned = threads_pb2.PlanThreadRequest()
    planned.CopyFrom(message_of(threads_pb2.PlanThreadRequest, request))
    if isinstance(machine, str):
        planned.machine = resource("machines", machine)
    else:
        planned.profile.CopyFrom(message_of(machines_pb2.MachineProfile, machine))
    response = yield from call(retries, "Threads/PlanThread", planned, threads_pb2.PlanThreadResponse)
    return response
