"""Generates `feedwave.v1` from the contract while a wheel is built: the one place where Python's modules of it are made. Puts the native
part beside it where `FEEDWAVE_NATIVE_WHEEL` names what maturin built of `native/`; without it, the wheel is pure."""

from __future__ import annotations

import os
import pathlib
import shutil
import zipfile
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
        if self.target_name == "wheel" and (built := os.environ.get("FEEDWAVE_NATIVE_WHEEL")):
            module = extracted(pathlib.Path(built), pathlib.Path(self.directory) / "native")
            build_data["force_include"][str(module)] = f"feedwave/{module.name}"
            build_data["pure_python"] = False
            # Maturin knows which platforms the module runs on.
            build_data["tag"] = pathlib.Path(built).stem.split("-", 2)[2]


def extracted(wheel: pathlib.Path, target: pathlib.Path) -> pathlib.Path:
    """The extension module of a wheel, as a file in `target`."""
    with zipfile.ZipFile(wheel) as archive:
        (name,) = (name for name in archive.namelist() if name.endswith((".so", ".pyd")))
        return pathlib.Path(archive.extract(name, target))


def generate(contract: pathlib.Path, target: pathlib.Path) -> None:
    """Generates messages, their types and services of all files of the contract."""
    import grpc_tools
    from grpc_tools import protoc

    files = sorted(str(path.relative_to(contract)) for path in contract.glob("feedwave/v1/*.proto"))
    known = pathlib.Path(grpc_tools.__file__).parent / "_proto"
    outputs = [f"--{kind}_out={target}" for kind in ("python", "pyi", "grpc_python")]
    if protoc.main(["protoc", f"-I{contract}", f"-I{known}", *outputs, *files]) != 0:
        raise RuntimeError("the protobuf compiler refuses the contract")
