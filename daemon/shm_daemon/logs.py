"""Log of the daemon: a line of text or a JSON object for each thing that happens.

Fields that programs look for (recording, file, hanger, test, stage, hook, alert) come with the
record, by `extra=`. Libraries tell nothing below INFO, whatever the level: some of them write whole
addresses there, in which people put secrets.
"""

from __future__ import annotations

import json
import logging
import os
import sys
from datetime import UTC, datetime
from logging.handlers import RotatingFileHandler
from pathlib import Path

from shm.errors import UsageError
from shm.settings import Settings

FIELDS = ("recording", "file", "hanger", "test", "stage", "hook", "alert")
_OURS = ("shm", "shm_daemon", "shm_cli")
# sd-daemon(3): the journal takes the importance of a line from the number in front of it.
_PRIORITIES = ((logging.ERROR, "<3>"), (logging.WARNING, "<4>"), (logging.INFO, "<6>"))


def begin_logging(settings: Settings, file: Path | None = None) -> None:
    """Sends what happens to standard error or, where one is named, to a file that is put aside
    once it has grown large.

    Raises UsageError where that file cannot be written.
    """
    handler: logging.Handler = logging.StreamHandler(sys.stderr)
    if file is not None:
        most, n_files = settings.log_file_bytes, settings.log_files
        try:
            handler = RotatingFileHandler(
                file, maxBytes=most, backupCount=n_files, encoding="utf-8"
            )
        except OSError as error:
            raise UsageError(
                f"the log file {file} cannot be written: {error.strerror}.",
                remedy="Name another one with --log-file.",
            ) from error
    journal = file is None and tells_the_journal()
    handler.setFormatter(formatter(settings.log_format, journal))
    level = logging.getLevelNamesMapping()[settings.log_level.upper()]
    logging.basicConfig(level=max(level, logging.INFO), handlers=[handler], force=True)
    for name in _OURS:
        logging.getLogger(name).setLevel(level)


def tells_the_journal() -> bool:
    """Return True if standard error goes to the journal of systemd, which adds the time."""
    try:
        status = os.fstat(sys.stderr.fileno())
    except (OSError, ValueError):
        return False
    return os.environ.get("JOURNAL_STREAM") == f"{status.st_dev}:{status.st_ino}"


def formatter(kind: str, journal: bool = False) -> logging.Formatter:
    """Makes lines of one kind, `text` or `json`."""
    made: logging.Formatter = JsonFormatter()
    if kind == "text":
        made = TextFormatter("%(message)s" if journal else "%(asctime)s %(levelname)s %(message)s")
    return JournalFormatter(made) if journal else made


class TextFormatter(logging.Formatter):
    """One line a message: a file's name must not be able to write lines of its own."""

    def formatMessage(self, record: logging.LogRecord) -> str:  # noqa: N802 (logging's name)
        """Return the message without control characters; a traceback follows on separate lines."""
        line = super().formatMessage(record)
        return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in line)


class JsonFormatter(logging.Formatter):
    """One object a line: time (UTC), level, logger, message, fields, traceback."""

    def format(self, record: logging.LogRecord) -> str:
        """The record as JSON."""
        time = datetime.fromtimestamp(record.created, UTC).isoformat(timespec="milliseconds")
        document: dict[str, object] = {
            "time": time.replace("+00:00", "Z"),
            "level": record.levelname.lower(),
            "logger": record.name,
            "message": record.getMessage(),
        }
        known = ((name, getattr(record, name, None)) for name in FIELDS)
        document |= {name: value for name, value in known if value is not None}
        if record.exc_info:
            document["traceback"] = self.formatException(record.exc_info)
        return json.dumps(document, default=str)


class JournalFormatter(logging.Formatter):
    """Puts the importance in front of each line, which the journal takes off again."""

    def __init__(self, inner: logging.Formatter):
        super().__init__()
        self._inner = inner

    def format(self, record: logging.LogRecord) -> str:
        """The lines, each with its number."""
        numbers = (number for least, number in _PRIORITIES if record.levelno >= least)
        number = next(numbers, "<7>")
        lines = self._inner.format(record).splitlines() or [""]
        return "\n".join(number + line for line in lines)
