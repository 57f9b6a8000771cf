"""Recordings of robots (.mcap): messages of JSON, ROS 1, ROS 2 or protobuf, each a row.

A column is `/topic.field`, in a field of a field `/topic.field.x`, in an array `/topic.field[0]`; or the field alone
where no other topic has it. Signals of several topics make a table of all their messages by the time of the log.
"""

from __future__ import annotations

import importlib
import json
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.base.packages import lacking
from pvid.base.wording import listed, reason, shown
from pvid.rig.array_table import table_of
from pvid.rig.columns import Columns
from pvid.rig.size import refuse_beyond
from pvid.rig.table import Table

Number = float | np.datetime64
Row = dict[str, Number]
Topics = dict[str, list[Row]]  # rows of each, in the order of the log

_LOG_TIME = "log_time"
_LONGEST_LIST = 64  # elements of an array that are columns
# Module of a message's encoding, which has a class DecoderFactory in `decoder`.
_DECODERS = {"cdr": "mcap_ros2", "ros1": "mcap_ros1", "protobuf": "mcap_protobuf"}
_STAMPS = (("sec", "nanosec"), ("secs", "nsecs"), ("sec", "nsec"), ("seconds", "nanos"))


def read_mcap(path: Path, columns: Columns) -> Table:
    """Reads the messages of a file; PvidError for whatever is wrong with it."""
    try:
        from mcap.reader import make_reader
    except ImportError as error:
        raise lacking(f"{path}: an MCAP file", "mcap") from error
    try:
        with path.open("rb") as file:
            summary = make_reader(file).get_summary()
            encodings = (
                {one.message_encoding for one in summary.channels.values()} if summary is not None else set(_DECODERS)
            )
            decoders = [_decoder(path, one) for one in sorted(encodings & set(_DECODERS))]
            unknown = encodings - set(_DECODERS) - {"json"}
            topics = _topics(path, make_reader(file), decoders, unknown)
    except PvidError:
        raise
    except Exception as error:  # mcap and its decoders raise many kinds on damaged files
        raise PvidError(f"{path} is not a readable MCAP file: {reason(error)}.") from error
    if not topics:
        kinds = f" of a known encoding, but of {listed(sorted(unknown))}" if unknown else ""
        raise PvidError(f"{path} has no messages{kinds}.")
    return _table(path, topics, columns)


def _decoder(path: Path, encoding: str) -> Any:
    module = _DECODERS[encoding]
    try:
        return importlib.import_module(f"{module}.decoder").DecoderFactory()
    except ImportError as error:
        raise lacking(f"{path}: messages of {encoding}", module) from error


def _topics(path: Path, reader: Any, decoders: Sequence[Any], unknown: set[str]) -> Topics:
    """Numbers of the messages of each topic, by field, in the order of the log."""
    topics: Topics = {}
    count = 0
    for schema, channel, message in reader.iter_messages():
        if channel.message_encoding in unknown:
            continue
        if channel.message_encoding == "json":
            content = json.loads(message.data)
        else:
            content = _decoded(decoders, schema, channel, message)
        row: Row = {_LOG_TIME: np.datetime64(message.log_time, "ns")}
        row.update(_fields(content, ""))
        topics.setdefault(channel.topic, []).append(row)
        count += 1
        if count % 100_000 == 0:
            refuse_beyond(path, count)
    return topics


def _decoded(decoders: Sequence[Any], schema: Any, channel: Any, message: Any) -> Any:
    """Content of a message, by the first decoder that takes it."""
    for factory in decoders:
        decode = factory.decoder_for(channel.message_encoding, schema)
        if decode is not None:
            return decode(message.data)
    return {}


def _fields(content: Any, front: str) -> Iterator[tuple[str, Number]]:
    """Numbers in a message, with their names."""
    if isinstance(content, bool | int | float):
        yield front, float(content)
        return
    if isinstance(content, str | bytes) or content is None:
        return
    if isinstance(content, Sequence | np.ndarray):
        for k, one in enumerate(content[:_LONGEST_LIST]):
            yield from _fields(one, f"{front}[{k}]")
        return
    named = content if isinstance(content, dict) else _members(content)
    for whole, part in _STAMPS:
        if set(named) == {whole, part}:
            yield front, np.datetime64(int(named[whole]) * 10**9 + int(named[part]), "ns")
            return
    for name, one in named.items():
        yield from _fields(one, f"{front}.{name}" if front else name)


def _members(message: Any) -> dict[str, Any]:
    descriptor = getattr(message, "DESCRIPTOR", None)
    if descriptor is not None:  # protobuf
        return {one.name: getattr(message, one.name) for one in descriptor.fields}
    return {one: getattr(message, one) for one in getattr(message, "__slots__", ()) if not one.startswith("_")}


def _table(path: Path, topics: Topics, columns: Columns) -> Table:
    fields = {topic: list(dict.fromkeys(name for row in rows for name in row)) for topic, rows in topics.items()}
    wanted = [one for one in columns.wanted if one != "t" or "t" in columns.named]
    # What has all of the fields is the table of the signals; else they are of several topics.
    one_topic = [topic for topic, own in fields.items() if all(name in own for name in wanted)]
    times = Counter(name for own in fields.values() for name in own)
    names: dict[str, tuple[str, str]] = {}
    for topic, own in fields.items():
        for name in own:
            short = topic == one_topic[0] if one_topic else times[name] == 1
            names[name if short and f"{topic}.{name}" not in wanted else f"{topic}.{name}"] = (topic, name)
    chosen = list(dict.fromkeys(names[one][0] for one in wanted if one in names)) or list(topics)
    if "t" not in columns.named and not (len(chosen) == 1 and "t" in fields[chosen[0]]):
        names["t"] = (chosen[0], _LOG_TIME)
    elif "t" not in columns.named:
        names["t"] = (chosen[0], "t")
    stamps = [np.array([row[_LOG_TIME] for row in topics[topic]]) for topic in chosen]
    order = np.argsort(np.concatenate(stamps), kind="stable")
    place = np.empty(order.size, np.int64)
    place[order] = np.arange(order.size)
    places = dict(zip(chosen, np.split(place, np.cumsum([one.size for one in stamps])[:-1]), strict=True))

    def column(name: str) -> npt.NDArray[Any]:
        topic, field = names[name]
        if topic not in places:
            raise PvidError(f"{path}: {shown(name)} is of another topic than the signals.")
        if field == _LOG_TIME:
            return np.concatenate(stamps)[order]
        own = [row.get(field) for row in topics[topic]]
        is_time = any(isinstance(one, np.datetime64) for one in own)
        out = np.full(
            order.size, np.datetime64("NaT") if is_time else np.nan, "datetime64[ns]" if is_time else np.float64
        )
        out[places[topic]] = [out.dtype.type("NaT" if is_time else "nan") if one is None else one for one in own]
        return out

    return table_of(path, list(names), column, columns)
