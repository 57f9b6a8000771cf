"""A log as the recorder writes it, of what a board sent."""

from pathlib import Path

from pvid.log.file import LogWriter
from pvid.log.reader import LogStream


def log_of(
    path: Path, *segments: bytes, rig: str | None = None, port: str = "a port", why: str | None = "the end"
) -> Path:
    """The bytes of each segment; one that is there is appended to. Without `why` the last segment is open."""
    writer = LogWriter(path, rig=rig, append=path.exists())
    for place, data in enumerate(segments, start=1):
        writer.begin(port, None)
        writer.take(data)
        if why is not None or place < len(segments):
            writer.end(why or "the end")
    writer.close()
    return path


def samples_in(path: Path) -> int:
    """That a log holds, which may not be there yet or may grow."""
    stream = LogStream()
    if path.exists():
        list(stream.feed(path.read_bytes()))
    return stream.account.samples
