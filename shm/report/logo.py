"""The logo of a report's head; a report is made without one that cannot be read."""

from __future__ import annotations

import base64
import io
from dataclasses import dataclass
from pathlib import Path

_KINDS = {"PNG": "image/png", "JPEG": "image/jpeg"}


@dataclass(frozen=True)
class Logo:
    """The bytes of an image, its kind and its size; without bytes `fault` says why."""

    content: bytes = b""
    kind: str = ""
    width: int = 0
    height: int = 0
    fault: str = ""

    @property
    def as_address(self) -> str:
        """For a page that fetches nothing."""
        return f"data:{self.kind};base64,{base64.b64encode(self.content).decode()}"


def read_logo(path: Path | None) -> Logo:
    """The logo in a file; with a `fault` that names it where there is none to be read."""
    if path is None:
        return Logo()
    # Loaded here: a report on a terminal shows no image.
    from PIL import Image

    try:
        content = path.read_bytes()
        with Image.open(io.BytesIO(content), formats=tuple(_KINDS)) as image:
            image.load()
            return Logo(content, _KINDS[str(image.format)], *image.size)
    except OSError as error:
        why = error.strerror or "it is no PNG or JPEG image"
        return Logo(fault=f"Without the logo {path.name}, which cannot be read: {why}")
    except (ValueError, SyntaxError, Image.DecompressionBombError):
        return Logo(fault=f"Without the logo {path.name}, which is no PNG or JPEG image")
