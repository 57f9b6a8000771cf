"""A package of `pvid deploy`, built as a user does."""

import shutil
import subprocess
from collections.abc import Mapping
from pathlib import Path

from pvid.configuration.excitation import Excitation, designed
from pvid.configuration.weak import config_for_recording
from pvid.core.host_compiler import compiled_once
from pvid.deploy.deployment import Deployment
from pvid.deploy.of_rig import deployment_f32
from pvid.model.compiled import CompiledModel

STUBS = Path(__file__).with_name("stubs")


def run(*command: str | Path, cwd: Path | None = None, env: Mapping[str, str] | None = None) -> str:
    """Standard output of a command that must succeed."""
    done = subprocess.run([str(one) for one in command], cwd=cwd, env=env, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{command}\n{done.stdout}{done.stderr}"
    return done.stdout


def built(source: Path, tree: Path, *options: str) -> Path:
    """Configures and builds a CMake project; `source` and `tree` are in one folder, and objects are compiled once for
    all such folders; without optimisation, which changes no bit, unless an option tells the type of build."""
    launcher = ["-DCMAKE_C_COMPILER_LAUNCHER=ccache"] if shutil.which("ccache") else []
    run("cmake", "-S", source, "-B", tree, "-G", "Ninja", "-DCMAKE_BUILD_TYPE=None", *launcher, *options)
    run("ninja", "-C", tree, env={**compiled_once(), "CCACHE_BASEDIR": str(tree.parent)})
    return tree


def commissioning_of(
    compiled: CompiledModel, limits: Mapping[str, Mapping[str, float]], rate: float, *, search: bool = False
) -> tuple[Deployment, Excitation]:
    """A package with a commissioning, as `pvid deploy` makes it from a rig file's [excitation]."""
    found = designed(compiled, limits, rate, samples=[one.name for one in compiled.signals], search=search)
    config = config_for_recording(compiled, found.recording, reversals="decided")
    return deployment_f32(compiled, config, found.recording.signals, "a test", excitation=found), found
