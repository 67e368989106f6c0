"""The table `[single_sign_on]`: the OpenID Connect provider that says who people are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from shm.bridge.table import Table, is_loopback
from shm.errors import BadInput

EMAIL = "email"
_KEYS = ("issuer", "client_id", "client_secret_file", "user_claim")
_IN_A_FILE = 'Write it into a file that only you can read: client_secret_file = "sign_on.secret".'


@dataclass(frozen=True)
class SingleSignOn:
    """A provider, and us as it knows us.

    A person is the user of shm whose name is exactly what the provider says in `user_claim`; what
    they may do is said by their role here, never by the provider.
    """

    issuer: str
    client_id: str
    client_secret_file: Path
    user_claim: str = EMAIL

    @property
    def host(self) -> str:
        """The provider as people know it."""
        return urlsplit(self.issuer).hostname or ""


def single_sign_on_of(document: Mapping[str, Any], path: Path) -> SingleSignOn | None:
    """What `[single_sign_on]` says, None where there is none; raises BadInput."""
    values = document.get("single_sign_on")
    if values is None:
        return None
    if not isinstance(values, dict):
        raise BadInput("single_sign_on must be a table.", file=path, remedy="[single_sign_on]")
    table = Table(values, "[single_sign_on]", path)
    if "client_secret" in table:
        raise table.refusal("bridge.toml is no place for a secret", _IN_A_FILE)
    table.refuse_unknown(_KEYS)
    issuer = _text(table, "issuer", "Write https://, as your provider states it.")
    if not is_safe(issuer):
        remedy = "Write https://; http:// is for a provider on this computer alone."
        raise table.refusal(f"issuer = {issuer!r} is not an encrypted address", remedy)
    client_id = _text(table, "client_id", "Write the one that the provider gave this bridge.")
    secret_file = path.parent / _text(table, "client_secret_file", _IN_A_FILE)
    return SingleSignOn(issuer, client_id, secret_file, _text(table, "user_claim", "", usual=EMAIL))


def is_safe(address: str) -> bool:
    """Whether what is sent to an address is encrypted, or stays on this computer."""
    try:
        parts = urlsplit(address)
        host = parts.hostname or ""
    except ValueError:
        return False
    plain = not (parts.username or parts.password or parts.fragment) and address.isprintable()
    is_kept = parts.scheme == "https" or (parts.scheme == "http" and is_loopback(host))
    return bool(host) and plain and is_kept


def _text(table: Table, key: str, remedy: str, usual: str | None = None) -> str:
    remedy = remedy or f'Write {key} = "...".'
    found = table.value(key, str, "is not a text", remedy, usual, lambda text: bool(text.strip()))
    return str(found).strip()
