"""The server of pages: whom it answers, by raw requests to a real one."""

import asyncio
import signal
import socket

import pytest
from scene_texts import TEXT

pytest.importorskip("panel")
from graded_contact.page.serving import new_server

HOST = socket.gethostname()
SOCKET = (
    "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
    "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
)
OWN = ["127.0.0.1", "localhost", "LOCALHOST", HOST, "[::1]", "192.0.2.7"]
FOREIGN = ["evil.example", "localhost.evil.example", "127.0.0.1.evil.example", "1.2.3", "[evil]"]


async def status(port, path, host, *headers):
    """The status with which the server answers a request."""
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    lines = [f"GET {path} HTTP/1.1", f"Host: {host}", *headers]
    writer.write("\r\n".join([*lines, "", ""]).encode())
    answer = await reader.readline()
    writer.close()
    return int(answer.split()[1])


def served(folder, check, address="127.0.0.1"):
    """Runs `check` of the port of a server of a scene."""
    scene = folder / "scene.toml"
    scene.write_text(TEXT, encoding="utf-8")

    async def run():
        before = signal.getsignal(signal.SIGINT)
        server = new_server(scene, folder / "out", address=address, port=0, show=False)
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
