"""Where the service is, how the connection to it is encrypted, and who asks."""

from __future__ import annotations

import os
import pathlib
import re
from dataclasses import dataclass
from typing import TypeAlias
from urllib.parse import urlsplit

import grpc

from .errors import SourceError

Pem: TypeAlias = "str | os.PathLike[str] | bytes"
"""Certificates or a key: the path of a PEM file, or its bytes."""

DEFAULT_ADDRESS = "127.0.0.1:50051"

# Largest message that is accepted, as by the commands (a long report is one message), and that a service can be told to accept.
MAX_MESSAGE_BYTES = 256 << 20
# How often the other side is asked for a sign of life, and how long it may take, ms.
_KEEPALIVE_MS, _KEEPALIVE_TIMEOUT_MS = 20_000, 20_000


@dataclass(frozen=True)
class Target:
    """A connection to make."""

    address: str
    credentials: grpc.ChannelCredentials | None
    metadata: tuple[tuple[str, str], ...]
    options: tuple[tuple[str, str | int], ...]


def target(
    address: str | None,
    token: str | None,
    tenant: str | None,
    ca: Pem | None,
    cert: Pem | None,
    key: Pem | None,
    domain: str | None,
) -> Target:
    """What is meant by the arguments of `connect`; what is not given comes from the environment, as for the commands.

    Raises:
        SourceError: for an address that is none, arguments that contradict each other, and what no header can carry.
    """
    given = address or os.environ.get("FEEDWAVE_SERVER") or DEFAULT_ADDRESS
    scheme, place = _place(given)
    authorities, chain, private = _pem(ca, "FEEDWAVE_CA"), _pem(cert, "FEEDWAVE_CERT"), _pem(key, "FEEDWAVE_KEY")
    if (chain is None) != (private is None):
        raise SourceError("a client certificate needs its key, and a key its certificate")
    encrypted = scheme == "https" if scheme else authorities is not None or chain is not None
    if not encrypted and any(one is not None for one in (ca, cert, key)):
        raise SourceError(f"{given}: certificates are for https://, and http:// is not encrypted")
    credentials = grpc.ssl_channel_credentials(authorities, private, chain) if encrypted else None
    options: list[tuple[str, str | int]] = [
        ("grpc.max_receive_message_length", MAX_MESSAGE_BYTES),
        ("grpc.keepalive_time_ms", _KEEPALIVE_MS),
        ("grpc.keepalive_timeout_ms", _KEEPALIVE_TIMEOUT_MS),
        ("grpc.http2.max_pings_without_data", 0),
        # Attempts are counted here, with the pauses that the service asks for.
        ("grpc.enable_retries", 0),
        # After a break the next connection is tried at once, and later not less often than we ask.
        ("grpc.initial_reconnect_backoff_ms", 100),
        ("grpc.max_reconnect_backoff_ms", 1_000),
    ]
    name = domain or os.environ.get("FEEDWAVE_DOMAIN")
    if name and encrypted:
        options.append(("grpc.ssl_target_name_override", name))
    shown, acts_for = token or _environment_token(), tenant or os.environ.get("FEEDWAVE_TENANT")
    metadata = [("authorization", f"Bearer {_header('token', shown)}")] if shown else []
    if acts_for:
        metadata.append(("x-feedwave-tenant", _header("tenant", acts_for)))
    return Target(place, credentials, tuple(metadata), tuple(options))


def _place(given: str) -> tuple[str, str]:
    """The scheme of an address, empty without one, and its `HOST:PORT`; with a scheme the port may be that of the scheme."""
    scheme, separator, rest = given.strip().rpartition("://")
    ports = {"http": 80, "https": 443}
    try:
        parts = urlsplit(f"//{rest.removesuffix('/')}")
        port = ports.get(scheme) if parts.port is None else parts.port
    except ValueError:
        # Such as a port above 65535.
        parts, port = urlsplit(""), None
    host = parts.hostname
    plain = parts.netloc and parts.netloc == rest.removesuffix("/") and "@" not in rest and not re.search(r"\s", rest)
    if (separator and scheme not in ports) or not (plain and host and port):
        raise SourceError(f"{given}: the address is HOST:PORT, http://HOST:PORT or https://HOST:PORT")
    return scheme, f"[{host}]:{port}" if ":" in host else f"{host}:{port}"


def _header(name: str, value: str) -> str:
    """A value as a header carries it: without the line end that a file ends with. It is a secret, and in no message."""
    if not isinstance(value, str):
        raise TypeError(f"{name}: a str is wanted, not {type(value).__name__}")
    stripped = value.strip()
    if not stripped:
        raise SourceError(f"{name}: there is nothing but white space in it")
    wrong = re.search(r"[^\x20-\x7e]", stripped)
    if wrong:
        character = f"its character {wrong.start() + 1} is U+{ord(wrong.group()):04X}"
        raise SourceError(f"{name}: {character}, and a header has printable ASCII characters only")
    return stripped


def _pem(given: Pem | None, variable: str) -> bytes | None:
    if isinstance(given, bytes):
        return given
    path = given or os.environ.get(variable)
    return pathlib.Path(path).read_bytes() if path else None


def _environment_token() -> str | None:
    file = os.environ.get("FEEDWAVE_TOKEN_FILE")
    text = pathlib.Path(file).read_text() if file else os.environ.get("FEEDWAVE_TOKEN", "")
    return text.strip() or None
