"""Generates `feedwave.v1` from the contract while a wheel is built: the one place where Python's modules of it are made."""

from __future__ import annotations

import pathlib
import shutil
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

# What `feedwave.v1` says about itself.
DOCUMENTATION = '"""Messages and services of the contract, generated from `proto/feedwave/v1`, which describes them."""\n'


class Contract(BuildHookInterface):  # type: ignore[type-arg]
    """The build step."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Writes the modules with their types next to the package's own."""
        root = pathlib.Path(self.root)
        # In a source distribution the contract is inside, in the repository beside the clients.
        places = [root / "proto", root / ".." / ".." / "proto"]
        contract = next((place.resolve() for place in places if (place / "feedwave" / "v1").is_dir()), None)
        if contract is None:
            raise FileNotFoundError(f"the contract is in none of {', '.join(map(str, places))}")
        target = root / "src" / "feedwave" / "v1"
        shutil.rmtree(target, ignore_errors=True)
        generate(contract, root / "src")
        (target / "__init__.py").write_text(DOCUMENTATION)


def generate(contract: pathlib.Path, target: pathlib.Path) -> None:
    """Generates messages, their types and services of all files of the contract."""
    import grpc_tools
    from grpc_tools import protoc

    files = sorted(str(path.relative_to(contract)) for path in contract.glob("feedwave/v1/*.proto"))
    known = pathlib.Path(grpc_tools.__file__).parent / "_proto"
    outputs = [f"--{kind}_out={target}" for kind in ("python", "pyi", "grpc_python")]
    if protoc.main(["protoc", f"-I{contract}", f"-I{known}", *outputs, *files]) != 0:
        raise RuntimeError("the protobuf compiler refuses the contract")
