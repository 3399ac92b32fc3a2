"""The service as a child process, and channels to it."""

import json
import os
import pathlib
import signal
import subprocess
import time
from types import SimpleNamespace

import grpc
import pytest

from feedwave.v1 import jobs_pb2_grpc, machines_pb2_grpc, setpoints_pb2_grpc


@pytest.fixture(scope="session")
def server(tmp_path_factory):
    """A running service on free ports with an empty database; it must end well."""
    home: pathlib.Path = tmp_path_factory.mktemp("feedwave")
    ready = home / "ready.json"
    environment = {
        "PATH": os.environ["PATH"],
        "FEEDWAVE_GRPC__LISTEN": "127.0.0.1:0",
        "FEEDWAVE_HTTP__LISTEN": "127.0.0.1:0",
        "FEEDWAVE_STORE__URI": f"sqlite://{home}/feedwave.db",
    }
    with open(home / "log.txt", "wb") as log:
        process = subprocess.Popen(
            [os.environ["FEEDWAVE_BINARY"], "serve", "--ready-file", str(ready)],
            env=environment, stdin=subprocess.DEVNULL, stdout=log, stderr=log,
        )
    try:
        for _ in range(6000):
            if ready.exists() or process.poll() is not None:
                break
            time.sleep(0.01)
        assert ready.exists(), (home / "log.txt").read_text()
        yield json.loads(ready.read_text())
        process.send_signal(signal.SIGTERM)
        assert process.wait(timeout=60) == 0, (home / "log.txt").read_text()
    finally:
        process.kill()


@pytest.fixture(scope="session")
def channel(server):
    """A channel as Python programs make it."""
    with grpc.insecure_channel(server["grpc"]) as channel:
        yield channel


@pytest.fixture(scope="session")
def service(channel):
    """The stubs."""
    return SimpleNamespace(
        jobs=jobs_pb2_grpc.JobsStub(channel),
        machines=machines_pb2_grpc.MachinesStub(channel),
        setpoints=setpoints_pb2_grpc.SetpointsStub(channel),
    )
