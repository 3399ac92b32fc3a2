"""The OpenAPI document, held against what the service really answers."""

import json
import urllib.error
import urllib.request

import jsonschema
import numpy as np
import openapi_spec_validator
import pytest

from conftest import FIXTURES
from test_package_runs import MONITORING, SLOT, Sensor


def get(server, path):
    """Status and body of a path."""
    try:
        with urllib.request.urlopen(f"http://{server.ports['http']}{path}", timeout=60) as answer:
            return answer.status, answer.read().decode()
    except urllib.error.HTTPError as error:
        return error.code, error.read().decode()


@pytest.fixture(scope="module")
def document(server):
    status, body = get(server, "/v1/openapi.json")
    assert status == 200
    return json.loads(body)


@pytest.fixture(scope="module")
def strict(document):
    """The document where no object has a member that its schema does not name."""
    for schema in document["components"]["schemas"].values():
        if "properties" in schema:
            schema["additionalProperties"] = False
    return document


def holds(document, entry, status, body):
    """That an answer is what the document says of the path."""
    responses = document["paths"][entry]["get"]["responses"]
    response = responses.get(str(status), responses["default"])
    if "$ref" in response:
        response = document["components"]["responses"][response["$ref"].rsplit("/", 1)[1]]
    media_type, content = next(iter(response["content"].items()))
    if media_type == "application/json":
        schema = {**content["schema"], "components": document["components"]}
        jsonschema.validate(json.loads(body), schema, cls=jsonschema.Draft202012Validator)


def finished_run(client):
    """A live run with decisions, to its end."""
    job, sensor = client.submit(SLOT, machine="mill").wait(60), Sensor()
    job.set_monitoring(MONITORING)
    with job.run(ahead_s=0.0) as run:
        run.send(**sensor.idle())
        run.flush()
        run.ahead_s = 0.2
        for block in run:
            if hasattr(block, "first_index"):
                run.send(**sensor.samples(np.where(block.line == 3, 0.005, 0.0)))
        return run.name


def test_the_document_is_valid(document):
    openapi_spec_validator.validate(document)


def test_every_answer_is_what_the_document_says(server, client, strict):
    programs = sorted(FIXTURES.rglob("*.nc"))
    assert len(programs) > 20
    jobs = [client.submit(program, machine=machine) for program in programs for machine in ("lathe", "mill")]
    reports = [job.wait(120).name for job in jobs]
    run = finished_run(client)
    program = client.job(reports[0]).proto.program
    ids = {
        "/v1/jobs/{id}": reports,
        "/v1/jobs/{id}/report": reports,
        "/v1/runs/{id}": [run],
        "/v1/machines/{id}/state": ["machines/mill"],
        "/v1/programs/{id}": [program],
    }
    for entry in strict["paths"]:
        if entry == "/v1/stream":
            continue
        names = ids[entry] if "{id}" in entry else [""]
        for name in names:
            status, body = get(server, entry.replace("{id}", name.rpartition("/")[2]))
            assert status == 200, (entry, name, body)
            holds(strict, entry, status, body)
        if "{id}" in entry:
            missing = "0" * 64 if "programs" in entry else "00000000-0000-7000-8000-000000000000"
            status, body = get(server, entry.replace("{id}", missing))
            assert status in (400, 404), (entry, body)
            holds(strict, entry, status, body)
        status, body = get(server, entry.replace("{id}", names[0].rpartition("/")[2]) + "?pageSize=x&offset=x")
        if status == 400:
            holds(strict, entry, status, body)


def test_lists_take_the_parameters_that_the_document_names(server, document):
    for entry, item in document["paths"].items():
        for parameter in item["get"]["parameters"]:
            if parameter.get("in") == "query" and "{id}" not in entry:
                value = "" if parameter["schema"]["type"] != "array" else "READY"
                status, body = get(server, f"{entry}?{parameter['name']}={value}")
                assert status == 200, (entry, parameter, body)
