"""One table of `bridge.toml` and the checks of its values; what is wrong is named with a remedy."""

from __future__ import annotations

import ipaddress
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import SplitResult, urlsplit

from shm.documents import ValidationError, finite, reader, value_of
from shm.errors import BadInput, suggest

_READER = reader(finite)


@dataclass(frozen=True)
class Table:
    """The values of a table, what to call it in a message, and the file that it stands in."""

    values: Mapping[str, Any]
    label: str
    path: Path

    def __contains__(self, key: str) -> bool:
        return key in self.values

    def refusal(self, problem: str, remedy: str) -> BadInput:
        """Return the error that says what is wrong with this table."""
        line = _line_of(self.path, self.label, problem)
        return BadInput(f"{self.label}: {problem}.", file=self.path, line=line, remedy=remedy)

    def refuse_unknown(self, known: Iterable[str]) -> None:
        """Raise BadInput where a key is none of `known`."""
        names = sorted(known)
        for key in self.values.keys() - set(names):
            remedy = f"{suggest(key, names)}Known: {', '.join(names)}."
            raise self.refusal(f"unknown key {key}", remedy)

    def value(
        self,
        key: str,
        kind: Any,
        wrong: str,
        remedy: str,
        usual: Any = None,
        holds: Callable[[Any], bool] = lambda _: True,
    ) -> Any:
        """Return the value of a key, of a kind for which something `holds`; else it is `wrong`.

        Where the key is missing it is `usual`. Raises BadInput, also where that is None.
        """
        if key not in self:
            if usual is None:
                raise self.refusal(f"{key} is missing", remedy)
            return usual
        try:
            found = value_of(kind, self.values[key], by=_READER)
            if holds(found):
                return found
        except ValidationError:
            pass  # the table says what is wrong in its own words
        raise self.refusal(f"{key} = {self.values[key]!r} {wrong}", remedy)

    def text(self, key: str, usual: str | None = None, remedy: str = "") -> str:
        """Return a text that one line can show, without blanks around it.

        Where the key is missing it is `usual`. Raises BadInput, also where that is None; an empty
        text is one only where that is `usual`.
        """
        remedy = remedy or f'Write {key} = "...".'

        def can_be_shown(text: str) -> bool:
            return text.isprintable() and (bool(text.strip()) or usual == "")

        return str(self.value(key, str, "is not a text", remedy, usual, can_be_shown)).strip()

    def positive(self, key: str, unit: str = "SI units") -> float:
        """Return a number above 0; raises BadInput where it is missing or none."""
        remedy, wrong = f"Give {key} in {unit}.", "is not a positive number"
        return float(self.value(key, float, wrong, remedy, holds=lambda value: value > 0))

    def not_negative(self, key: str) -> float:
        """Return a number from 0 up; raises BadInput where it is missing or none."""
        remedy, wrong = f"Give {key} in SI units.", "is not a number from 0 up"
        return float(self.value(key, float, wrong, remedy, holds=lambda value: value >= 0))

    def fraction(self, key: str, default: float, low: float, high: float) -> float:
        """Return a number from `low` to `high`, both included; `default` without the key."""
        if key not in self:
            return default
        remedy = f"Give a number from {low:g} to {high:g}."
        value = float(self.value(key, float, "is not a number", remedy))
        if low <= value <= high:
            return value
        raise self.refusal(f"{key} = {value:g} is not from {low:g} to {high:g}", remedy)

    @property
    def _kind(self) -> str:
        return self.label.split()[0].strip("[]")

    def table(self, key: str) -> Table | None:
        """Return the sub-table `key`; None where there is none."""
        if key not in self:
            return None
        values = self.values[key]
        if not isinstance(values, dict):
            raise self.refusal(f"{key} is not a table", f"Write [hanger.{key}] and its keys below.")
        return Table(values, f"{self.label} {key}", self.path)

    def tables(self, key: str) -> list[Table]:
        """Return the list of sub-tables `key`; empty where there is none."""
        found = self.values.get(key, [])
        if not isinstance(found, list) or not all(isinstance(each, dict) for each in found):
            remedy = f"Write [[{self._kind}.{key}]] and its keys below."
            raise self.refusal(f"{key} is not a list of tables", remedy)
        return [
            Table(values, f"{self.label} {key} {number}", self.path)
            for number, values in enumerate(found, start=1)
        ]


def web_address(table: Table, key: str, remedy: str, no_password: str) -> str:
    """Return a web address, encrypted unless it is this machine or `allow_http` stands there.

    `no_password` says why it needs none. Raises BadInput.
    """
    url = table.values.get(key, "")
    try:
        parts = urlsplit(url if isinstance(url, str) and url.isprintable() else "")
        _ = parts.port
    except ValueError:
        parts = SplitResult("", "", "", "", "")
    if parts.scheme not in ("http", "https") or not parts.hostname:
        raise table.refusal(f"{key} is not an address of the web", remedy)
    if "@" in parts.netloc:
        raise table.refusal(f"{key} holds a user or password; {no_password}", remedy)
    open_allowed = table.values.get("allow_http", False)
    if not isinstance(open_allowed, bool):
        raise table.refusal("allow_http is neither true nor false", "Write allow_http = true.")
    if parts.scheme == "http" and not open_allowed and not is_loopback(parts.hostname):
        raise table.refusal(
            f"{key} is not encrypted",
            "Write https://, or allow_http = true in a network you trust.",
        )
    return str(url)


def is_loopback(host: str) -> bool:
    """Return True if a host is this machine."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host.lower() == "localhost"


_LABEL = re.compile(r"(?:\[\[)?(\w+)(?:\]\] id)? (\S+)")
"""`[[hanger]] id 3 thresholds` or `hook mail`: which table, and the key or name that tells it."""
_PLAIN_LABEL = re.compile(r"\[(\w+)\]")
"""`[report]`: a table that a file has once."""


def _line_of(path: Path, label: str, problem: str) -> int | None:
    """Return the line of the key that a problem names, else that of its table, else None.

    The parser of TOML tells no places of what it has read.
    """
    named, plain = _LABEL.match(label), _PLAIN_LABEL.fullmatch(label)
    if named is None and plain is None:
        return None
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError):
        return None
    if plain is not None:
        return _line_of_plain_table(lines, plain[1], problem)
    assert named is not None
    kind, key = named.groups()
    tells = re.compile(rf"\s*(id|name)\s*=\s*[\"']?{re.escape(key)}[\"']?\s*(#.*)?$")
    begins = [n for n, line in enumerate(lines) if line.strip().startswith(f"[[{kind}]]")]
    for begin in begins:
        end = next((n for n in range(begin + 1, len(lines)) if _other(lines[n], kind)), len(lines))
        if any(tells.match(line) for line in lines[begin:end]):
            return _line_within(lines, range(begin, end), f"{label} {problem}") + 1
    return begins[0] + 1 if len(begins) == 1 else None


def _line_of_plain_table(lines: Sequence[str], name: str, problem: str) -> int | None:
    """Return the line in `[name]` that a problem names, else that of its header."""
    header = re.compile(rf"\s*\[\s*{re.escape(name)}\s*\]")
    begin = next((n for n, line in enumerate(lines) if header.match(line)), None)
    if begin is None:
        return None
    after = range(begin + 1, len(lines))
    end = next((n for n in after if _other(lines[n], name)), len(lines))
    words = set(re.findall(r"\w+", problem))
    keys = {n: re.match(r"\s*(\w+)\s*=", lines[n]) for n in range(begin, end)}
    return next((n for n, key in keys.items() if key and key[1] in words), begin) + 1


def _other(line: str, kind: str) -> bool:
    """Return True if another table starts that is no part of this one."""
    header = line.strip()
    return header.startswith("[") and not re.match(rf"\[+{kind}\.", header)


def _line_within(lines: Sequence[str], block: range, problem: str) -> int:
    """Return the last line of a block that sets or opens something that is named."""
    words = set(re.findall(r"\w+", problem))
    for number in reversed(block):
        keys = re.findall(r"(\w+)\s*=", lines[number]) or re.findall(r"\.(\w+)\]", lines[number])
        if words.intersection(keys) - {"id", "name"}:
            return number
    return block.start
