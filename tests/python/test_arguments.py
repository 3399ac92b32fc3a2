"""Arguments that cannot be meant are refused by name before anything is sent: there is no service behind these clients."""

import asyncio

import pytest

import feedwave
import feedwave.aio

NOWHERE = "127.0.0.1:1"
SHORT = "M30\n"


@pytest.fixture
def nobody():
    """A client that would wait for its service for ever."""
    with feedwave.connect(NOWHERE, retries=feedwave.Retries(give_up_after_s=1e9)) as client:
        yield client


def refused(client, method, *arguments, **options):
    """What a method of a synchronous or asynchronous client refuses with, when it is called."""
    with pytest.raises((TypeError, feedwave.SourceError)) as caught:
        outcome = getattr(client, method)(*arguments, **options)
        if asyncio.iscoroutine(outcome):
            outcome.send(None)
    return caught.value


STREAM = [
    ({"override": [(2.0, 0.5)]}, TypeError, "unexpected keyword argument 'override': did you mean 'overrides'?"),
    ({"cnt": 3}, TypeError, "unexpected keyword argument 'cnt': did you mean 'count'?"),
    # Like none of them: all are named.
    ({"from_time": 2.0}, TypeError, "'from_time': there are batch, columns, count, encoding, frame, "),
    ({"start": -1}, feedwave.SourceError, "start is -1, and must be from 0 to "),
    ({"start": 1.5}, TypeError, "start: a whole number is wanted, not 1.5"),
    ({"start_time_s": -1.0}, feedwave.SourceError, "start_time_s is -1.0"),
    ({"start_time_s": "2"}, TypeError, "start_time_s: a number is wanted, not '2'"),
    ({"start": 0, "start_time_s": 0.0}, feedwave.SourceError, "either at a setpoint or at a time"),
    ({"count": -2}, feedwave.SourceError, "count is -2"),
    ({"batch": 1 << 32}, feedwave.SourceError, "batch is 4294967296, and must be from 0 to 4294967295"),
    ({"interpolation_period_us": -1}, feedwave.SourceError, "interpolation_period_us is -1"),
    ({"overrides": (2.0, 0.5)}, feedwave.SourceError, "overrides: 2.0 is neither an Override nor a pair"),
    ({"columns": "FEED"}, TypeError, "columns: several are wanted, as in a list, not 'FEED'"),
    ({"frame": 3}, TypeError, "the name of a Frame is wanted"),
]
RUN = [
    ("run", {"ahead": 1.0}, TypeError, "unexpected keyword argument 'ahead': did you mean 'ahead_s'?"),
    ("run", {"ahead_s": -1.0}, feedwave.SourceError, "ahead_s is -1.0"),
    ("run", {"interpolation_period_us": -1}, feedwave.SourceError, "interpolation_period_us is -1"),
    ("take_up", {"strat": 3}, TypeError, "unexpected keyword argument 'strat': did you mean 'start'?"),
    ("take_up", {"start": -3}, feedwave.SourceError, "start is -3"),
    ("take_up", {"decided": -3}, feedwave.SourceError, "decided is -3"),
]
PROGRAM = [
    ({"settings": {"interpolation_period_us": 1000}}, TypeError, "settings: feedwave.Settings(…) is wanted, not dict"),
    ({"settings": feedwave.Settings(interpolation_period_us=-5)}, feedwave.SourceError, "settings.interpolation_period_us is -5"),
    ({"tools": "T1"}, TypeError, "tools: several are wanted, as in a list, not 'T1'"),
    ({"files": "O1.nc"}, TypeError, "files: several are wanted, as in a list, not 'O1.nc'"),
]
CALLS = [
    *(("setpoints", ("jobs/x",), *case) for case in STREAM),
    *(("batches", ("jobs/x",), *case) for case in STREAM),
    *((method, ("x",), *case) for method, *case in RUN),
    *((method, (SHORT,), {"machine": "mill", **options}, *case) for method in ("validate", "improve", "submit") for options, *case in PROGRAM),
]


@pytest.mark.parametrize(("method", "arguments", "options", "kind", "told"), CALLS)
def test_what_cannot_be_meant_is_refused_by_name(nobody, method, arguments, options, kind, told):
    error = refused(nobody, method, *arguments, **options)
    assert isinstance(error, kind) and told in str(error)

    async def scene():
        async with feedwave.aio.connect(NOWHERE) as client:
            return refused(client, method, *arguments, **options)

    twin = asyncio.run(scene())
    assert (type(twin), str(twin)) == (type(error), str(error))


def test_an_option_that_is_none_is_as_without_it():
    from feedwave._requests import stream_request

    keys = feedwave.StreamOptions.__optional_keys__
    assert stream_request(dict.fromkeys(keys)) == stream_request({})


@pytest.mark.parametrize("address", ["http://", "http://host:port/x", "http://host:1/x", "host", "host:70000", "who@host:1", "http://a b:1", "ftp://host:1", "host:0"])
def test_an_address_that_is_none_is_refused(address):
    for connect in (feedwave.connect, feedwave.aio.connect):
        with pytest.raises(feedwave.SourceError, match="the address is HOST:PORT, http://HOST:PORT or https://HOST:PORT"):
            connect(address)


def test_addresses_are_those_of_the_commands():
    from feedwave._connection import target

    def place(address):
        found = target(address, None, None, None, None, None, None)
        return found.address, found.credentials is not None

    assert place("host:1") == place("http://host:1/") == ("host:1", False)
    assert place("http://host") == ("host:80", False) and place("https://host") == ("host:443", True)
    assert place("[::1]:5") == place("http://[::1]:5") == ("[::1]:5", False)


def test_a_token_is_what_a_header_can_carry():
    from feedwave._connection import target

    def metadata(token, tenant=None):
        return target(NOWHERE, token, tenant, None, None, None, None).metadata

    # As `feedwave token … > p.tok` writes it.
    assert metadata("secret\n") == metadata(" secret\r\n") == (("authorization", "Bearer secret"),)
    for wrong, told in [("sec\nret", r"character 4 is U\+000A"), ("sécret", r"character 2 is U\+00E9"), (" \n", "nothing but white space")]:
        with pytest.raises(feedwave.SourceError, match=f"^token: .*{told}") as caught:
            metadata(wrong)
        assert wrong not in str(caught.value)
        with pytest.raises(feedwave.SourceError, match="^tenant: "):
            metadata("secret", wrong)
    with pytest.raises(TypeError, match="^token: a str is wanted, not bytes"):
        metadata(b"secret")


def test_a_program_that_no_request_can_carry_is_refused_unread(nobody, tmp_path, monkeypatch):
    path = tmp_path / "large.nc"
    with open(path, "wb") as file:
        # No blocks of the disk: there is nothing in it.
        file.truncate(3 << 30)
    monkeypatch.setattr(feedwave.Program, "read", lambda program: pytest.fail("it was read"))
    uploaded = r"more than the 268435456 that a request can have: client\.submit\(…\)\.wait\(\)\.report\(\)"
    for method, program, files, told in [
        ("validate", path, (), f"large.nc: 3221225472 bytes, {uploaded}"),
        ("validate", SHORT, {"O1.nc": path}, f"3221225476 bytes, {uploaded}"),
        ("improve", path, (), "large.nc: 3221225472 bytes, and at most 67108864 are improved"),
        ("improve", SHORT, {"O1.nc": path}, "3221225476 bytes, more than the 268435456 that a request can have: the command"),
    ]:
        with pytest.raises(feedwave.SourceError, match=told):
            getattr(nobody, method)(program, machine="mill", files=files)
