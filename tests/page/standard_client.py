"""Reads the MTConnect agent with a client from PyPI that knows nothing of this service; what it read is written as JSON.

    standard_client.py URL read     probe, current and a sample
    standard_client.py URL follow   documents of a streaming sample, until three of them told of something
"""

import contextlib
import json
import sys

from pymtconnect.mtconnect_client import current, probe, sample, stream_sample


def told(document):
    """The header, the events and the conditions of a document, as plain data."""
    header, events, conditions = document
    return {
        "next": header.next_sequence,
        "first": header.first_sequence,
        "events": [event.to_dict() for event in events],
        "conditions": [condition.to_dict() for condition in conditions],
    }


def read(url):
    header, devices = probe(url)
    return {
        "version": header.version,
        "devices": [{"name": device.name, "uuid": device.uuid} for device in devices],
        "current": told(current(url)),
        "sample": told(sample(url, count=5)),
    }


def follow(url):
    documents = []
    for document in stream_sample(url, interval=200, from_seq=1, count=20):
        documents.append(told(document))
        if sum(1 for one in documents if one["events"] or one["conditions"]) >= 3:
            return documents
    raise SystemExit("the stream ended")


if __name__ == "__main__":
    # The client says on its output what it does.
    with contextlib.redirect_stdout(sys.stderr):
        answer = {"read": read, "follow": follow}[sys.argv[2]](sys.argv[1])
    json.dump(answer, sys.stdout, default=str)
