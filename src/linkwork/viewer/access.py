"""Who is let in: the viewer's address with its token, and what of a browser's requests is answered.

Any page that a user visits may send requests to this computer, and a websocket is not kept from
other origins by browsers. So the address holds a token that nobody else knows; with it the page is
given and a cookie set, and without either nothing is: no page, no websocket. A websocket that a
page of another origin opens is refused even so. Both are checked by the server before viser sees
anything.
Sources: RFC 6455, sec. 10.2 (origins of websockets); RFC 6265 (cookies).
"""

from __future__ import annotations

import errno
import hmac
import secrets
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http import HTTPStatus
from http.cookies import CookieError, SimpleCookie
from threading import Lock
from typing import TYPE_CHECKING, Any
from urllib.parse import parse_qs, urlsplit

from linkwork.errors import LinkworkError

if TYPE_CHECKING:
    import viser

PORT, PORTS = 8080, 50
LOOPBACK = "127.0.0.1"
UNAVAILABLE = (errno.EADDRNOTAVAIL,)
MISSING = "the viewer needs viser; install linkwork with its extra: pip install 'linkwork[viewer]'"
UNGUARDED = (
    "this version of viser cannot be kept from strangers' pages; install the one that linkwork "
    "was tested with"
)
NO_TOKEN = "This page needs the whole address that linkwork printed, with its token.\n"
OTHER_ORIGIN = "Pages of another origin cannot reach the viewer.\n"
BUILDING = Lock()


@dataclass(frozen=True)
class Door:
    """Let in who knows the token; cookie: name under which a browser remembers it."""

    cookie: str
    token: str = field(default_factory=lambda: secrets.token_urlsafe(16), repr=False)

    def refusal(self, path: str, headers: Any) -> str | None:
        """Return why a request is not answered, None where it is.

        Args:
            path: of the request, with what follows the question mark.
            headers: of the request, by name; any number of each.
        """
        upgrade, origins, hosts = (headers.get_all(name) for name in ("Upgrade", "Origin", "Host"))
        if upgrade and any(urlsplit(origin).netloc not in hosts for origin in origins):
            return OTHER_ORIGIN
        return None if any(map(self._fits, self._keys(path, headers))) else NO_TOKEN

    @property
    def remembered(self) -> str:
        """The header by which a browser remembers the token, for this address alone."""
        return f"{self.cookie}={self.token}; Path=/; HttpOnly; SameSite=Strict"

    def _keys(self, path: str, headers: Any) -> Iterator[str]:
        yield from parse_qs(urlsplit(path).query).get("token", ())
        for text in headers.get_all("Cookie"):
            try:
                found = SimpleCookie(text).get(self.cookie)
            except CookieError:
                continue
            if found is not None:
                yield found.value

    def _fits(self, key: str) -> bool:
        return hmac.compare_digest(key.encode(), self.token.encode())


def serve(host: str, port: int | None) -> tuple[viser.ViserServer, str]:
    """Listen at an address, on a port that must be free, or the first free one from 8080 on; return
    the page's address, too.

    Raises:
        LinkworkError: the port is in use or no port, the address is none of this computer, viser is
            not installed.
    """
    try:
        import viser
    except ImportError:
        raise LinkworkError(MISSING) from None
    free = free_port(host, port)
    door, used = Door(f"linkwork-{free}"), []
    with kept(door, used), silent():
        server = viser.ViserServer(host=host, port=free, verbose=False)
    if not used:
        server.stop()
        raise LinkworkError(UNGUARDED)
    return server, f"http://{shown_host(host)}:{server.get_port()}/?token={door.token}"


@contextmanager
def silent() -> Iterator[None]:
    """Keep viser, which prints by Rich wherever that prints to, from telling an address without the
    token: nobody is let in there."""
    import rich

    console = rich.get_console()
    before, console.quiet = console.quiet, True
    try:
        yield
    finally:
        console.quiet = before


@contextmanager
def kept(door: Door, used: list[Door]) -> Iterator[None]:
    """Have what listens for websockets meanwhile ask the door first, and tell in `used` that it
    does.

    viser hands on no request to judge, so the function that it calls to listen is exchanged while
    its server is made.
    """
    import websockets.asyncio.server as websockets

    listen = websockets.serve

    def guarded(*places: Any, process_request: Callable[..., Any], **options: Any) -> Any:
        used.append(door)
        return listen(*places, process_request=asking(door, process_request), **options)

    with BUILDING:
        websockets.serve = guarded  # pyright: ignore[reportAttributeAccessIssue]
        try:
            yield
        finally:
            websockets.serve = listen


def asking(door: Door, answer: Callable[..., Any]) -> Callable[..., Any]:
    """Return a way to answer requests that asks the door first, and has browsers remember the
    token."""

    def asked(connection: Any, request: Any) -> Any:
        refusal = door.refusal(request.path, request.headers)
        if refusal is not None:
            return connection.respond(HTTPStatus.FORBIDDEN, refusal)
        response = answer(connection, request)
        if response is not None:
            response.headers["Set-Cookie"] = door.remembered
        return response

    return asked


def free_port(host: str, port: int | None) -> int:
    """Return the port where it is free, the first free one from 8080 on where none is given.

    Raises:
        LinkworkError: the port is in use or no port, or the address is none of this computer.
    """
    # The one that is asked for, or the first free one.
    if port is not None and not 0 <= port < 65536:
        raise LinkworkError(f"port {port} is none; give a number from 1 to 65535")
    for candidate in range(PORT, PORT + PORTS) if port is None else (port,):
        try:
            family, kind, _, _, address = socket.getaddrinfo(
                host, candidate, type=socket.SOCK_STREAM
            )[0]
            with socket.socket(family, kind) as probe:
                probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
                probe.bind(address)
                return candidate
        # Faults that another port would not cure.
        except socket.gaierror:
            raise LinkworkError(
                f"there is no address {host!r}; give one of this computer, such as {LOOPBACK}"
            ) from None
        except PermissionError:
            raise LinkworkError(
                f"port {candidate} is not free to use here; give one from 1024 on"
            ) from None
        except OSError as error:
            if error.errno in UNAVAILABLE:
                raise LinkworkError(
                    f"{host} is no address of this computer; give one that is, such as {LOOPBACK}"
                ) from None
            continue
    # All of them are taken.
    if port is None:
        raise LinkworkError(
            f"the ports {PORT} to {PORT + PORTS - 1} on {host} are all in use; give another one"
        )
    raise LinkworkError(
        f"port {port} on {host} is in use; give another one, or none for the next free one"
    )


def shown_host(host: str) -> str:
    """Return the address as browsers on this computer reach it."""
    if host in ("0.0.0.0", "::", ""):
        return "localhost"
    return f"[{host}]" if ":" in host else host
