"""tools/bootstrap.sh and the lock file: folders in which nothing can be built, another user's clone, hashes."""

import os
import re
import shutil
import signal
import stat
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from conftest import ROOT
from packaging.requirements import Requirement
from processes import PATIENCE_S, heed_interrupts

from pvid.base import user_cache

LOCK = (ROOT / "tools" / "requirements.txt").read_text(encoding="utf-8")
NOBODY = 65534


@pytest.mark.parametrize("name", ['a"b', "a$b", "a;b", "a|b", "a>b", "a:b", "a\\b", "a\nb", "end\n", "tab\tb"])
def test_a_folder_in_which_nothing_can_be_built_is_named(name: str, tmp_path: Path) -> None:
    tools = tmp_path / name / "tools"
    tools.mkdir(parents=True)
    for tool in ("bootstrap.sh", "pvid"):
        shutil.copy(ROOT / "tools" / tool, tools)
    done = subprocess.run([tools / "pvid", "--version"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("pvid: nothing can be built in ") and done.stderr.count("\n") == 1
    assert not (tmp_path / name / "build").exists()


def test_bytecode_is_kept_in_the_environment_alone() -> None:
    """Also where the variable keeps it out of the sources: no process compiles all modules again."""
    code = "import sys, pvid.base.errors as one; print(sys.dont_write_bytecode, one.__cached__, sys.prefix)"
    environment = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1"}
    told = subprocess.check_output([sys.executable, "-P", "-c", code], text=True, env=environment).split()
    assert told[0] == "False" and Path(told[1]).is_relative_to(Path(told[2]) / "bytecode") and Path(told[1]).is_file()


@pytest.fixture
def foreign() -> Iterator[Path]:
    """A clone with all prepared, whose build/ this test's other user may read alone; its Python tells its arguments."""
    clone = Path(tempfile.mkdtemp(prefix="pvid-foreign-"))  # not under tmp_path, which nobody else may enter
    (clone / "tools").mkdir()
    (clone / "host").mkdir()
    for tool in ("bootstrap.sh", "pvid", "requirements.txt"):
        shutil.copy(ROOT / "tools" / tool, clone / "tools")
    shutil.copy(ROOT / "host" / "pyproject.toml", clone / "host")
    python = clone / "build" / "venv" / "bin" / "python"
    (clone / "build" / "log").mkdir(parents=True)
    python.parent.mkdir(parents=True)
    python.write_text('#!/bin/sh\necho ran "$@"\n', encoding="utf-8")
    python.chmod(0o755)
    (clone / "build" / "venv" / "made").write_text(f"{clone}\n{python}", encoding="utf-8")
    stamp = subprocess.check_output(["bash", "-c", f". '{clone}/tools/bootstrap.sh'; requirements"], text=True)
    (clone / "build" / "venv" / "installed-pvid").write_text(stamp.strip("\n"), encoding="utf-8")
    (clone / "build" / "host").mkdir()
    (clone / "build" / "host" / "build.ninja").write_text("build pvid_native: phony\n", encoding="utf-8")
    for path in (clone, *clone.rglob("*")):
        path.chmod((path.stat().st_mode | 0o044 | (0o111 if path.is_dir() else 0)) & ~0o022)
    if os.geteuid() != 0:  # this user is the other one
        for path in (clone / "build", clone / "build" / "log"):
            path.chmod(0o555)
    yield clone
    if os.geteuid() != 0:
        for path in (clone / "build", clone / "build" / "log"):
            path.chmod(0o755)
    shutil.rmtree(clone)


def as_another_user(clone: Path) -> subprocess.CompletedProcess[str]:
    other = {"user": NOBODY, "group": NOBODY, "extra_groups": []} if os.geteuid() == 0 else {}
    done: subprocess.CompletedProcess[str] = subprocess.run(
        [clone / "tools" / "pvid", "--version"],
        capture_output=True,
        text=True,
        check=False,
        cwd="/",
        **other,  # type: ignore[call-overload]
    )
    return done


def test_cache_prepared_by_another_user_is_used(foreign: Path) -> None:
    done = as_another_user(foreign)
    assert (done.returncode, done.stdout, done.stderr) == (0, "ran -P -m pvid --version\n", "")


def test_cache_of_another_user_without_preparation_is_reported(foreign: Path) -> None:
    with (foreign / "tools" / "requirements.txt").open("a", encoding="utf-8") as file:
        file.write("# newer\n")
    done = as_another_user(foreign)
    assert (done.returncode, done.stdout) == (2, "")
    assert "belongs to" in done.stderr and "is not ready" in done.stderr and done.stderr.count("\n") == 1


def test_images_go_to_the_users_cache_where_the_clone_is_not_his(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clone, cache = tmp_path / "clone", tmp_path / "cache"
    clone.mkdir()
    cache.mkdir()
    may_write = {str(clone), str(cache)}
    monkeypatch.setattr(os, "access", lambda path, mode: str(path) in may_write)
    monkeypatch.setenv("XDG_CACHE_HOME", str(cache))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    assert user_cache.built_under(clone / "build") == clone / "build"
    may_write.remove(str(clone))
    assert user_cache.built_under(clone / "build") == cache / "pvid"
    may_write.clear()
    own = user_cache.built_under(clone / "build")
    assert own == tmp_path / f"pvid-{os.getuid()}" and stat.S_IMODE(own.stat().st_mode) == 0o700
    own.chmod(0o777)  # somebody else may have put an image there
    assert user_cache.built_under(clone / "build") != own


# Three packages instead of Debian's: one of Python, one for the core, one for the board. `apt_get` installs a package
# once there is a file `may-PACKAGE`, fails for the one in $broken, and leaves a file PACKAGE. The core is built once
# there is a file may-core.
STAND_INS = """
set -euo pipefail
. tools/bootstrap.sh
cd "$root"
lock
sudo() { :; }
missing_packages() {
    local package packages=python3 missing=()
    [[ $1 == python ]] || packages+=" gcc"
    [[ $1 != demo ]] || packages+=" qemu"
    for package in $packages; do [[ -e $package ]] || missing+=("$package"); done
    printf '%s' "${missing[*]}"
}
apt_get() {
    local package
    for package in "${@:3}"; do
        [[ $package != "${broken-}" ]] || { echo "no $package"; return 1; }
        until [[ -e may-$package ]]; do sleep 0.01; done
        touch "$package"
    done
}
build_core() {
    until [[ -e may-core ]]; do sleep 0.01; done
    [[ ${broken-} != core ]] || die "no core"
    touch core
}
touch may-python3
"""


@pytest.fixture
def installing(tmp_path: Path) -> Iterator[Callable[[str], subprocess.Popen[str]]]:
    """Starts a script behind the stand-ins, in a process group of its own."""
    (tmp_path / "tools").mkdir()
    shutil.copy(ROOT / "tools" / "bootstrap.sh", tmp_path / "tools")
    started: list[subprocess.Popen[str]] = []

    def start(script: str) -> subprocess.Popen[str]:
        process = subprocess.Popen(
            ["bash", "-c", STAND_INS + script],
            cwd=tmp_path,
            text=True,
            start_new_session=True,
            preexec_fn=heed_interrupts,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
        )
        started.append(process)
        return process

    yield start
    for one in started:
        if one.poll() is None:
            os.killpg(one.pid, signal.SIGKILL)
            one.communicate()


Installing = Callable[[str], "subprocess.Popen[str]"]


def test_packages_are_installed_and_the_core_is_built_beside_the_environment(installing: Installing) -> None:
    script = """
install_packages demo
echo environment: python3 $(ls gcc qemu 2>/dev/null)
(exec 8>build/.lock; flock -n 8 && echo free || echo locked)
unlock
(exec 8>build/.lock; flock -n 8 && echo free || echo locked)
touch may-gcc may-core; until [[ -e core ]]; do sleep 0.01; done; echo core: $(ls gcc qemu 2>/dev/null)
touch may-qemu; await_packages; trap - EXIT; echo board: $(ls gcc qemu)
"""
    out, err = installing(script).communicate(timeout=PATIENCE_S)
    assert out.splitlines() == ["environment: python3", "locked", "free", "core: gcc", "board: gcc qemu"]
    assert err == "pvid: installing Debian packages: python3 gcc qemu\n"


@pytest.mark.parametrize("broken", ["python3", "gcc", "qemu"])
def test_a_package_that_cannot_be_installed_ends_the_set_up(broken: str, installing: Installing) -> None:
    script = f"broken={broken}; as_root() {{ :; }}; touch may-gcc may-qemu may-core; install_packages demo"
    process = installing(f"{script}; await_packages; echo 'the program'")
    out, err = process.communicate(timeout=PATIENCE_S)
    assert (process.returncode, out) == (2, "")
    assert err.splitlines()[1:] == [
        "pvid: updating the lists of Debian packages",
        f"no {broken}",
        "pvid: apt-get install failed; its output is above",
    ]


def test_a_core_that_does_not_build_ends_the_set_up(installing: Installing, tmp_path: Path) -> None:
    process = installing("broken=core; touch may-gcc may-qemu may-core; install_packages demo; await_packages; echo on")
    out, err = process.communicate(timeout=PATIENCE_S)
    assert (process.returncode, out, err.splitlines()[1:]) == (2, "", ["pvid: no core"])
    assert (tmp_path / "qemu").exists()


def test_no_exit_leaves_an_installation_alone(installing: Installing, tmp_path: Path) -> None:
    """Of the foreground: it has failed, or Ctrl-C has ended it, which reaches apt-get too.

    The program that is interrupted says itself that it runs: a signal that meets the shell's child before it is that
    program is lost.
    """
    for end in ("die 'pip install failed'", "sh -c 'echo ready; exec sleep 600'"):
        for name in ("gcc", "qemu", "core", "may-gcc", "may-qemu", "may-core"):
            (tmp_path / name).unlink(missing_ok=True)
        process = installing(f"install_packages demo; {end}")
        assert process.stdout is not None and process.stderr is not None
        if "sleep" in end:
            process.stdout.readline()
            os.killpg(process.pid, signal.SIGINT)
        told = process.stderr.readline()
        while "waiting until apt-get has ended" not in told:
            assert told, "it did not wait"
            told = process.stderr.readline()
        for name in ("may-gcc", "may-qemu", "may-core"):
            (tmp_path / name).touch()
        assert process.wait(60) == (130 if "sleep" in end else 2)
        assert all((tmp_path / name).exists() for name in ("gcc", "qemu", "core"))


# The environment's Python: it tells what pip is asked for, and "installs" uv where there is one for this processor.
PYTHON = """#!/bin/sh
for last; do :; done
case "$*" in
*sysconfig*) echo site ;;
*config*) echo https://mirror.example/simple ;;
*installer.txt) [ ! -e ready-uv ] || cp ready-uv build/venv/bin/uv ;;
*) echo "pip ${last##*/}" >>told ;;
esac
"""
UV = """#!/bin/sh
for last; do :; done
echo "uv ${last##*/} from $UV_DEFAULT_INDEX" >>told
"""
BY_UV = [f"uv {name} from https://mirror.example/simple" for name in ("builders.txt", "wanted.txt")]
BY_PIP = ["pip builders.txt", "pip wanted.txt"]


@pytest.mark.parametrize(
    ("uv", "installed"),
    [(UV, BY_UV), (UV + "exit 1\n", [BY_UV[0], BY_PIP[0], BY_UV[1], BY_PIP[1]]), ("", BY_PIP)],
    ids=["uv", "uv fails", "no uv"],
)
def test_uv_installs_from_the_index_of_pip_and_pip_where_it_cannot(
    uv: str, installed: list[str], tmp_path: Path
) -> None:
    for name in ("tools/bootstrap.sh", "tools/requirements.txt", "host/pyproject.toml"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        shutil.copy(ROOT / name, tmp_path / name)
    for folder in ("site", "build/venv/bin", "build/log"):
        (tmp_path / folder).mkdir(parents=True)
    for place, text in (("build/venv/bin/python", PYTHON), ("ready-uv", uv)):
        if text:
            (tmp_path / place).write_text(text, encoding="utf-8")
            (tmp_path / place).chmod(0o755)
    plain = {name: value for name, value in os.environ.items() if not name.startswith(("PIP_", "UV_"))}
    script = ". tools/bootstrap.sh; set -euo pipefail; install_requirements test"
    done = subprocess.run(["bash", "-c", script], cwd=tmp_path, env=plain, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "told").read_text(encoding="utf-8").splitlines() == installed
    assert (tmp_path / "build" / "venv" / "installed-test").exists()


def test_every_package_that_is_installed_has_its_version_and_hashes() -> None:
    project = tomllib.loads((ROOT / "host" / "pyproject.toml").read_text(encoding="utf-8"))
    blocks = re.findall(r"(?m)^[^\s#].*(?:\n .*)*\n", LOCK)
    versions = {block.split("==")[0]: block.split()[0].split("==")[1] for block in blocks}
    extras = project["project"]["optional-dependencies"].values()
    wanted = [*project["build-system"]["requires"], *project["project"]["dependencies"], *sum(extras, [])]
    for requirement in map(Requirement, wanted):
        name = requirement.name.replace("_", "-")
        assert requirement.specifier.contains(versions[name]), name
        assert not str(requirement.specifier).startswith("=="), f"{name}: the package has ranges"
    assert all("--hash=sha256:" in block for block in blocks)
    assert "://" not in LOCK


def test_large_packages_are_installed_for_what_needs_them_alone() -> None:
    rest, tests = LOCK.split("# for the tests alone\n")
    used, more = rest.split("# for parquet, mcap and campaigns\n")
    assert "pytest==" in tests and "pytest==" not in rest
    assert all(f"{name}==" in more and f"{name}==" not in used for name in ("pyarrow", "mcap", "distributed"))
    assert used.index("setuptools==") < used.index("# to use pvid\n") < used.index("numpy==")
