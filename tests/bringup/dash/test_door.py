"""Who is let in to the live page, and who is not."""

import re
import socket
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from ac_common.errors import UserError
from bringup.dash.server import Address, Door, listen, start_beside

LOCAL = Door(5006)
OPEN = Door(5006, "secret-token")


@pytest.mark.parametrize("host", ["127.0.0.1:5006", "localhost:5006", "LOCALHOST:5006", "[::1]:5006"])
def test_this_machine_is_let_in(host: str) -> None:
    assert LOCAL.refusal(host, None, ()) == ""
    assert LOCAL.refusal(host, f"http://{host}", ()) == ""


@pytest.mark.parametrize("host", ["evil.example:5006", "127.0.0.1:80", "127.0.0.1", "", "127.0.0.1.evil.example:5006"])
def test_another_name_for_this_machine_is_refused(host: str) -> None:
    """A name that its owner's DNS points at 127.0.0.1: the browser takes the page for that owner's."""
    assert "this machine alone" in LOCAL.refusal(host, None, ())
    assert LOCAL.refusal(host, f"http://{host}", ())


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "http://127.0.0.1:8080", "null", "http://localhost:5006.evil.example", ""]
)
def test_another_web_page_is_refused(origin: str) -> None:
    assert "no other web page" in LOCAL.refusal("127.0.0.1:5006", origin, ())
    assert OPEN.refusal("car.example:5006", origin, ("secret-token",))


def test_beyond_this_machine_it_takes_the_token() -> None:
    host = "car.example:5006"
    assert OPEN.refusal(host, None, ("secret-token",)) == ""
    assert OPEN.refusal(host, f"http://{host}", (None, "secret-token")) == ""
    for tokens in ((), (None,), ("",), ("secret-toke",), ("secret-tokenx",), ("sécret",)):
        assert "token" in OPEN.refusal(host, None, tokens)


def test_a_token_is_made_when_it_is_needed_and_never_the_same() -> None:
    alone, *others = (listen(host) for host in ("127.0.0.1", "0.0.0.0", "0.0.0.0"))
    try:
        assert alone.door.token == ""
        assert "token" not in alone.url
        tokens = {address.door.token for address in others}
        assert len(tokens) == 2
        assert all(len(token) >= 32 for token in tokens)
        assert all(address.url.endswith(f"?token={address.door.token}") for address in others)
        assert len({address.door.port for address in (alone, *others)}) == 3  # a port that is taken is passed over
    finally:
        for address in (alone, *others):
            for sock in address.sockets:
                sock.close()


def test_what_cannot_be_bound_is_said_in_one_line() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(UserError, match=f"--port {port}: Address already in use"):
            listen("127.0.0.1", port)
    with pytest.raises(UserError, match="no address of this machine"):
        listen("no.such.host.invalid")
    with pytest.raises(UserError, match="--host 192"):
        listen("192.0.2.1")


# ------------------------------------------------------------------------------------------- the real server


@contextmanager
def serving(host: str) -> Iterator[Address]:
    """Give a page beside no graph at all."""
    address = listen(host)
    process = start_beside(address, 59)
    try:
        yield address
    finally:
        process.terminate()
        assert process.wait(20) == 0
        for sock in address.sockets:
            sock.close()


def get(address: Address, path: str = "/", **headers: str) -> tuple[int, str, dict[str, str]]:
    """Answer, its text and its headers; nothing is followed."""

    class Stay(urllib.request.HTTPRedirectHandler):
        def redirect_request(self, *_: object) -> None:
            return None

    request = urllib.request.Request(f"http://127.0.0.1:{address.door.port}{path}", headers=headers)
    try:
        with urllib.request.build_opener(Stay).open(request, timeout=60) as answer:
            return answer.status, answer.read().decode(), dict(answer.headers)
    except urllib.error.HTTPError as refused:
        return refused.code, refused.read().decode(), dict(refused.headers)


def token_in(page: str) -> str:
    """What a page that has been loaded shows when it opens its socket."""
    found = re.search(r'"token":"([^"]+)"', page)
    assert found is not None
    return found[1]


def handshake(address: Address, page: str, **headers: str) -> int:
    """Status of an attempt of a page to open the socket over which the controls go."""
    with socket.create_connection(("127.0.0.1", address.door.port), timeout=60) as connection:
        fields = {
            "Host": f"127.0.0.1:{address.door.port}",
            "Upgrade": "websocket",
            "Connection": "Upgrade",
            "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==",
            "Sec-WebSocket-Version": "13",
            "Sec-WebSocket-Protocol": f"bokeh, {token_in(page)}",
            **headers,
        }
        lines = ["GET /ws HTTP/1.1", *(f"{name}: {value}" for name, value in fields.items()), "", ""]
        connection.sendall("\r\n".join(lines).encode())
        return int(connection.recv(64).split()[1])


@pytest.mark.ros
def test_a_page_for_this_machine_answers_this_machine_only() -> None:
    with serving("127.0.0.1") as address:
        port = address.door.port
        status, text, headers = get(address)
        assert status == 200
        page = text
        assert "acftc live" in text
        assert headers["X-Frame-Options"] == "DENY"
        assert "frame-ancestors 'none'" in headers["Content-Security-Policy"]
        # Nothing of the page is from anywhere else.
        assert "https://" not in text.replace("https://bokeh.org", "")
        status, text, _ = get(address, Host="evil.example")
        assert status == 403
        assert text.startswith("acftc: this page is for this machine alone")
        assert get(address, "/static/js/bokeh.min.js", Host="evil.example")[0] == 403
        assert get(address, "/autoload.js?bokeh-autoload-element=x", Origin="http://evil.example")[0] == 403
        assert handshake(address, page, Origin="http://evil.example") == 403
        assert handshake(address, page, Origin=f"http://evil.example:{port}", Host=f"evil.example:{port}") == 403
        assert handshake(address, page, Origin=f"http://127.0.0.1:{port}") == 101


@pytest.mark.ros
def test_a_page_of_an_earlier_server_is_refused() -> None:
    with serving("127.0.0.1") as earlier:
        _, stale, _ = get(earlier)
    with serving("127.0.0.1") as address:
        _, page, _ = get(address)
        assert handshake(address, stale) == 403
        assert handshake(address, page) == 101


@pytest.mark.ros
def test_a_page_for_others_wants_the_token_once() -> None:
    with serving("0.0.0.0") as address:
        door = address.door
        for path in ("/", "/?token=wrong", "/static/js/bokeh.min.js", "/ws"):
            status, text, _ = get(address, path)
            assert status == 403, path
            assert "token" in text
        status, _, headers = get(address, f"/?token={door.token}")
        assert status == 302
        assert headers["Location"] == "/"  # so that it does not stay in the address bar
        cookie = headers["Set-Cookie"].split(";")[0]
        assert {"httponly", "samesite=lax"} <= {part.strip().lower() for part in headers["Set-Cookie"].split(";")}
        status, page, _ = get(address, Cookie=cookie)
        assert status == 200
        assert get(address, Cookie=f"{door.cookie}=wrong")[0] == 403
        # A link with another token does not lock out a browser that has the right one.
        status, _, headers = get(address, "/?token=wrong", Cookie=cookie)
        assert (status, headers["Location"]) == (302, "/")
        assert "Set-Cookie" not in headers
        origin = f"http://127.0.0.1:{door.port}"
        assert handshake(address, page, Origin=origin) == 403
        assert handshake(address, page, Origin=origin, Cookie=cookie) == 101
        assert handshake(address, page, Origin="http://evil.example", Cookie=cookie) == 403
