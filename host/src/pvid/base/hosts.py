"""Names of hosts, as a user types them."""

from __future__ import annotations

import socket
from typing import Any

from pvid.base.errors import PvidError
from pvid.base.wording import reason

Address = tuple[socket.AddressFamily, Any]


def addresses(host: str, port: int, kind: socket.SocketKind, otherwise: str) -> list[Address]:
    """Family and address of a host by its name.

    Raises PvidError when the name is invalid or cannot be resolved.

    Parameters
    ----------
    otherwise : how the sentence begins where there is none
    """
    try:
        return [(family, address) for family, _, _, _, address in socket.getaddrinfo(host, port, type=kind)]
    except UnicodeError as error:  # a part of it is empty or too long
        raise PvidError(f"{otherwise}: {host!a} is not a host's name") from error
    except OSError as error:
        raise PvidError(f"{otherwise}: {reason(error)}") from error
