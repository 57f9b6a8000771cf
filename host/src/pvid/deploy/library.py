"""The library's files, the same in every package, and the licence."""

from __future__ import annotations

from collections.abc import Mapping

from pvid.core.sources import ROOT
from pvid.deploy.commission import commission_files
from pvid.deploy.core_files import core_files
from pvid.deploy.deployment import Deployment, Files
from pvid.deploy.identifier import identifier_files


def library_files(deployment: Deployment) -> Files:
    """Everything that is compiled, in `src`, which is the only include path."""
    return under("src", all_files(deployment))


def all_files(deployment: Deployment) -> Files:
    """Name -> text of the core's and the mechanism's files."""
    return (
        core_files(deployment)
        | dict(deployment.generated)
        | identifier_files(deployment)
        | commission_files(deployment)
    )


def under(folder: str, files: Mapping[str, str]) -> Files:
    """The same files in a folder."""
    return {f"{folder}/{name}": text for name, text in files.items()}


def sources(files: Mapping[str, str]) -> list[str]:
    """Those that are compiled."""
    return [name for name in files if name.endswith(".c")]


def licence() -> Files:
    """LICENSE, where it came along."""
    path = ROOT / "LICENSE"
    return {"LICENSE": path.read_text(encoding="utf-8")} if path.is_file() else {}


def indented(names: list[str], spaces: int) -> str:
    """One a line."""
    return "\n".join(f"{' ' * spaces}{one}" for one in names)
