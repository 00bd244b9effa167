"""Serves the page, and keeps out who has no business there.

Bokeh's server does the serving: its scripts come from its own package, so there is no build step and no network, and
`ColumnDataSource.stream` with a rollover is a time plot that does not grow. In front of it stands a gate that looks at
every request, the web socket's included:

- its Host must be one of this machine's names when the page is bound to this machine alone: a name that somebody else's
  DNS has pointed at 127.0.0.1 gets nothing;
- its Origin, when it has one, must be the page itself: no other web page can open the socket over which faults go;
- when the page is bound to more than this machine, it must know the token;
- a web socket must be of a page that this server has made: one of an earlier server at this port would speak of objects
  that do not exist.

No page may put this one into a frame, so nobody can be lured into clicking in it.
"""

import hmac
import ipaddress
import os
import secrets
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any
from urllib.parse import urlsplit

from ac_common.errors import UserError

#: Tried first when no port is asked for.
USUAL_PORT = 5006
#: In the environment of a page's process: its token.
TOKEN_VARIABLE = "ACFTC_DASH_TOKEN"
#: Names under which a browser on this machine knows it.
LOCAL_NAMES = ("127.0.0.1", "localhost", "[::1]")
#: What a page may do in the browser: nothing that leads to anybody else.
POLICY = (
    "default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval'; style-src 'self' 'unsafe-inline'; "
    "img-src 'self' data: blob:; font-src 'self' data:; connect-src 'self'; frame-ancestors 'none'; form-action 'none'"
)
#: What of Bokeh's scripts the page needs; those for tables, formulas and WebGL are more than all of these.
SCRIPTS: list[Any] = ["bokeh", "bokeh-widgets"]
#: How long a page may take from its first line to its web socket, ms; then it has to be made anew.
OPENING_MS = 60_000


#: How often pages that nobody looks at any more are let go, ms.
LOOK_MS = 5_000


@dataclass(frozen=True)
class Door:
    """Who is let in.

    Attributes
    ----------
    port : int
    token : str
        Empty when the page is bound to this machine alone and anybody on it may come in.
    """

    port: int
    token: str = ""

    @property
    def cookie(self) -> str:
        """Name of the cookie that holds the token: cookies do not distinguish ports."""
        return f"acftc-dash-{self.port}"

    def knows(self, tokens: Iterable[str | None]) -> bool:
        """Return whether one of these is the token."""
        return any(hmac.compare_digest((given or "").encode(), self.token.encode()) for given in tokens)

    def refusal(self, host: str, origin: str | None, tokens: tuple[str | None, ...]) -> str:
        """Return why a request is refused, empty when it is not.

        Parameters
        ----------
        host, origin : str
            Its headers `Host` and `Origin`; None: it has no origin, as when somebody types the address.
        tokens : tuple of str or None
            What it says the token is, in its cookie or its address.
        """
        if not self.token and host.lower() not in {f"{name}:{self.port}" for name in LOCAL_NAMES}:
            return f"this page is for this machine alone: http://127.0.0.1:{self.port}/"
        if origin is not None and urlsplit(origin).netloc.lower() != host.lower():
            return "this page answers no other web page"
        if self.token and not self.knows(tokens):
            return "open the address with the token that acftc dash has printed"
        return ""


@dataclass(frozen=True)
class Address:
    """Where the page is, already listening.

    Attributes
    ----------
    sockets : list of socket
    door : Door
    url : str
        For the browser, token included.
    """

    sockets: list[socket.socket]
    door: Door
    url: str


def listen(host: str = "127.0.0.1", port: int = 0) -> Address:
    """Listen, so that the address is known before anything else takes its time.

    Parameters
    ----------
    host : str
        Address to bind to. Another than this machine's own makes a token.
    port : int
        0: the usual one, or any that is free.

    Raises
    ------
    UserError
        When the address cannot be had.
    """
    from tornado.netutil import bind_sockets

    sockets: list[socket.socket] = []
    for tried in [port] if port else [USUAL_PORT, 0]:
        try:
            sockets = bind_sockets(tried, host, family=socket.AF_INET6 if ":" in host else socket.AF_INET)
            break
        except socket.gaierror:
            msg = f"--host {host}: no address of this machine"
            raise UserError(msg) from None
        except OSError as problem:
            if tried == 0 or port:
                msg = f"--host {host} --port {tried}: {os.strerror(problem.errno or 0)}"
                raise UserError(msg) from None
    bound = int(sockets[0].getsockname()[1])
    token = "" if _is_loopback(host) else secrets.token_urlsafe(24)
    shown = {"0.0.0.0": socket.gethostname(), "::": socket.gethostname()}.get(host, host)
    name = f"[{shown}]" if ":" in shown else shown
    url = f"http://{name}:{bound}/" + (f"?token={token}" if token else "")
    return Address(sockets, Door(bound, token), url)


def _is_loopback(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def open_browser(url: str) -> None:
    """Open the user's browser where there is a screen for it: one for the terminal would take the terminal."""
    import webbrowser

    if any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER")):
        threading.Thread(target=webbrowser.open, args=(url,), daemon=True).start()


def start_beside(address: Address, domain: int) -> subprocess.Popen[bytes]:
    """Serve a page in a process of its own, beside the graph in a ROS domain; it ends with this process."""
    from ac_ros_common.process_exit import PARENT_VARIABLE
    from bringup.launch.processes import ros_environment

    numbers = [sock.fileno() for sock in address.sockets]
    return subprocess.Popen(
        [sys.executable, "-m", "bringup.dash", str(address.door.port), str(domain), *map(str, numbers)],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        env={
            **os.environ,
            **ros_environment(),
            TOKEN_VARIABLE: address.door.token,
            PARENT_VARIABLE: str(os.getpid()),
        },
        pass_fds=numbers,
        process_group=0,
    )


def serve(address: Address, link: Any, problem: Any = lambda: "") -> None:
    """Serve the page until SIGINT or SIGTERM.

    Parameters
    ----------
    address : Address
    link : Link
        The page's ROS node.
    problem : callable
        What is wrong with the graph, empty when nothing is.
    """
    import asyncio
    import logging

    from bokeh.application import Application
    from bokeh.application.handlers.function import FunctionHandler
    from bokeh.resources import Resources
    from bokeh.server.server import BaseServer
    from bokeh.server.tornado import BokehTornado
    from tornado.httpserver import HTTPServer
    from tornado.ioloop import IOLoop

    from bringup.dash.page import make_page

    class App(BokehTornado):
        def resources(self, absolute_url: str | bool | None = None) -> Resources:
            return super().resources(absolute_url).clone(components=SCRIPTS)

    for name in ("bokeh", "tornado.access"):  # who comes and goes is nobody's business
        logging.getLogger(name).setLevel(logging.ERROR)
    tornado_app = App(
        {"/": Application(FunctionHandler(make_page(link, problem)))},
        sign_sessions=True,
        secret_key=secrets.token_bytes(32),
        extra_websocket_origins=["*"],  # the gate has looked at the origin, and more strictly
        transforms=[_headers()],
        websocket_max_message_size_bytes=1 << 20,
        stats_log_frequency_milliseconds=3_600_000,
        unused_session_lifetime_milliseconds=OPENING_MS,
        check_unused_sessions_milliseconds=LOOK_MS,
        default_host=None,
    )
    http = HTTPServer(_gate(tornado_app, address.door))
    http.add_sockets(address.sockets)
    loop = IOLoop.current()
    server = BaseServer(loop, tornado_app, http)
    server.start()
    for number in (signal.SIGINT, signal.SIGTERM):
        asyncio.get_event_loop().add_signal_handler(number, loop.stop)
    loop.start()
    server.stop()


def _gate(app: Any, door: Door) -> Any:
    """Make the router that stands before `app`."""
    from bokeh.util.token import check_token_signature
    from tornado.routing import Router
    from tornado.web import Application, RequestHandler

    class Refused(RequestHandler):
        def prepare(self) -> None:
            self.set_status(403)
            self.set_header("Content-Type", "text/plain; charset=utf-8")
            self.finish(f"acftc: {why(self.request)}\n")

    class WithToken(RequestHandler):
        def prepare(self) -> None:
            if door.knows(
                self.get_query_arguments("token", strip=False)
            ):  # not a wrong one over a cookie that is right
                self.set_cookie(door.cookie, door.token, httponly=True, samesite="Lax")
            self.redirect("/")

    refused, with_token = Application([(".*", Refused)]), Application([(".*", WithToken)])

    def why(request: Any) -> str:
        cookie = request.cookies.get(door.cookie)
        refusal = door.refusal(
            request.headers.get("Host", ""),
            request.headers.get("Origin"),
            (cookie.value if cookie else None, *given(request)),
        )
        if not refusal and request.path == "/ws" and not is_ours(request.headers.get("Sec-WebSocket-Protocol", "")):
            return "this page is of an earlier server: load it anew"
        return refusal

    def is_ours(protocols: str) -> bool:
        return check_token_signature(protocols.rpartition(",")[2].strip(), app.secret_key, signed=True)

    def given(request: Any) -> tuple[str, ...]:
        return tuple(value.decode(errors="replace") for value in request.query_arguments.get("token", []))

    class Gate(Router):
        def find_handler(self, request: Any, **kwargs: Any) -> Any:
            if why(request):
                return refused.find_handler(request, **kwargs)
            if door.token and given(request):
                return with_token.find_handler(request, **kwargs)
            return app.find_handler(request, **kwargs)

    return Gate()


def _headers() -> Any:
    """Make the transform that puts our headers on every answer."""
    from tornado.web import OutputTransform

    class Headers(OutputTransform):
        def transform_first_chunk(
            self, status_code: int, headers: Any, chunk: bytes, finishing: bool
        ) -> tuple[int, Any, bytes]:
            headers["Content-Security-Policy"] = POLICY
            headers["X-Frame-Options"] = "DENY"
            headers["X-Content-Type-Options"] = "nosniff"
            headers["Referrer-Policy"] = "no-referrer"
            headers["Cache-Control"] = headers.get("Cache-Control", "no-store")
            return super().transform_first_chunk(status_code, headers, chunk, finishing)

    return Headers
