"""Display of values to a researcher: one line, a summary, a table in a notebook.

The line is made here. Summaries and tables are made floors above, which values may not import: as
`shm.values` is loaded, the front of the package calls `set_display_package`, and it loads
what is asked for then.
"""

from __future__ import annotations

from typing import Any


class Displayable:
    """A value that a person can read."""

    def summary(self) -> str:
        """Return its content as plain text in the words and the rounding of the report.

        Example:
            >>> print(posterior.summary())
        """
        return str(front().notebook.sheet(self).text)

    def _repr_html_(self) -> str:
        return str(front().notebook.sheet(self).html)


_front: Any = None


def set_display_package(package: Any) -> None:
    """Set the package whose `notebook` and `export` show values."""
    global _front
    _front = package


def front() -> Any:
    """Return the package that was told."""
    return _front


def line(what: str, hanger: int | None, text: str) -> str:
    """Return `<Posterior of hanger 3: 654 kN (90 % credible interval 640 to 671 kN)>`."""
    whose = "" if hanger is None else f" of hanger {hanger}"
    return f"<{what}{whose}: {text}>"
