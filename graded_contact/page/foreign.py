"""What keeps other sites away from a page: whom the server answers, and headers of its answers."""

import contextlib
import ipaddress
from collections.abc import Iterable
from typing import Any

from tornado.httputil import HTTPHeaders, HTTPServerRequest
from tornado.routing import Matcher
from tornado.web import OutputTransform

# No other site may show the page in a frame, and lead its visitors to click there.
HEADERS = {
    "X-Frame-Options": "SAMEORIGIN",
    "Content-Security-Policy": "frame-ancestors 'self'",
    "X-Content-Type-Options": "nosniff",
}


class Foreign(Matcher):
    """Matches requests that are not from a page of this server.

    The owner of a site can let its name point to this machine (DNS rebinding): the browser then
    takes this server for a part of the site. Only known names are therefore accepted, and numeric
    addresses, which nobody can redirect. Headers such as X-Forwarded-Host count for nothing, since
    anybody can send them.

    **Arguments:**

    - `names`: of this server.
    """

    def __init__(self, names: Iterable[str]):
        self._names = {name.lower() for name in names}

    def match(self, request: HTTPServerRequest) -> dict | None:
        """Returns None for a request that is accepted, and {} for a foreign one."""
        host, headers = request.host.lower(), request.headers
        # Browsers name the origin of each WebSocket, but not of each page.
        origin = headers.get("Origin", "" if "Upgrade" in headers else f"http://{host}")
        same = origin.lower() in (f"http://{host}", f"https://{host}")
        known = request.host_name in self._names
        with contextlib.suppress(ValueError):
            known |= bool(ipaddress.ip_address(request.host_name.strip("[]")))
        return None if same and known else {}


class Framing(OutputTransform):
    """Adds `HEADERS` to every answer, of pages, files and errors."""

    def transform_first_chunk(
        self, status_code: int, headers: HTTPHeaders, chunk: bytes, finishing: bool
    ) -> Any:
        for name, value in HEADERS.items():
            headers[name] = value
        return status_code, headers, chunk
