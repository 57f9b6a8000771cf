"""What tools/release runs: the parts of a release, each built from what is committed and tested in a clean folder."""

import argparse
import email
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Iterable, Sequence
from importlib import metadata
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[1]
OUT = ROOT / "build" / "release"
MECHANISM = "dc_motor"
PACKAGES = ("arduino", "platformio", "esp-idf", "zephyr", "cmake", "cubemx")
CORES = ("f32", "q31")
G = 9.5  # [m/s^2] of the rig that `pvid simulate` takes
_DATE = (1980, 1, 1, 0, 0, 0)  # the earliest of a zip: the same files make the same archive on every day
_EPOCH = "315532800"  # the same, of a wheel
_C99 = ("gcc", "-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-Wno-maybe-uninitialized", "-O1", "-I.", "-c")
# What host/pyproject.toml says of folders above its own, which a source distribution does not have.
_UPWARD = {
    'cmake.source-dir = ".."': 'cmake.source-dir = "."',
    'wheel.packages = ["src/pvid"]': 'wheel.packages = ["host/src/pvid"]',
    'wheel.license-files = ["../LICENSE", "src/': 'wheel.license-files = ["LICENSE", "host/src/',
    'input = "src/': 'input = "host/src/',
}


class RefusalError(Exception):
    """One sentence: what is wrong with the release."""


def version_of_header(root: Path) -> str:
    """The version's home, which CMake reads as well."""
    text = (root / "firmware" / "include" / "pvid" / "version.h").read_text(encoding="utf-8")
    return ".".join(re.findall(r"#define PVID_VERSION_(?:MAJOR|MINOR|PATCH) (\d+)", text))


def version_of_python(root: Path) -> str:
    """What the wheel and `pvid --version` are called."""
    text = (root / "host" / "src" / "pvid" / "base" / "version.py").read_text(encoding="utf-8")
    found = re.search(r'__version__ = "(.+)"', text)
    return found[1] if found else "nothing"


def version_of_changelog(root: Path) -> str:
    """Of the topmost section: a version, or Unreleased."""
    text = (root / "host" / "docs" / "changelog.md").read_text(encoding="utf-8")
    found = re.search(r"(?m)^## (\S+)", text)
    return found[1] if found else "nothing"


def check_versions(root: Path) -> None:
    """Refuses other versions than that of version.h in the package and at the top of the changelog."""
    version = version_of_header(root)
    for path, other in (
        ("host/src/pvid/base/version.py", version_of_python(root)),
        ("host/docs/changelog.md", version_of_changelog(root)),
    ):
        if other != version:
            raise RefusalError(f"{path} has {other} at its top and firmware/include/pvid/version.h has {version}.")


def check_changes(root: Path) -> None:
    """Refuses changes that no section of the changelog has yet."""
    left = sorted(path.name for path in (root / ".github" / "changes").glob("*.*.md"))
    if left:
        raise RefusalError(
            f".github/changes/{left[0]} is in no section of the changelog; of such files there are {len(left)}."
        )


def check_tree(root: Path) -> None:
    """Refuses changes that no commit has."""
    changed = run("git", "status", "--porcelain", cwd=root, failure="git cannot tell what is committed").splitlines()
    if changed:
        raise RefusalError(f"{changed[0][3:]} is not committed as it is; of such files there are {len(changed)}.")


def run(*command: str | Path, cwd: Path, failure: str) -> str:
    """What a command prints; its last complaint goes into the refusal."""
    ours = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    words = [str(one) for one in command]
    try:
        done = subprocess.run(words, cwd=cwd, env=ours, capture_output=True, text=True, check=False)
    except FileNotFoundError:
        raise RefusalError(f"{failure}: {words[0]} is not installed") from None
    if done.returncode != 0:
        complaints = (done.stderr.strip() or done.stdout.strip() or f"exit code {done.returncode}").splitlines()
        telling = [line for line in complaints if "error" in line.lower()]
        raise RefusalError(f"{failure}: {(telling or complaints[-1:])[0].strip()}")
    return done.stdout


def source_archive(root: Path, version: str, out: Path) -> Path:
    """What is committed, without files of the working folder."""
    archive = out / f"pvid-{version}-source.tar.gz"
    run(
        *("git", "archive", "--format=tar.gz", f"--prefix=pvid-{version}/", "-o", archive, "HEAD"),
        cwd=root,
        failure="git cannot write the source archive",
    )
    return archive


def extracted(archive: Path, folder: Path) -> Path:
    """The one folder that the archive consists of."""
    run("tar", "-xf", archive, "-C", folder, cwd=folder, failure=f"{archive.name} cannot be extracted")
    (top,) = folder.iterdir()
    return top


def wheel_of(source: Path, out: Path, what: str) -> Path:
    """Built without a download, by the packages of this environment."""
    command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-index", "--no-build-isolation"]
    run(*command, "-w", out, source, cwd=out, failure=f"the wheel cannot be built from {what}")
    (found,) = out.glob("*.whl")
    return found


def check_again(source: Path, wheel: Path, folder: Path) -> None:
    """Refuses a wheel whose second build, in another folder, has other bytes."""
    shutil.copytree(source, folder / "source")
    if wheel_of(folder / "source" / "host", folder, "the source archive").read_bytes() != wheel.read_bytes():
        raise RefusalError(f"a second build of {wheel.name} has other bytes.")


def required(of: Iterable[str]) -> dict[str, str]:
    """Distributions that meet requirements, and all that these require, with their versions here."""
    found: dict[str, str] = {}
    left = [Requirement(one) for one in of]
    while left:
        one = left.pop()
        name = canonicalize_name(one.name)
        if name not in found and (one.marker is None or one.marker.evaluate({"extra": ""})):
            found[name] = metadata.version(name)
            left += [Requirement(further) for further in metadata.requires(name) or []]
    return dict(sorted(found.items()))


def bill_of_materials(wheel: Path, version: str, out: Path) -> Path:
    """What the wheel contains and requires of others, as CycloneDX, in the versions with which it was tested."""

    def component(name: str, version: str, kind: str = "pypi") -> dict[str, str]:
        return {"type": "library", "name": name, "version": version, "purl": f"pkg:{kind}/{name}@{version}"}

    with zipfile.ZipFile(wheel) as archive:
        (about,) = (one for one in archive.namelist() if one.endswith(".dist-info/METADATA"))
        wanted = email.message_from_bytes(archive.read(about)).get_all("Requires-Dist", [])
        plots = archive.read("pvid/show/web/uplot.js")[:200].decode()
    of_others = [component("uplot", re.findall(r"v(\d+\.\d+\.\d+)", plots)[0], "npm")]
    of_others += [component(*one) for one in required(wanted).items()]
    whole = {"bomFormat": "CycloneDX", "specVersion": "1.5", "version": 1}
    whole |= {"metadata": {"component": component("pvid", version)}, "components": of_others}
    path = out / f"pvid-{version}-sbom.cdx.json"
    path.write_text(json.dumps(whole, indent=1) + "\n", encoding="utf-8")
    return path


def sdist_of(source: Path, out: Path, folder: Path) -> Path:
    """The sources of the wheel as a source distribution, whose top is that of the repository."""
    for name in ("CMakeLists.txt", "LICENSE", "firmware", "host/native", "host/src"):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (shutil.copytree if (source / name).is_dir() else shutil.copy)(source / name, folder / name)
    text = (source / "host" / "pyproject.toml").read_text(encoding="utf-8")
    for upward, own in _UPWARD.items():
        if text.count(upward) != 1:
            raise RefusalError(f"host/pyproject.toml does not contain {upward!r} once, which the sdist replaces.")
        text = text.replace(upward, own)
    (folder / "pyproject.toml").write_text(text, encoding="utf-8")
    code = "import sys; from scikit_build_core.build import build_sdist; build_sdist(sys.argv[1])"
    run(sys.executable, "-c", code, out, cwd=folder, failure="the sdist cannot be built")
    (found,) = (one for one in out.glob("pvid-*.tar.gz") if "-source" not in one.name)
    return found


def check_sdist(sdist: Path, wheel: Path, folder: Path) -> None:
    """Refuses a source distribution whose wheel has other files."""
    again = wheel_of(sdist, folder, sdist.name)
    ours, theirs = (set(map(_without_folder_of_licences, zipfile.ZipFile(one).namelist())) for one in (wheel, again))
    if ours != theirs:
        raise RefusalError(f"the wheel from {sdist.name} differs from {wheel.name} in {min(ours ^ theirs)}.")


def _without_folder_of_licences(name: str) -> str:
    """A licence above the folder of pyproject.toml lies higher in the wheel than one beside it."""
    return f"dist-info/{name.rpartition('/')[2]}" if ".dist-info/" in name else name


def bare_environment(wheel: Path, folder: Path) -> Path:
    """Python with the wheel installed, and this environment's packages in place of a download."""
    failure = "a bare environment cannot be made"
    run(sys.executable, "-m", "venv", "--without-pip", folder, cwd=folder.parent, failure=failure)
    (packages,) = folder.glob("lib/python*/site-packages")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(packages)
    (ours,) = (Path(sys.prefix) / "lib").glob("python*/site-packages")
    (packages / "others.pth").write_text(f"{ours}\n", encoding="utf-8")  # its own .pth files count for nothing
    return folder / "bin" / "python"


def pvid(python: Path, *arguments: str | Path, cwd: Path, failure: str) -> str:
    return run(python, "-P", "-m", "pvid", *arguments, cwd=cwd, failure=failure)


def check_wheel(python: Path, version: str, folder: Path) -> None:
    """Refuses a wheel that does not identify a run by its own core."""
    failure = "the installed wheel fails"
    said = pvid(python, "--version", cwd=folder, failure=failure)
    if version not in said:
        raise RefusalError(f"the installed wheel says {said.strip()!r} for version {version}.")
    pvid(python, "simulate", "run.csv", "--duration", "20", cwd=folder, failure=failure)
    pvid(python, "compare", "run.csv", cwd=folder, failure=failure)
    told = json.loads(pvid(python, "identify", "run.csv", "--json", cwd=folder, failure=failure))
    g = told["parameters"]["g"]["value"]
    if not told["identified"] or abs(g / G - 1.0) > 0.01:
        raise RefusalError(f"the installed wheel identifies g = {g} m/s^2 where {G} was simulated.")


def check_sources(source: Path, folder: Path) -> None:
    """Refuses a source archive that does not configure and build."""
    options = ("-DPVID_BUILD_TESTS=OFF", "-G", "Ninja")
    run("cmake", "-S", source, "-B", folder, *options, cwd=source, failure="CMake refuses the source archive")
    run("cmake", "--build", folder, cwd=source, failure="the source archive does not compile")


def zipped(folder: Path, archive: Path) -> Path:
    """A zip of the folder, under the archive's name; equal files make equal bytes."""
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as made:
        for path in sorted(one for one in folder.rglob("*") if one.is_file()):
            info = zipfile.ZipInfo(f"{archive.stem}/{path.relative_to(folder).as_posix()}", _DATE)
            info.compress_type, info.external_attr = zipfile.ZIP_DEFLATED, 0o644 << 16
            made.writestr(info, path.read_bytes())
    return archive


def package(python: Path, target: str, core: str, version: str, out: Path, folder: Path) -> Path:
    """The mechanism's deployment for one ecosystem, as the installed wheel writes it."""
    place = folder / f"{target}-{core}"
    options = ("--for", target, "--core", core, "-o", place)
    pvid(python, "deploy", MECHANISM, *options, cwd=folder, failure=f"pvid deploy --for {target} --core {core} fails")
    return zipped(place, out / f"pvid-{version}-{MECHANISM}-{target}-{core}.zip")


def check_package(archive: Path, folder: Path) -> None:
    """Refuses a package whose C does not compile as C99; that for CMake must print what its README promises."""
    with zipfile.ZipFile(archive) as made:
        made.extractall(folder)
    (top,) = folder.iterdir()
    if (top / "src").is_dir():
        sources, includes = [*(top / "src").rglob("*.c")], [f"-I{top / 'src'}"]
    else:  # two files to copy
        sources, includes = [*top.glob("*.c"), *top.glob("example/*_example.c")], ["-Iexample"]
    if not sources:
        raise RefusalError(f"{archive.name} contains no C.")
    run(*_C99, *includes, *sources, cwd=top, failure=f"{archive.name} does not compile as C99")
    if "-cmake-" in archive.name:
        failure = f"{archive.name} does not build"
        run("cmake", "-S", top, "-B", top / "build", cwd=top, failure=failure)
        run("cmake", "--build", top / "build", cwd=top, failure=failure)
        told = run(top / "build" / f"{MECHANISM}_example", cwd=top, failure=f"the example of {archive.name} fails")
        readme = (top / "README.md").read_text(encoding="utf-8")
        if not told.strip() or any(line.strip() not in readme for line in told.splitlines()):
            raise RefusalError(f"the example of {archive.name} prints other digits than its README.")


def checksums(paths: Iterable[Path]) -> str:
    """Lines as sha256sum writes and checks them."""
    ordered = sorted(paths, key=lambda path: path.name)
    return "".join(f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}\n" for path in ordered)


def build(version: str, out: Path) -> list[Path]:
    """Builds and tests every part; returns the files."""
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir(parents=True)
    with tempfile.TemporaryDirectory(prefix="pvid-release-") as name:
        clean = Path(name)
        for one in ("archive", "sdist", "again", "twice", "run", "deploy"):
            (clean / one).mkdir()
        say("source archive")
        archive = source_archive(ROOT, version, out)
        source = extracted(archive, clean / "archive")
        check_sources(source, clean / "cmake")
        say("wheel")
        wheel = wheel_of(source / "host", out, "the source archive")
        check_again(source, wheel, clean / "twice")
        python = bare_environment(wheel, clean / "venv")
        check_wheel(python, version, clean / "run")
        say("bill of materials, documentation")
        packages = [bill_of_materials(wheel, version, out)]
        run(sys.executable, "-P", "tools/docs.py", cwd=source, failure="the documentation cannot be built")
        packages.append(zipped(source / "build" / "site", out / f"pvid-{version}-docs.zip"))
        say("sdist")
        sdist = sdist_of(source, out, clean / "sdist")
        check_sdist(sdist, wheel, clean / "again")
        wanted = [*((one, "f32") for one in PACKAGES), *(("amalgamation", core) for core in CORES)]
        for target, core in wanted:
            say(f"{MECHANISM} for {target}, {core}")
            packages.append(package(python, target, core, version, out, clean / "deploy"))
            check_package(packages[-1], clean / f"check-{target}-{core}")
    return [archive, wheel, sdist, *packages]


def say(text: str) -> None:
    print(f"release: {text}", file=sys.stderr, flush=True)


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="tools/release", description=__doc__)
    parser.add_argument("--rehearse", action="store_true", help="report what forbids a release, and build all the same")
    rehearse = parser.parse_args(arguments).rehearse
    os.environ["SOURCE_DATE_EPOCH"] = _EPOCH
    try:
        for check in (check_tree, check_versions, check_changes):
            try:
                check(ROOT)
            except RefusalError as refusal:
                if not rehearse:
                    raise
                say(f"a release is refused: {refusal}")
        sums = checksums(build(version_of_header(ROOT), OUT))
        (OUT / "SHA256SUMS").write_text(sums, encoding="utf-8")
    except RefusalError as refusal:
        say(str(refusal))
        return 1
    print(sums, end="")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
