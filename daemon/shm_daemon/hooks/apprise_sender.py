"""The program that speaks to apprise: a JSON document on standard input, words on stderr.

It stands alone: of shm it imports nothing, so that it begins quickly.
"""

from __future__ import annotations

import io
import json
import logging
import re
import sys
from collections.abc import Sequence
from inspect import signature
from typing import Any
from urllib.parse import unquote

import apprise


def main() -> int:
    """Sends to each address; the number of those that did not take it."""
    request = json.load(sys.stdin)
    words = io.StringIO()
    library = logging.getLogger("apprise")
    library.addHandler(logging.StreamHandler(words))
    library.setLevel(logging.WARNING)
    library.propagate = False
    failed = [address for address in request["addresses"] if not _sent(address, request)]
    if failed:
        schemes = ", ".join(address.partition("://")[0] for address in failed)
        output = without(" ".join(words.getvalue().split()), request["addresses"])
        sys.stderr.write(f"{len(failed)} of {len(request['addresses'])} ({schemes}): {output}")
    return min(len(failed), 100)


def without(text: str, addresses: Sequence[str]) -> str:
    """`text` with every part of the addresses but their schemes made unreadable."""
    parts: set[str] = set()
    for address in addresses:
        rest = address.partition("://")[2]
        for spelling in (rest, unquote(rest)):
            parts |= {spelling, *re.split(r"[^\w.-]+", spelling), *re.split(r"[/@:?&=]", spelling)}
    for part in sorted(parts, key=len, reverse=True):
        if len(part) > 3:
            text = text.replace(part, "***")
        elif part:
            text = re.sub(rf"(?<!\w){re.escape(part)}(?!\w)", "***", text)
    return text


def _sent(address: str, request: dict[str, Any]) -> bool:
    try:
        # `Apprise.add` would take a text with commas for several addresses.
        service = apprise.Apprise.instantiate(address, asset=_careful())
        if service is None:
            return False
        sender = apprise.Apprise(service)
        return bool(
            sender.notify(body=request["body"], title=request["title"], notify_type=request["type"])
        )
    except Exception as error:  # noqa: BLE001 - a service's own fault must not show its address
        logging.getLogger("apprise").warning("%s", type(error).__name__)
        return False


def _careful() -> Any:
    """No address may have this machine read or fetch a file, or follow to another address."""
    made: Any = apprise.AppriseAsset
    known = "allow_templates" in signature(made).parameters  # since apprise 2
    asset = made(allow_templates=False) if known else made()
    asset.secure_logging, asset.async_mode, asset.http_redirects = True, False, False
    return asset


if __name__ == "__main__":
    sys.exit(main())
