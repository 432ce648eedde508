"""Requests that pages of other sites send through the browsers of their visitors."""

import contextlib
import ipaddress
from collections.abc import Iterable

from tornado.httputil import HTTPServerRequest
from tornado.routing import Matcher


class Foreign(Matcher):
    """Matches requests that are not from a page of this server.

    The owner of a site can let its name point to this machine (DNS rebinding): the browser then
    takes this server for a part of the site. Only known names are therefore accepted, and numeric
    addresses, which nobody can redirect.

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
