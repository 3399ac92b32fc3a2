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

import feedwave
from feedwave.v1 import jobs_pb2_grpc, machines_pb2_grpc, setpoints_pb2_grpc

ROOT = pathlib.Path(__file__).resolve().parents[2]
FIXTURES = ROOT / "tests" / "fixtures"


class Service:
    """A running service on free ports with an empty database."""

    def __init__(self, home: pathlib.Path, **settings: str) -> None:
        """Starts it with these settings besides: `TLS__CERT` is the variable FEEDWAVE_TLS__CERT."""
        self.home, self.settings = home, settings
        self.ports = {"grpc": "127.0.0.1:0", "http": "127.0.0.1:0"}
        self.start()

    def start(self) -> None:
        """Starts it, on the ports that it had before."""
        ready = self.home / "ready.json"
        ready.unlink(missing_ok=True)
        environment = {
            "PATH": os.environ["PATH"],
            "FEEDWAVE_GRPC__LISTEN": self.ports["grpc"],
            "FEEDWAVE_HTTP__LISTEN": self.ports["http"],
            "FEEDWAVE_STORE__URI": f"sqlite://{self.home}/feedwave.db",
            **{f"FEEDWAVE_{name}": value for name, value in self.settings.items()},
        }
        with open(self.home / "log.txt", "ab") as log:
            self.process = subprocess.Popen(
                [os.environ["FEEDWAVE_BINARY"], "serve", "--ready-file", str(ready)],
                env=environment, stdin=subprocess.DEVNULL, stdout=log, stderr=log,
            )
        for _ in range(6000):
            if ready.exists() or self.process.poll() is not None:
                break
            time.sleep(0.01)
        assert ready.exists(), self.log()
        self.ports = json.loads(ready.read_text())

    def log(self) -> str:
        return (self.home / "log.txt").read_text()

    def kill(self) -> None:
        """Kills it (`kill -9`)."""
        self.process.kill()
        self.process.wait()

    def end(self) -> None:
        """Ends it; it must end well."""
        self.process.send_signal(signal.SIGTERM)
        assert self.process.wait(timeout=60) == 0, self.log()

    def connect(self, **options) -> feedwave.Client:
        """A client of it, with patience: a machine that is busy starts it slowly."""
        return feedwave.connect(self.ports["grpc"], **{"retries": feedwave.Retries(give_up_after_s=60.0), **options})


@pytest.fixture(scope="session")
def server(tmp_path_factory):
    """A service for all tests; it must end well."""
    service = Service(tmp_path_factory.mktemp("feedwave"))
    try:
        yield service
        service.end()
    finally:
        service.process.kill()


@pytest.fixture
def own_server(tmp_path):
    """A service for one test, which may kill it."""
    service = Service(tmp_path)
    yield service
    service.process.kill()


@pytest.fixture(scope="session")
def client(server):
    """The package's client."""
    with server.connect() as client:
        yield client


@pytest.fixture(scope="session")
def channel(server):
    """A channel as Python programs make it."""
    with grpc.insecure_channel(server.ports["grpc"]) as channel:
        yield channel


@pytest.fixture(scope="session")
def service(channel):
    """The stubs."""
    return SimpleNamespace(
        jobs=jobs_pb2_grpc.JobsStub(channel),
        machines=machines_pb2_grpc.MachinesStub(channel),
        setpoints=setpoints_pb2_grpc.SetpointsStub(channel),
    )
