"""tools/bootstrap.sh and the lock file: folders in which nothing can be built, another user's clone, hashes."""

from __future__ import annotations

import os
import re
import shutil
import stat
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest
from conftest import ROOT
from packaging.requirements import Requirement

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
