"""The whole of `bridge.toml`: the bridge, its hangers, its hooks, its settings.

`[report]` says who makes the reports, and with which logo; `[single_sign_on]` which OpenID Connect
provider says who people are; `[[other_bridge]]` whose state the page of all bridges shows too. Each
of these is served by a dashboard of its own. Tokens never stand here.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, date, datetime, tzinfo
from pathlib import Path
from types import MappingProxyType
from typing import Any
from urllib.parse import urlsplit

from shm.assumptions import DEFAULTS, Assumptions
from shm.bridge.assumed import assumptions_of
from shm.bridge.changes import overlaid
from shm.bridge.hanger import hanger_of, structure_of
from shm.bridge.hooks import Hook, escalations_s, hook_of, zone_of
from shm.bridge.publish import Publication, publication_of
from shm.bridge.streams import stream_named, streams_of
from shm.bridge.table import Table, is_loopback, web_address
from shm.errors import BadInput, NotDescribed, suggest
from shm.values import MEASUREMENT_HOURS, ControlHanger, Hanger, MonitoredHanger
from shm.values.messages import TODAY
from shm.values.stream import Stream

_LETTERHEAD = ("organisation", "prepared_by", "checked_by", "logo")
_SUFFIXES = (".png", ".jpg", ".jpeg")


@dataclass(frozen=True)
class Letterhead:
    """Letterhead of the reports of a bridge: company, author, signatures.

    Empty texts and None: nothing is given. `logo` is an image file, which need not be there.
    """

    organisation: str = ""
    prepared_by: str = ""
    checked_by: str = ""
    logo: Path | None = None


NO_LETTERHEAD = Letterhead()


def letterhead_of(document: Mapping[str, Any], path: Path) -> Letterhead:
    """Read `[report]`; raises BadInput for what it cannot hold. The logo is not opened."""
    table = _table(document, "report", path) or Table({}, "[report]", path)
    table.refuse_unknown(_LETTERHEAD)
    organisation, prepared_by, checked_by, logo = (table.text(key, "") for key in _LETTERHEAD)
    if logo and Path(logo).suffix.lower() not in _SUFFIXES:
        raise table.refusal(f"logo = {logo!r} is no PNG or JPEG file", 'Write logo = "logo.png".')
    return Letterhead(organisation, prepared_by, checked_by, path.parent / logo if logo else None)


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
    """Return the bridge of one table; raises BadInput naming it and what to write."""
    table = Table(values, f"other_bridge {values.get('name', '?')}", path)
    if "token" in table:
        raise table.refusal("bridge.toml is no place for a token", _WHERE_TOKENS_STAND)
    table.refuse_unknown(_KNOWN)
    name = table.text("name", remedy='Write name = "Arch bridge".')
    address = web_address(table, "address", _ADDRESS, "a token in a file says who asks")
    if urlsplit(address).path.strip("/") or "?" in address or "#" in address:
        raise table.refusal("address is that of a page", _ADDRESS)
    token, certificate = (
        table.text(key, "", f'Write {key} = "arch.{suffix}".')
        for key, suffix in (("token_file", "token"), ("certificate_file", "pem"))
    )
    return OtherBridge(name, address.rstrip("/"), token, certificate)


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
    """Read `[single_sign_on]`, None where there is none; raises BadInput."""
    table = _table(document, "single_sign_on", path)
    if table is None:
        return None
    if "client_secret" in table:
        raise table.refusal("bridge.toml is no place for a secret", _IN_A_FILE)
    table.refuse_unknown(_KEYS)
    issuer = table.text("issuer", remedy="Write https://, as your provider states it.")
    if not is_safe(issuer):
        remedy = "Write https://; http:// is for a provider on this computer alone."
        raise table.refusal(f"issuer = {issuer!r} is not an encrypted address", remedy)
    client_id = table.text("client_id", remedy="Write the one that the provider gave this bridge.")
    secret_file = path.parent / table.text("client_secret_file", remedy=_IN_A_FILE)
    return SingleSignOn(issuer, client_id, secret_file, table.text("user_claim", EMAIL))


def is_safe(address: str) -> bool:
    """Return True if a connection is encrypted or stays on this computer."""
    try:
        parts = urlsplit(address)
        host = parts.hostname or ""
    except ValueError:
        return False
    plain = not (parts.username or parts.password or parts.fragment) and address.isprintable()
    is_private = parts.scheme == "https" or (parts.scheme == "http" and is_loopback(host))
    return bool(host) and plain and is_private


@dataclass(frozen=True)
class Disturbance:
    """A machine near the bridge, and the band in which it runs."""

    name: str
    low_hz: float
    high_hz: float


@dataclass(frozen=True)
class Bridge:
    """The description of a bridge by `bridge.toml`; `built` is None if it is not stated.

    `structures` are those without a model, of which frequencies alone are watched: a deck, a pylon.
    Their numbers are none of a hanger. `controls` are hangers of known tension, which check each
    campaign and are none of `hangers`. `measurement_hours` is what each kind of measurement costs.
    `as_in_file` is the bridge without what the page Settings
    has changed; None where it has changed nothing. `time_zone` is that of clocks that name none.
    """

    name: str
    hangers: tuple[Hanger, ...]
    hooks: tuple[Hook, ...]
    settings_table: Mapping[str, object]
    source: str
    disturbances: tuple[Disturbance, ...] = ()
    built: date | None = None
    structures: tuple[Hanger, ...] = ()
    streams: tuple[Stream, ...] = ()
    letterhead: Letterhead = NO_LETTERHEAD
    other_bridges: tuple[OtherBridge, ...] = ()
    measurement_hours: Mapping[str, float] = field(default_factory=lambda: dict(MEASUREMENT_HOURS))
    as_in_file: Bridge | None = None
    single_sign_on: SingleSignOn | None = None
    assumptions: Assumptions = DEFAULTS
    time_zone: tzinfo = UTC
    publications: tuple[Publication, ...] = ()
    controls: tuple[ControlHanger, ...] = ()

    @property
    def escalation_s(self) -> dict[str, float]:
        """The hooks that are told only of what nobody has acknowledged after so many seconds."""
        return escalations_s(self.hooks)

    @property
    def bars(self) -> tuple[Hanger, ...]:
        """Return all that have a tension: hangers, then control hangers."""
        return (*self.hangers, *self.controls)

    @property
    def watched(self) -> tuple[Hanger, ...]:
        """All that tests may be of."""
        return (*self.bars, *self.structures)

    def tested(self, number: int) -> Hanger:
        """Return the hanger or structure of that number; raises BadInput where there is none."""
        return next((each for each in self.structures if each.id == number), None) or self.hanger(
            number
        )

    def stream(self, name: str) -> Stream:
        """Return the stream of that name; raises BadInput when the bridge has none such."""
        return stream_named(self.streams, name)

    def hanger(self, hanger_id: int) -> Hanger:
        """Return the hanger of that number; raises BadInput when the bridge has none such."""
        for hanger in self.bars:
            if hanger.id == hanger_id:
                return hanger
        if any(each.id == hanger_id for each in self.structures):
            raise BadInput(
                f"{hanger_id} is a structure without a model: it has no tension.",
                remedy="See `shm status`, `shm alerts` and `shm report --hanger "
                f"{hanger_id}` for its frequencies.",
            )
        known = ", ".join(str(hanger.id) for hanger in self.bars) or "none"
        raise NotDescribed(
            f"hanger {hanger_id} is not described in {Path(self.source).name} (known: {known}).",
            remedy="Add a [[hanger]] table with this id, or correct the number.",
        )


def load_bridge(path: Path, changed: Mapping[str, object] = MappingProxyType({})) -> Bridge:
    """Read and check `bridge.toml`, in which values of `changed` hold instead: see `overlaid`.

    Raises BadInput naming the table and key at fault.
    """
    document = _parse(path)
    plain = _described(document, path)
    if not changed:
        return plain
    return replace(_described(overlaid(document, changed), path), as_in_file=plain)


_TABLES = (
    "bridge", "hanger", "structure", "hook", "other_bridge", "stream", "settings", "disturbance",
    "report", "measurement_hours", "single_sign_on", "assumptions", "publish",
)  # fmt: skip
_OF_BRIDGE = ("name", "built", "time_zone")


def _refuse_unknown_tables(document: Mapping[str, Any], path: Path) -> None:
    """Raise BadInput for a table that nothing reads, and for such a key of `[bridge]`."""
    for name in document.keys() - set(_TABLES):
        remedy = f"{suggest(name, _TABLES)}Known: {', '.join(_TABLES)}."
        raise BadInput(f"unknown table or key {name}.", file=path, remedy=remedy)
    if table := _table(document, "bridge", path):
        table.refuse_unknown(_OF_BRIDGE)


def _described(document: dict[str, Any], path: Path) -> Bridge:
    _refuse_unknown_tables(document, path)
    assumed = assumptions_of(_table(document, "assumptions", path), DEFAULTS)
    hangers = tuple(hanger_of(table, path, assumed) for table in _tables(document, "hanger", path))
    structures = tuple(structure_of(table, path) for table in _tables(document, "structure", path))
    _refuse_doubles([each.id for each in (*hangers, *structures)], "hanger id", path)
    zone = zone_of(document.get("bridge", {}), path)
    hooks = tuple(hook_of(table, path, zone) for table in _tables(document, "hook", path))
    _refuse_doubles([hook.name for hook in hooks], "hook name", path)
    others = tuple(other_bridge_of(each, path) for each in _tables(document, "other_bridge", path))
    _refuse_doubles([other.name for other in others], "other_bridge name", path)
    publications = tuple(publication_of(each, path) for each in _tables(document, "publish", path))
    own_name = 'Give each [[publish]] a name of its own: name = "city".'
    _refuse_doubles([each.name for each in publications], "publish name", path, own_name)
    controls = tuple(each for each in hangers if isinstance(each, ControlHanger))
    hangers = tuple(each for each in hangers if not each.is_control)
    described = {each.id: each for each in hangers}
    streams = streams_of(_tables(document, "stream", path), path, described)
    watched = {stream.hanger for stream in streams}
    hangers = tuple(MonitoredHanger.of(h) if h.id in watched else h for h in hangers)
    return Bridge(
        name=str(document.get("bridge", {}).get("name", path.parent.name)),
        hangers=hangers,
        hooks=hooks,
        settings_table=document.get("settings", {}),
        source=str(path),
        disturbances=tuple(
            _disturbance(table, path) for table in _tables(document, "disturbance", path)
        ),
        built=_built(document.get("bridge", {}), path),
        structures=structures,
        streams=streams,
        letterhead=letterhead_of(document, path),
        other_bridges=others,
        measurement_hours=_hours(document, path),
        single_sign_on=single_sign_on_of(document, path),
        assumptions=assumed,
        time_zone=zone,
        publications=publications,
        controls=controls,
    )


def load_hanger(path: Path, hanger_id: int | None = None) -> Hanger:
    """Return one hanger of a file (`--hanger-file`), by `hanger_id` where it has several."""
    bridge = load_bridge(path)
    if hanger_id is not None:
        return bridge.hanger(hanger_id)
    if len(bridge.bars) != 1:
        raise BadInput(
            f"{len(bridge.bars)} [[hanger]] tables where one is expected.",
            file=path,
            remedy="Keep one table, or say which with --hanger N.",
        )
    return bridge.bars[0]


EXAMPLE = "example: replace by your own"
"""Name of the hanger that `shm init` writes into bridge.toml."""


def example_words(hanger: Hanger) -> str:
    """Return that a hanger is still the one of the template, and what to do; else ""."""
    if hanger.name != EXAMPLE:
        return ""
    return (
        f"Hanger {hanger.id} is still the example that `shm init` wrote: do not use its tension. "
        f"Replace its numbers and its name in bridge.toml by those of your bar {TODAY}."
    )


def _parse(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except (FileNotFoundError, NotADirectoryError):
        raise BadInput(
            f"no such file in {path.absolute().parent}.",
            file=path,
            remedy="Make a workspace with `shm init`, name one with --workspace, or describe the "
            "hanger of a file alone with --hanger-file H.toml.",
        ) from None
    except OSError as error:
        raise BadInput(
            f"cannot be read: {error.strerror}.", file=path, remedy="Check its permissions."
        ) from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        at = re.search(r"\(at line (\d+)", str(error))
        raise BadInput(
            f"not a readable TOML file: {error}.",
            file=path,
            line=int(at[1]) if at else None,
            remedy="Correct the file.",
        ) from error


def _table(document: Mapping[str, Any], name: str, path: Path) -> Table | None:
    """Return the table of that name; None where there is none."""
    values = document.get(name)
    if values is None:
        return None
    if not isinstance(values, dict):
        raise BadInput(f"{name} must be a table.", file=path, remedy=f"Write [{name}].")
    return Table(values, f"[{name}]", path)


def _tables(document: Mapping[str, Any], name: str, path: Path) -> list[dict[str, Any]]:
    tables = document.get(name, [])
    if not isinstance(tables, list) or not all(isinstance(table, dict) for table in tables):
        raise BadInput(f"{name} must be a list of tables.", file=path, remedy=f"Write [[{name}]].")
    return tables


def _refuse_doubles(
    keys: list[Any], what: str, path: Path, remedy: str = "Keep one of them."
) -> None:
    for key in keys:
        if keys.count(key) > 1:
            raise BadInput(f"{what} {key} is given twice.", file=path, remedy=remedy)


def _built(values: dict[str, Any], path: Path) -> date | None:
    """Return the day from which on there can be tests; tests of before are held."""
    found = values.get("built")
    if found is None or (isinstance(found, date) and not isinstance(found, datetime)):
        return found
    raise BadInput(
        f"bridge: built = {found!r} is not a date.",
        file=path,
        remedy="Write built = 1998-06-01, without quotation marks.",
    )


def _hours(document: Mapping[str, Any], path: Path) -> Mapping[str, float]:
    """Return the costs of measurements, the usual ones where the table does not say."""
    table = _table(document, "measurement_hours", path)
    if table is None:
        return dict(MEASUREMENT_HOURS)
    keys = {re.sub(r"\W", "_", kind): kind for kind in MEASUREMENT_HOURS}
    table.refuse_unknown(keys)
    stated = {kind: table.positive(key, "hours") for key, kind in keys.items() if key in table}
    return {**MEASUREMENT_HOURS, **stated}


def _disturbance(values: dict[str, Any], path: Path) -> Disturbance:
    table = Table(values, f"disturbance {values.get('name', '')}".strip(), path)
    table.refuse_unknown(("name", "low_hz", "high_hz"))
    low_hz, high_hz = table.positive("low_hz"), table.positive("high_hz")
    if low_hz >= high_hz or not isinstance(values.get("name"), str):
        raise table.refusal(
            "it needs a name and a high_hz above low_hz",
            'Write name = "pump", low_hz = 24.2, high_hz = 24.9.',
        )
    return Disturbance(values["name"], low_hz, high_hz)
