"""The page and its live connection, on this machine only.

The server listens on the loopback interface. Page and connection have an unguessable word in their address
and the connection must come from the page itself, so that no other page that the browser shows can drive the
robot. It runs in a thread of its own: drawing needs the main thread on some systems.
"""

from __future__ import annotations

import asyncio
import contextlib
import hmac
import json
import queue
import secrets
import socket
import threading
import weakref
from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from http import HTTPStatus
from importlib.resources import files
from typing import Any, Final, TypeAlias

from mecanum_env.errors import BackendError, InputError, install_command

try:
    from websockets.asyncio.server import Server as WebsocketServer
    from websockets.asyncio.server import ServerConnection, serve
    from websockets.datastructures import Headers
    from websockets.exceptions import ConnectionClosed
    from websockets.http11 import Request, Response
    from websockets.protocol import State
    from websockets.typing import Origin
except ImportError as error:
    raise BackendError(f"the view needs websockets 13 or newer: {install_command('view')}") from error

HOST: Final = "127.0.0.1"
FIRST_PORT: Final = 8350
"""The port that is tried first where none is asked for, then those after it."""
_PORTS: Final = 50
_KINDS: Final = {
    "index.html": "text/html; charset=utf-8",
    "style.css": "text/css; charset=utf-8",
    "page.js": "text/javascript; charset=utf-8",
    "drive.js": "text/javascript; charset=utf-8",
    "plots.js": "text/javascript; charset=utf-8",
}
_LIVE: Final = "live"
_LARGEST_MESSAGE: Final = 4096  # characters; a message of the page has about a hundred
_TEXTS_KEPT: Final = 300  # for a page that does not read; the oldest are dropped
_ON_THE_WAY: Final = 2  # pictures sent and not yet seen, so that a slow browser gets fewer, and no older ones

Message: TypeAlias = dict[str, Any]
"""A message to or from a page; its "type" says what else it holds."""


@dataclass(eq=False)
class _Page:
    """What is on its way to one open page."""

    texts: deque[str] = field(default_factory=lambda: deque(maxlen=_TEXTS_KEPT))
    picture: bytes | None = None
    unseen: int = 0
    waiting: asyncio.Event = field(default_factory=asyncio.Event)


class Server:
    """Serves the page until it is closed; `hello` is what a page that opens is told first."""

    def __init__(self, port: int | None = None, hello: Message | None = None) -> None:
        self.hello: Message = hello or {}
        self._listening = _listen(port)
        self.port: int = self._listening.getsockname()[1]
        self._token = secrets.token_urlsafe(18)
        self._inbox: queue.SimpleQueue[Message] = queue.SimpleQueue()
        self._pages: set[_Page] = set()
        self._opened: weakref.WeakSet[ServerConnection] = weakref.WeakSet()
        self._contents = {name: (files(__package__) / "page" / name).read_bytes() for name in _KINDS}
        self._loop = asyncio.new_event_loop()
        self._stop = asyncio.Event()
        self._thread = threading.Thread(target=self._run, name="page", daemon=True)
        self._thread.start()

    @property
    def url(self) -> str:
        """Address of the page."""
        return f"http://{HOST}:{self.port}/{self._token}/"

    @property
    def watched(self) -> bool:
        """Whether a page is open."""
        return bool(self._pages)

    @property
    def wants_picture(self) -> bool:
        """Whether an open page has seen the pictures before, so that drawing another one makes sense."""
        return any(page.unseen < _ON_THE_WAY for page in tuple(self._pages))

    def messages(self) -> Iterator[Message]:
        """Yield what pages have sent since the last call; each message is a mapping with a "type"."""
        with contextlib.suppress(queue.Empty):
            while True:
                yield self._inbox.get_nowait()

    def publish(self, message: Mapping[str, Any] | None = None, picture: bytes | None = None) -> None:
        """Send a message and a picture to all open pages; a page gets the latest picture that it can take."""
        text = None if message is None else json.dumps(message, allow_nan=False)
        self._loop.call_soon_threadsafe(self._hand_out, text, picture)

    def close(self) -> None:
        """Close all connections and stop listening."""
        with contextlib.suppress(RuntimeError):  # the thread has ended by itself
            self._loop.call_soon_threadsafe(self._stop.set)
        self._thread.join(timeout=5.0)
        self._listening.close()

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        try:
            self._loop.run_until_complete(self._serve())
        finally:
            self._loop.close()

    async def _serve(self) -> None:
        opened = self._opened

        class Remembered(ServerConnection):
            def connection_made(self, transport: asyncio.BaseTransport) -> None:
                super().connection_made(transport)
                opened.add(self)

        own = [Origin(f"http://{name}:{self.port}") for name in (HOST, "localhost")]
        async with serve(
            self._attend,
            sock=self._listening,
            process_request=self._answer,
            origins=own,
            max_size=_LARGEST_MESSAGE,
            compression=None,
            close_timeout=1.0,
            create_connection=Remembered,
        ) as server:
            await self._stop.wait()
            await self._hang_up(server)

    async def _hang_up(self, server: WebsocketServer) -> None:
        server.close()
        # Browsers open connections in advance, and ask nothing through them.
        for connection in tuple(self._opened):
            if connection.state is State.CONNECTING:
                connection.transport.abort()
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(server.wait_closed(), timeout=2.0)

    def _answer(self, connection: ServerConnection, request: Request) -> Response | None:
        """Return a file of the page, "not found", or None for a connection to go on with."""
        token, _, name = request.path.partition("?")[0].lstrip("/").partition("/")
        if not hmac.compare_digest(token.encode(), self._token.encode()):
            return connection.respond(HTTPStatus.NOT_FOUND, "Not the address that was printed.\n")
        if name == _LIVE:
            return None
        name = name or "index.html"
        if name not in self._contents:
            return connection.respond(HTTPStatus.NOT_FOUND, "No such file.\n")
        body = self._contents[name]
        headers = Headers(
            {
                "Content-Type": _KINDS[name],
                "Content-Length": str(len(body)),
                "Cache-Control": "no-store",
                "Referrer-Policy": "no-referrer",
                "X-Content-Type-Options": "nosniff",
                "Content-Security-Policy": (
                    "default-src 'self'; img-src 'self' blob: data:; connect-src 'self' "
                    f"ws://{HOST}:{self.port} ws://localhost:{self.port}; frame-ancestors 'none'"
                ),
                "Connection": "close",
            }
        )
        return Response(HTTPStatus.OK, "OK", headers, body)

    async def _attend(self, connection: ServerConnection) -> None:
        page = _Page()
        page.texts.append(json.dumps(self.hello, allow_nan=False))
        page.waiting.set()
        sender = asyncio.create_task(_send(page, connection))
        self._pages.add(page)
        try:
            async for text in connection:
                message = _read(text)
                if message is None:
                    break
                if message["type"] == "seen":
                    page.unseen = max(0, page.unseen - 1)
                    page.waiting.set()
                else:
                    self._inbox.put(message)
        except ConnectionClosed:
            pass
        finally:
            self._pages.discard(page)
            sender.cancel()

    def _hand_out(self, text: str | None, picture: bytes | None) -> None:
        for page in self._pages:
            if text is not None:
                page.texts.append(text)
            page.picture = picture or page.picture
            page.waiting.set()


async def _send(page: _Page, connection: ServerConnection) -> None:
    with contextlib.suppress(ConnectionClosed):
        while True:
            await page.waiting.wait()
            page.waiting.clear()
            while page.texts:
                await connection.send(page.texts.popleft())
            if page.picture is not None and page.unseen < _ON_THE_WAY:
                picture, page.picture = page.picture, None
                page.unseen += 1
                await connection.send(picture)


def _read(text: str | bytes) -> Message | None:
    """Return a message of a page, or None for what no page of this project sends."""
    try:
        message = json.loads(text)
    except (ValueError, RecursionError):
        return None
    is_message = isinstance(message, dict) and isinstance(message.get("type"), str)
    return message if is_message else None


def _listen(port: int | None) -> socket.socket:
    """Return a socket that listens on this machine, on a port or on the first free one."""
    if port is not None and not 0 < port < 65536:
        raise InputError(f"port = {port}, must be 1 to 65535")
    for candidate in range(FIRST_PORT, FIRST_PORT + _PORTS) if port is None else [port]:
        try:
            return socket.create_server((HOST, candidate))
        except OSError as error:
            reason = error.strerror
    taken = f"{FIRST_PORT} to {FIRST_PORT + _PORTS - 1} are all" if port is None else f"{port} is"
    raise InputError(f"port {taken} not to be had ({reason}); give another one with --port")
