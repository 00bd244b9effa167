"""A page that has been left costs the server nothing: it does not grow with the number of loads."""

import os
import re
import socket
import subprocess
import sys
import urllib.request

import psutil
import pytest

from ac_ros_common.process_exit import PARENT_VARIABLE
from bringup.dash.server import listen
from bringup.launch.processes import ros_environment
from tests.live_browser import PATIENCE_S, until

#: A server that waits for ever for the web socket of a page: only a page that has been seen to leave is let go.
SERVER = "from bringup.dash import __main__, server; server.OPENING_MS = 10**9; __main__.main()"
WARM_UP, LOADS = 5, 15
#: A page that is kept takes 4.5 MB; several that are open at a time leave room behind for as many.
KEPT_MB = 4.5


def load(port: int) -> None:
    """Open the page as a browser does, stay until it shows something new, and leave."""
    with urllib.request.urlopen(f"http://127.0.0.1:{port}/", timeout=PATIENCE_S) as answer:
        token = re.search(r'"token":"([^"]+)"', answer.read().decode())
    assert token is not None
    with socket.create_connection(("127.0.0.1", port), timeout=PATIENCE_S) as connection:
        lines = [
            "GET /ws HTTP/1.1",
            f"Host: 127.0.0.1:{port}",
            "Upgrade: websocket",
            "Connection: Upgrade",
            "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
            "Sec-WebSocket-Version: 13",
            f"Sec-WebSocket-Protocol: bokeh, {token[1]}",
        ]
        connection.sendall("\r\n".join([*lines, "", ""]).encode())
        received = b""
        while b"PATCH-DOC" not in received:
            more = connection.recv(65536)
            assert more, received
            received += more


@pytest.mark.ros
def test_the_server_does_not_grow_with_page_loads() -> None:
    address = listen("127.0.0.1")
    (sock,) = address.sockets
    process = subprocess.Popen(
        [sys.executable, "-c", SERVER, str(address.door.port), "59", str(sock.fileno())],
        env={**os.environ, **ros_environment(), PARENT_VARIABLE: str(os.getpid())},
        pass_fds=[sock.fileno()],
    )
    try:
        server = psutil.Process(process.pid)
        for _ in range(WARM_UP):
            load(address.door.port)
        before = server.memory_info().rss
        for _ in range(LOADS):
            load(address.door.port)
        # Pages that have been left are looked for every five seconds.
        until(lambda: server.memory_info().rss - before < 0.5 * LOADS * KEPT_MB * 1e6, "pages that were left are kept")
    finally:
        process.terminate()
        process.wait(PATIENCE_S)
        sock.close()
