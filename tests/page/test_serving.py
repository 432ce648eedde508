"""The server of pages: whom it answers, by raw requests to a real one."""

import asyncio
import errno
import gc
import signal
import socket

import pytest
from scene_texts import TEXT

pytest.importorskip("panel")
from tornado.websocket import WebSocketClosedError

from graded_contact.page.serving import new_server

HOST = socket.gethostname()
SOCKET = (
    "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
    "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
)
OWN = ["127.0.0.1", "localhost", "LOCALHOST", HOST, "[::1]", "192.0.2.7"]
FOREIGN = ["evil.example", "localhost.evil.example", "127.0.0.1.evil.example", "1.2.3", "[evil]"]


async def answer(port, path, host, *headers):
    """The first line and the headers with which the server answers a request."""
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    lines = [f"GET {path} HTTP/1.1", f"Host: {host}", *headers]
    writer.write("\r\n".join([*lines, "", ""]).encode())
    head = (await reader.readuntil(b"\r\n\r\n")).decode().splitlines()
    writer.close()
    return head[0], dict(line.split(": ", 1) for line in head[1:] if line)


async def status(port, path, host, *headers):
    """The status of an answer."""
    first, _ = await answer(port, path, host, *headers)
    return int(first.split()[1])


def served(folder, check, address="127.0.0.1", **options):
    """Runs `check` of the port of a server of a scene."""
    scene = folder / "scene.toml"
    scene.write_text(TEXT, encoding="utf-8")

    async def run():
        before = signal.getsignal(signal.SIGINT)
        server = new_server(scene, folder / "out", address=address, port=0, show=False, **options)
        signal.signal(signal.SIGINT, before)
        server.start()
        try:
            await check(server.port)
        finally:
            server.stop()

    asyncio.run(run())


def test_pages_of_other_sites_are_refused_by_their_name(tmp_path):
    async def check(port):
        for host in [*(f"{name}:{port}" for name in OWN), "localhost:80"]:  # the last of a tunnel
            assert await status(port, "/", host) == 200, host
            for scheme in ("http", "https"):  # the latter behind a proxy
                own = f"Origin: {scheme}://{host}"
                assert await status(port, "/ws", host, own, SOCKET) == 101, host
            for origin in ("http://evil.example", f"http://{host}.evil.example", "null", "", "\\"):
                headers = (f"Origin: {origin}", SOCKET)
                assert await status(port, "/ws", host, *headers) == 403, (host, origin)
            assert await status(port, "/ws", host, SOCKET) == 403, host
            foreign = "Origin: http://evil.example"
            assert await status(port, "/autoload.js", host, foreign) == 403, host
        for host in (f"{name}:{port}" for name in FOREIGN):
            for path in ("/", "/static/js/bokeh.min.js", "/autoload.js", "/metadata", "/x"):
                assert await status(port, path, host) in (400, 403), (host, path)
            own = f"Origin: http://{host}"
            assert await status(port, "/ws", host, own, SOCKET) in (400, 403), host

    served(tmp_path, check)


def test_the_names_of_the_machine_are_accepted_on_all_addresses(tmp_path):
    async def check(port):
        for name in OWN:
            assert await status(port, "/", f"{name}:{port}") == 200, name
        assert await status(port, "/", f"evil.example:{port}") == 403

    served(tmp_path, check, address="0.0.0.0")


def test_no_other_site_shows_an_answer_in_a_frame(tmp_path):
    async def check(port):
        for path in ("/", "/static/js/bokeh.min.js", "/nothing", "/metadata", "/autoload.js"):
            for host in (f"127.0.0.1:{port}", "evil.example"):
                _, headers = await answer(port, path, host)
                assert headers["X-Frame-Options"] == "SAMEORIGIN", (path, host)
                assert headers["Content-Security-Policy"] == "frame-ancestors 'self'"
                assert headers["X-Content-Type-Options"] == "nosniff"

    served(tmp_path, check)


def test_a_proxy_has_a_name_and_a_path(tmp_path):
    async def check(port):
        proxy = "Lab.example:8443"
        for path in ("/lab/page/", "/lab/page/static/js/bokeh.min.js"):
            assert await status(port, path, proxy) == 200, path
            assert await status(port, path, f"localhost:{port}") == 200, path
            # Anybody can say so.
            forwarded = "X-Forwarded-Host: lab.example"
            assert await status(port, path, "other.example", forwarded) == 403, path
        for path in ("/", "/ws", "/static/js/bokeh.min.js"):
            assert await status(port, path, proxy) == 404, path
        first, headers = await answer(port, "/lab/page", proxy)
        assert "302" in first and headers["Location"] == "/lab/page/"
        socket = "/lab/page/ws"
        assert await status(port, socket, proxy, f"Origin: https://{proxy}", SOCKET) == 101
        # Another port is another server, and another name another site.
        for origin in ("https://lab.example", "https://other.example", "null"):
            assert await status(port, socket, proxy, f"Origin: {origin}", SOCKET) == 403, origin
        own = "Origin: https://other.example"
        assert await status(port, socket, "other.example", own, SOCKET) == 403

    served(tmp_path, check, host_names=["lab.example"], prefix="/lab/page/")


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({"host_names": ["https://lab.example"]}, "`host_name=https://lab.example` is refused"),
        ({"host_names": ["lab.example:443"]}, "without scheme and port"),
        ({"prefix": "lab"}, "`prefix=lab` is refused: it needs a path"),
        ({"prefix": "//evil.example"}, "is refused"),
    ],
)
def test_a_bad_name_or_path_is_refused(tmp_path, options, reason):
    with pytest.raises(ValueError, match=reason):
        new_server(None, tmp_path, address="127.0.0.1", port=0, show=False, **options)


def test_a_tab_that_closes_while_it_is_written_to_is_no_error(tmp_path, caplog):
    async def fail(error):
        raise error

    async def check(port):
        for error in (WebSocketClosedError(), ZeroDivisionError("another")):
            task = asyncio.ensure_future(fail(error))
            await asyncio.wait([task])
            del task
        gc.collect()

    gc.freeze()  # what earlier tests left is not searched
    served(tmp_path, check)
    gc.unfreeze()
    assert "another" in caplog.text and "WebSocketClosedError" not in caplog.text


def test_a_used_port_is_refused_by_its_number_and_option(tmp_path, monkeypatch):
    def serve(*_, **__):
        raise OSError(errno.EADDRINUSE, "Address already in use")

    monkeypatch.setattr("panel.serve", serve)
    with pytest.raises(OSError, match=r"^`port=5006` is refused: .* another `--port`"):
        new_server(None, tmp_path, address="127.0.0.1", port=5006, show=False)
