"""Contract of every kind of hook."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from shm.documents import alert_document
from shm.errors import ShmError
from shm.values import Alert, printable

SHOWN_CHARACTERS = 500  # technical: of a stranger's words, what a line of the log may hold


_SENTENCES = frozenset({"message", "state", "action"})


def without_code(text: str) -> str:
    """Return a message with its commands bare: a telephone shows the marks of code as they are."""
    return text.replace("`", "")


class HookFailed(ShmError):
    """A hook could not be run, took too long, or said that it failed; another try may help."""


@dataclass(frozen=True)
class DeliveryContext:
    """The workspace's folder, the longest a delivery may take, and the daemon's environment.

    `pages_address` is where the web interface answers; empty where that is not known.
    """

    folder: Path
    timeout_s: float
    environment: Mapping[str, str]
    pages_address: str = ""

    def link(self, alert: Alert) -> str:
        """Return the address of the page that an alert is about; empty without `pages_address`."""
        if not self.pages_address:
            return ""
        page = "/alerts" if alert.alerts else f"/hangers/{alert.hanger}#alerts"
        return f"{self.pages_address.rstrip('/')}{page}"

    def document(self, alert: Alert) -> dict[str, Any]:
        """Return `shm.alert/1` with the `link`, where it is known."""
        link = self.link(alert)
        document = {**alert_document(alert), **({"link": link} if link else {})}
        sentences = {key: without_code(document[key]) for key in _SENTENCES & document.keys()}
        return {**document, **sentences}


class Deliverer(Protocol):
    """Delivers alerts to hooks of one kind, from several threads at once."""

    def __init__(self, surroundings: DeliveryContext): ...

    def __call__(self, hook: object, alert: Alert) -> str:
        """Delivers one alert; what the hook answered.

        Raises HookFailed where another try may help, DeliveryRefused where none will.
        """

    def ready(self, hook: object) -> str:
        """Return where alerts would go, told without secrets, nothing being sent.

        Raises HookFailed where none could be delivered as things are.
        """

    def close(self) -> None:
        """Ends, from another thread, deliveries that are under way; no more are begun."""


def read_secret(folder: Path, name: str, kind: type[ShmError]) -> str:
    """Return the text of a file with a secret, its ends stripped; raises an error of a kind.

    Bytes that are no text become surrogates, which no check of ours takes for printable.
    """
    try:
        return (folder / name).read_text(encoding="utf-8", errors="surrogateescape").strip()
    except OSError as error:
        raise kind(
            f"{name} cannot be read: {error.strerror}.",
            remedy="Write it, readable for the user that runs shm here.",
        ) from None


def one_line(text: str) -> str:
    """A stranger's words made fit for a log: printable, on one line, not endless."""
    return " ".join(printable(text, " ").split())[:SHOWN_CHARACTERS]
