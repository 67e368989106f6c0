"""Addresses: where the web interface listens, by which names it is called, links to tests."""

from __future__ import annotations

import re
import socket
from dataclasses import dataclass
from ipaddress import IPv6Address, ip_address
from urllib.parse import quote

DEFAULT_PORT = 8400  # technical: above 1024, for which one must be root, and not the usual 8080
IMPORTS = "/api/imports"
"""Where the first file of a logger is sent to."""
NOTES = "/notes"
"""Where notes are sent to, with their photos."""
SUMMARY = "/api/bridge/summary"
"""Where a bridge says in a line how it is; other versions of shm ask there."""
PASSWORDS = ("/sign-in", "/password", "/users")
"""Where passwords are sent to: to hash one takes a core some 50 ms, and 64 MB."""
STREAMS = "/api/streams"
"""Below it chunks of permanent sensors are sent to."""
UPLOADS = "/api/recordings"
"""Where recordings are sent to."""


@dataclass(frozen=True)
class Address:
    """Host and port to listen at; by default only this machine can reach it."""

    host: str = "127.0.0.1"
    port: int = DEFAULT_PORT

    @property
    def is_loopback(self) -> bool:
        """Return True if only this machine can reach it."""
        return _is_loopback(self.host)

    def page(self) -> str:
        """Return the address to open in a browser; this machine's name if it listens everywhere."""
        host = _machine() if self.host in ("0.0.0.0", "::") else self.host  # noqa: S104
        named = f"[{host}]" if ":" in host else host
        return f"http://{named}:{self.port}/"

    def answers_to(self, host_header: str, names: tuple[str, ...]) -> bool:
        """Return True if a request with this `Host` is meant for us.

        A page of a stranger may have its own name resolve to this machine; numbers cannot be
        turned that way. `names` are further names of ours.
        """
        name = _name_of(host_header)
        known = {"localhost", *names} | (set() if self.is_loopback else {_machine()})
        if name in known:
            return True
        return _is_loopback(name) if self.is_loopback else _is_number(name)


def network_of(address: str) -> str:
    """Return the network of a caller: one owner of IPv6 holds a block of 64 bits."""
    try:
        number = ip_address(address.partition("%")[0])
    except ValueError:
        return address
    if isinstance(number, IPv6Address) and number.ipv4_mapped is None:
        return f"{IPv6Address(int(number) >> 64 << 64)}/64"
    return str(getattr(number, "ipv4_mapped", None) or number)


def caller_of(peer: str, forwarded_for: str, proxies: str) -> str:
    """Return the address of the caller: the peer or, behind our `proxies`, whom they name.

    Each proxy adds the address that it was called from at the end of X-Forwarded-For: an entry
    before the first that is none of ours may be forged.
    """
    ours = {name.strip() for name in proxies.split(",")}
    for named in reversed([peer] if peer not in ours else [*forwarded_for.split(","), peer]):
        if named.strip() not in ours:
            return named.strip() if _is_number(named.strip()) else peer
    return peer


_HOST = re.compile(r"(\[(?P<number>[^\[\]]*)\]|(?P<name>[^\[\]:@/?#]*))(:\d*)?")


def _name_of(host_header: str) -> str:
    """Return the host of a header; empty for anything else, as RFC 9110 knows no user there."""
    found = _HOST.fullmatch(host_header.strip().lower())
    return (found["number"] or found["name"].rstrip(".")) if found else ""


def _is_loopback(name: str) -> bool:
    return name == "localhost" or (_is_number(name) and ip_address(name).is_loopback)


def _is_number(name: str) -> bool:
    try:
        ip_address(name)
    except ValueError:
        return False
    return True


def _machine() -> str:
    return socket.gethostname().lower()


_DOTS = (".", "..")
"""Names that a browser would take for a way up: they are followed by a slash."""


def test_page(hanger_id: int, name: str) -> str:
    """Return the address of a test's page."""
    segment = f"{name}/" if name in _DOTS else name
    return f"/hangers/{hanger_id}/tests/{quote(segment, safe='')}"


def test_json(hanger_id: int, name: str) -> str:
    """Return the address of a test's JSON; its figures are below it."""
    return f"/api{test_page(hanger_id, name)}"


def name_in(address: str) -> str:
    """Return the name of the test whose address ends so, decoded."""
    return address.removesuffix("/") if address.removesuffix("/") in _DOTS else address


test_page.__test__ = test_json.__test__ = False  # type: ignore[attr-defined]  # no pytest cases
