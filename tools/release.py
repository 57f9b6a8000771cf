"""What tools/release runs: the parts of a release, each built from what is committed and used from a clean folder.

With --check it uses the parts of a folder alone, by the wheel that is installed here: what a bare machine runs.
"""

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
from urllib.parse import unquote

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[1]
OUT = ROOT / "build" / "release"
MECHANISM = "dc_motor"
PACKAGES = ("cmake", "arduino", "platformio", "esp-idf", "zephyr", "cubemx")
WANTED = (*((one, "f32") for one in PACKAGES), ("amalgamation", "f32"), ("amalgamation", "q31"))
HEADER = "firmware/include/pvid/version.h"
G = 9.5  # [m/s^2] of the rig that `pvid simulate` takes
_DATE = (1980, 1, 1, 0, 0, 0)  # the earliest of a zip: the same files make the same archive on every day
_EPOCH = "315532800"  # the same, of a wheel
_C99 = ("gcc", "-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-Wno-maybe-uninitialized", "-O1")
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
    text = (root / HEADER).read_text(encoding="utf-8")
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
            raise RefusalError(f"{path} has {other} at its top and {HEADER} has {version}.")


def check_changes(root: Path) -> None:
    """Refuses changes that no section of the changelog has yet."""
    left = sorted(path.name for path in (root / ".github" / "changes").glob("*.*.md"))
    if left:
        raise RefusalError(
            f".github/changes/{left[0]} is in no section of the changelog; of such files there are {len(left)}."
        )


def tag_of(root: Path) -> str:
    return f"v{version_of_header(root)}"


def check_tag(root: Path) -> None:
    """Refuses a version that is the tag of another commit."""
    found = run("git", "tag", "--list", tag_of(root), "--points-at", "HEAD", cwd=root, failure="git lists no tags")
    if not found and run("git", "tag", "--list", tag_of(root), cwd=root, failure="git lists no tags"):
        raise RefusalError(f"{tag_of(root)} is the tag of another commit: set the next version in {HEADER}.")


def put_tag(root: Path) -> None:
    """Annotated, in this clone alone; nothing if HEAD has it."""
    tag = tag_of(root)
    if not run("git", "tag", "--list", tag, cwd=root, failure="git lists no tags"):
        message = f"pvid {version_of_header(root)}"
        run("git", "tag", "--annotate", tag, "--message", message, cwd=root, failure=f"git cannot make the tag {tag}")


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


def pvid(python: str | Path, *arguments: str | Path, cwd: Path, failure: str) -> str:
    return run(python, "-P", "-m", "pvid", *arguments, cwd=cwd, failure=failure)


def check_wheel(python: str | Path, version: str, folder: Path) -> None:
    """Refuses a wheel that does not identify a run by its own core."""
    folder.mkdir()
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


def archive_of(target: str, core: str, version: str, out: Path) -> Path:
    return out / f"pvid-{version}-{MECHANISM}-{target}-{core}.zip"


def package(python: Path, target: str, core: str, version: str, out: Path, folder: Path) -> Path:
    """The mechanism's deployment for one ecosystem, as the installed wheel writes it."""
    place = folder / f"{target}-{core}"
    options = ("--for", target, "--core", core, "-o", place)
    pvid(python, "deploy", MECHANISM, *options, cwd=folder, failure=f"pvid deploy --for {target} --core {core} fails")
    return zipped(place, archive_of(target, core, version, out))


def check_pages(archive: Path) -> None:
    """Refuses pages with a link to a file that is not among them."""
    with zipfile.ZipFile(archive) as made:
        names = set(made.namelist())
        pages = [name for name in names if name.endswith(".html")]
        for page in sorted(pages):
            for link in re.findall(r'(?:href|src)="([^"#?:]+)["#?]', made.read(page).decode()):
                to = os.path.normpath(f"{os.path.dirname(page)}/{unquote(link)}")
                if to not in names and f"{to}/index.html" not in names:
                    raise RefusalError(f"{page} of {archive.name} has a link to {link}, which is not there.")
    if f"{archive.stem}/index.html" not in pages or f"{archive.stem}/api/index.html" not in pages:
        raise RefusalError(f"{archive.name} lacks the page index.html or that of the C headers.")


def check_package(archive: Path, main: str, folder: Path) -> None:
    """Refuses a package whose C does not compile as C99, or whose example prints other digits than its README.

    Boards have no `main`, which runs the example on this computer.
    """
    folder.mkdir()
    with zipfile.ZipFile(archive) as made:
        made.extractall(folder)
    (top,) = folder.iterdir()
    (folder / "main.c").write_text(main, encoding="utf-8")
    examples = list(top.rglob(f"{MECHANISM}_example.c"))
    sources = [folder / "main.c", *examples, *top.glob("*.c"), *(top / "src").rglob("*.c")]
    includes = [f"-I{one}" for one in (top, top / "src", *(one.parent for one in examples))]
    failure = f"{archive.name} does not compile as C99"
    run(*_C99, *includes, *sources, "-lm", "-o", folder / "example", cwd=top, failure=failure)
    programs = [folder / "example"]
    if (top / "CMakeLists.txt").is_file() and "-cmake-" in archive.name:
        failure = f"{archive.name} does not build"
        run("cmake", "-S", top, "-B", folder / "build", "-G", "Ninja", cwd=top, failure=failure)
        run("cmake", "--build", folder / "build", cwd=top, failure=failure)
        programs.append(folder / "build" / f"{MECHANISM}_example")
    promised = re.findall(r"(?m)^    (\S.* = .* \+- .*)$", (top / "README.md").read_text(encoding="utf-8"))
    for program in programs:
        told = run(program, cwd=top, failure=f"the example of {archive.name} fails").splitlines()
        if not promised or told != promised:
            raise RefusalError(f"the example of {archive.name} prints other digits than its README.")


def checksums(paths: Iterable[Path]) -> str:
    """Lines as sha256sum writes and checks them."""
    ordered = sorted(paths, key=lambda path: path.name)
    return "".join(f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}\n" for path in ordered)


def build(version: str, out: Path, clean: Path) -> Path:
    """Builds every part; returns the Python of a bare environment that has the wheel."""
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir(parents=True)
    for one in ("archive", "sdist", "again", "twice", "deploy"):
        (clean / one).mkdir()
    say("source archive, wheel")
    source = extracted(source_archive(ROOT, version, out), clean / "archive")
    wheel = wheel_of(source / "host", out, "the source archive")
    check_again(source, wheel, clean / "twice")
    python = bare_environment(wheel, clean / "venv")
    say("bill of materials, documentation")
    bill_of_materials(wheel, version, out)
    run(sys.executable, "-P", "tools/docs.py", cwd=source, failure="the documentation cannot be built")
    zipped(source / "build" / "site", out / f"pvid-{version}-docs.zip")
    say("sdist")
    check_sdist(sdist_of(source, out, clean / "sdist"), wheel, clean / "again")
    for target, core in WANTED:
        say(f"{MECHANISM} for {target}, {core}")
        package(python, target, core, version, out, clean / "deploy")
    sums = checksums(out.iterdir())
    (out / "SHA256SUMS").write_text(sums, encoding="utf-8")
    return python


def check(out: Path, python: str | Path, clean: Path) -> None:
    """Uses every part, from its file alone."""
    run("sha256sum", "--check", "--strict", "SHA256SUMS", cwd=out, failure="the checksums are wrong")
    (source,) = out.glob("pvid-*-source.tar.gz")
    version = source.name.split("-")[1]
    say("uses the source archive")
    (clean / "sources").mkdir()
    check_sources(extracted(source, clean / "sources"), clean / "cmake")
    say("uses the wheel")
    check_wheel(python, version, clean / "run")
    check_pages(out / f"pvid-{version}-docs.zip")
    main = ""
    for target, core in WANTED:
        say(f"uses {MECHANISM} for {target}, {core}")
        archive = archive_of(target, core, version, out)
        if target in ("cmake", "amalgamation"):
            main = zipfile.ZipFile(archive).read(f"{archive.stem}/example/main.c").decode()
        check_package(archive, main, clean / f"{target}-{core}")


def say(text: str) -> None:
    print(f"release: {text}", file=sys.stderr, flush=True)


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="tools/release", description=__doc__)
    parser.add_argument("--rehearse", action="store_true", help="report what forbids a release, and build all the same")
    parser.add_argument("--check", metavar="FOLDER", type=Path, help="use the parts in a folder, by the pvid installed")
    asked = parser.parse_args(arguments)
    os.environ["SOURCE_DATE_EPOCH"] = _EPOCH
    with tempfile.TemporaryDirectory(prefix="pvid-release-") as name:
        try:
            if asked.check:
                check(asked.check.resolve(), sys.executable, Path(name))
                return 0
            for condition in (check_tree, check_versions, check_changes, check_tag):
                try:
                    condition(ROOT)
                except RefusalError as refusal:
                    if not asked.rehearse:
                        raise
                    say(f"a release is refused: {refusal}")
            check(OUT, build(version_of_header(ROOT), OUT, Path(name)), Path(name))
            if not asked.rehearse:
                put_tag(ROOT)
        except RefusalError as refusal:
            say(str(refusal))
            return 1
    print((OUT / "SHA256SUMS").read_text(encoding="utf-8"), end="")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
