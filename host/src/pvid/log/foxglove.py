"""A live server for Foxglove: the tables of a log as topics, the latest estimate as parameters.

Foxglove connects to `ws://HOST:PORT` ("Open connection", "Foxglove WebSocket"). The server is that of foxglove-sdk;
its protocol is documented at github.com/foxglove/ws-protocol. The topics, fields, units and times are those of
`pvid export --to mcap`, so a layout of `pvid layout` fits both.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from pvid.base.errors import PvidError
from pvid.base.packages import installing
from pvid.link.frames import Loss
from pvid.log.json_messages import encoded, messages, schema, topic, units
from pvid.log.mechanism import UNNAMED, LogMechanism
from pvid.log.reader import Account, Record
from pvid.log.values import Rows, Tables, Values

if TYPE_CHECKING:
    from foxglove import Channel, Parameter


class FoxgloveServer:
    """An observer that serves the rows of a log to every Foxglove that connects.

    A parameter of the mechanism is also one of Foxglove's: `R` and, for its standard error, `R_se`. A client that
    connects late gets the latest values of these and all later rows; a slow client misses rows, the log does not.

    Raises PvidError when foxglove-sdk is not installed or the address cannot be used.

    Parameters
    ----------
    address : as given, for messages
    mechanism : of the rig; without its constants no outputs are served
    """

    def __init__(self, address: str, host: str, port: int, mechanism: LogMechanism = UNNAMED) -> None:
        try:
            import foxglove
            from foxglove.websocket import Capability, ServerListener
        except ImportError as error:
            raise PvidError(f"{address} needs foxglove-sdk: {installing('foxglove')}") from error
        self._foxglove = foxglove
        foxglove.set_log_level("ERROR")  # it reports every client that comes and goes
        self._context = foxglove.Context()
        self._values = Values(mechanism, follows=mechanism is UNNAMED)
        self._tables: Tables = {}
        self._channels: dict[str, Channel] = {}
        self._parameters: dict[str, Parameter] = {}
        named = self._named

        class Listener(ServerListener):
            """Answers the clients' requests, in a thread of the SDK."""

            def on_get_parameters(
                self, client: Any, param_names: list[str], request_id: str | None = None
            ) -> list[Parameter]:
                return named(param_names)

        try:
            self._server = foxglove.start_server(
                name="pvid",
                host=host,
                port=port,
                context=self._context,
                capabilities=[Capability.Parameters],
                server_listener=Listener(),
            )
        except RuntimeError as error:
            raise PvidError(f"cannot serve {address}: {str(error).removeprefix('FoxgloveError: ')}") from error

    def take(self, record: Record, account: Account) -> None:
        """See logreader.Observer."""
        if isinstance(record.item, Loss):
            return  # of which a line in trouble has many
        for rows in self._values.rows(record):
            if rows.table in ("events", "status") and self._values.follows and self._values.mechanism is UNNAMED:
                continue  # the topics are those of the mechanism, which the board is about to name
            self._advertise()
            if rows.table == "estimates":
                self._publish(rows)
            channel = self._channels[rows.table]
            if channel.has_sinks():
                for when, message in messages(rows, self._tables):
                    channel.log(encoded(message), log_time=when)

    def idle(self, account: Account) -> None:
        """See logreader.Observer."""

    def close(self, account: Account) -> None:
        """See logreader.Observer."""
        self._server.stop()

    def _advertise(self) -> None:
        """The topics; anew when the board has named another mechanism."""
        if self._tables is self._values.tables:
            return
        for channel in self._channels.values():
            channel.close()
        self._tables, self._parameters = self._values.tables, {}
        self._channels = {
            table: self._foxglove.Channel(
                topic(table), schema=schema(table, columns), metadata=units(columns), context=self._context
            )
            for table, columns in self._tables.items()
        }

    def _publish(self, rows: Rows) -> None:
        """The latest estimate, as parameters."""
        names = [one.name for one in self._values.mechanism.answers]
        values = {name: float(rows.columns[name][-1]) for one in names for name in (one, f"{one}_se")}
        self._parameters = {
            name: self._foxglove.Parameter(name, value=value) for name, value in values.items() if math.isfinite(value)
        }
        self._server.publish_parameter_values(list(self._parameters.values()))

    def _named(self, names: list[str]) -> list[Parameter]:
        """The parameters that a client names, or all."""
        known = self._parameters
        return [known[name] for name in names if name in known] if names else list(known.values())
