"""`pvid log --web` and `pvid view`: the page of a log.

A separate process serves it and follows the log like any other reader.

The page requests the next state when it has drawn the last one: a slow browser skips states, and no queue grows. The
recording neither waits for this process nor shares its memory, and it has the higher priority.

    python -m pvid.show.page FD LOG TITLE ADDRESS    serves on the listening socket FD until its standard input ends
"""

from __future__ import annotations

import contextlib
import importlib.util
import os
import re
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from ipaddress import ip_address
from pathlib import Path
from urllib.parse import urlsplit

from pvid.base.errors import PvidError
from pvid.base.hosts import addresses
from pvid.base.packages import installing
from pvid.base.wording import reason

DEFAULT = "127.0.0.1:8765"
_LOOPBACK = ("127.0.0.1", "::1", "localhost")
_ASSETS = Path(__file__).parent / "web"
_TYPES = {".html": "text/html; charset=utf-8", ".js": "text/javascript", ".css": "text/css"}
_NICENESS = 5
_MOST_CLIENTS = 32
# Requests go to this server only; uPlot sets styles in place.
_POLICY = (
    "default-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; frame-ancestors 'none'; "
    "base-uri 'none'; form-action 'none'"
)


def listen(at: str) -> tuple[socket.socket, str]:
    """A listening socket at HOST:PORT and the address of its page; port 0 is any that is free.

    Raises PvidError when it is no HOST:PORT, or cannot be listened to.
    """
    match = re.fullmatch(r"(\[[0-9A-Fa-f:.]+\]|[^\[\]:/\s]+):(\d{1,5})", at)
    if match is None or int(match[2]) > 65535:
        raise PvidError(f"--web takes HOST:PORT, as in {DEFAULT}, and {at!r} is none")
    host, port = match[1].strip("[]"), int(match[2])
    refused = f"cannot serve the live page at {at}"
    family, address = addresses(host, port, socket.SOCK_STREAM, refused)[0]
    try:
        listening = socket.create_server(address[:2], family=family)
    except OSError as error:
        raise PvidError(f"{refused}: {reason(error)}") from error
    shown = f"[{host}]" if ":" in host else host
    return listening, f"http://{shown}:{listening.getsockname()[1]}/"


def is_local(address: str) -> bool:
    """Whether only this machine can see the page of that address."""
    host = re.sub(r"^http://\[?(.*?)\]?:\d+/$", r"\1", address)
    return host in _LOOPBACK


@contextlib.contextmanager
def page(at: str, log: Path, title: str) -> Iterator[str]:
    """Serves the live page of a log while the context lasts; yields its address.

    Raises PvidError as `listen`, and when the packages of the extra `page` are not installed.
    """
    lacking = [name for name in ("starlette", "uvicorn") if importlib.util.find_spec(name) is None]
    if lacking:
        raise PvidError(f"the live page needs {' and '.join(lacking)}: {installing(*lacking)}")
    listening, address = listen(at)
    command = [sys.executable, "-P", "-m", "pvid.show.page", str(listening.fileno()), str(log), title, address]
    with listening, open(os.devnull, "wb") as nowhere:
        process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,  # its end signals the end of this program
            stdout=nowhere,
            stderr=nowhere,
            pass_fds=[listening.fileno()],
            start_new_session=True,  # Ctrl-C ends the recording, and that ends the page
        )
    try:
        yield address
    finally:
        process.kill()
        process.communicate()


def own_names(listening: socket.socket, address: str) -> Callable[[str], bool]:
    """Whether the `Host` of a request is this page: the name of a page elsewhere that is made to point here is not.

    Where only this machine can see the page, its loopback names; else any address by number, which no name server gave,
    the names of this machine, and the one that `--web` was given.
    """
    names = {*_LOOPBACK}
    local = listening.getsockname()[0] in _LOOPBACK
    if not local:
        host = socket.gethostname().lower()
        names |= {host, f"{host}.local", socket.getfqdn().lower(), (urlsplit(address).hostname or "").lower()}

    def is_own(given: str) -> bool:
        host = re.sub(r":\d*$", "", given).strip("[]").lower().rstrip(".")
        if host in names:
            return True
        with contextlib.suppress(ValueError):
            return not local and bool(ip_address(host))
        return False

    return is_own


def _serve(listening: socket.socket, log: Path, title: str, address: str) -> None:
    import uvicorn
    from starlette.applications import Starlette
    from starlette.middleware import Middleware
    from starlette.requests import Request
    from starlette.responses import FileResponse, HTMLResponse, PlainTextResponse, Response
    from starlette.routing import Route
    from starlette.types import ASGIApp, Receive, Scope, Send

    from pvid.show.page_state import LiveState
    from pvid.show.patience import Impatient

    state = LiveState(log, title)
    headers = {"Content-Security-Policy": _POLICY, "Cache-Control": "no-store", "X-Content-Type-Options": "nosniff"}

    def asset(path: Path) -> Route:
        def respond(_: Request) -> Response:
            return FileResponse(path, media_type=_TYPES[path.suffix], headers=headers)

        return Route("/" if path.suffix == ".html" else f"/{path.name}", respond)

    def respond_report(_: Request) -> Response:
        from pvid.show.log_report import report_of_log

        try:
            return HTMLResponse(report_of_log(log), headers=headers)
        except PvidError as error:
            return PlainTextResponse(f"There is no report: {error}", 422, headers)

    def respond_state(_: Request) -> Response:
        return Response(state.as_json(), media_type="application/json", headers=headers)

    is_own = own_names(listening, address)

    class Guard:
        """Answers requests for this page alone."""

        def __init__(self, app: ASGIApp) -> None:
            self._app = app

        async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
            given = dict(scope.get("headers", ())).get(b"host", b"").decode("latin-1")
            answer = self._app if scope["type"] != "http" or is_own(given) else PlainTextResponse("Invalid host", 400)
            await answer(scope, receive, send)

    files = [one for one in sorted(_ASSETS.iterdir()) if one.suffix in _TYPES]
    routes = [*map(asset, files), Route("/state", respond_state), Route("/report", respond_report)]
    application = Starlette(routes=routes, middleware=[Middleware(Guard)])
    state.start()
    settings = uvicorn.Config(
        application, http=Impatient, ws="none", log_level="critical", limit_concurrency=_MOST_CLIENTS, lifespan="off"
    )
    uvicorn.Server(settings).run(sockets=[listening])


def _end_with_input() -> None:
    sys.stdin.buffer.read()
    os._exit(0)


def main() -> None:
    """See the module."""
    number, log, title, address = sys.argv[1:]
    os.nice(_NICENESS)
    threading.Thread(target=_end_with_input, daemon=True).start()
    _serve(socket.socket(fileno=int(number)), Path(log), title, address)


if __name__ == "__main__":
    main()
