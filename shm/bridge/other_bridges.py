"""The `[[other_bridge]]` tables of `bridge.toml`: whose state the page of all bridges shows too.

Each is served by a dashboard of its own. Tokens never stand here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from shm.bridge.table import Table, web_address

_KNOWN = ("name", "address", "token_file", "certificate_file", "allow_http")
_ADDRESS = 'Write address = "https://host:8400", as its dashboard is opened, without a page.'
_WHERE_TOKENS_STAND = (
    "Make one there with `shm token create all-bridges --scope read`, write it into a file that "
    'only this user can read, and name it: token_file = "arch.token".'
)


@dataclass(frozen=True)
class OtherBridge:
    """A bridge by the name that it has here, and where its dashboard is: no slash at the end.

    The files are taken from the workspace's folder on; empty where none is named.
    `certificate_file` holds the certificate of an authority that this machine does not trust.
    """

    name: str
    address: str
    token_file: str = ""
    certificate_file: str = ""


def other_bridge_of(values: Mapping[str, Any], path: Path) -> OtherBridge:
    """The bridge of one table; raises BadInput naming it and what to write."""
    table = Table(values, f"other_bridge {values.get('name', '?')}", path)
    if "token" in table:
        raise table.refusal("bridge.toml is no place for a token", _WHERE_TOKENS_STAND)
    table.refuse_unknown(_KNOWN)
    name = _text(table, "name", 'Write name = "Arch bridge".', usual=None)
    address = web_address(table, "address", _ADDRESS, "a token in a file says who asks")
    if urlsplit(address).path.strip("/") or "?" in address or "#" in address:
        raise table.refusal("address is that of a page", _ADDRESS)
    token, certificate = (
        _text(table, key, f'Write {key} = "arch.{suffix}".')
        for key, suffix in (("token_file", "token"), ("certificate_file", "pem"))
    )
    return OtherBridge(name, address.rstrip("/"), token, certificate)


def _text(table: Table, key: str, remedy: str, usual: str | None = "") -> str:
    def can_be_shown(text: str) -> bool:
        return bool(text.strip()) and text.isprintable()

    return str(table.value(key, str, "is not a text", remedy, usual, can_be_shown))
