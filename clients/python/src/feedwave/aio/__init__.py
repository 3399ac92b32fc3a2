"""The same for asyncio: `async with feedwave.aio.connect() as client`, `await client.validate(...)`, `async for batch in job.batches()`."""

from .client import Client, Job, connect
from .run import Run, Telemetry

__all__ = ["Client", "Job", "Run", "Telemetry", "connect"]
