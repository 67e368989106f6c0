"""The logo of a report: what is read of it, and what is said where it cannot be."""

from __future__ import annotations

import base64
from pathlib import Path

import pytest
from PIL import Image

from shm.report.paper import Logo, read_logo


@pytest.mark.parametrize(("form", "kind"), [("PNG", "image/png"), ("JPEG", "image/jpeg")])
def test_a_logo_is_kept_as_it_is_with_its_size(form: str, kind: str, tmp_path: Path) -> None:
    path = tmp_path / "logo"
    Image.new("RGB", (7, 4)).save(path, form)
    logo = read_logo(path)
    assert logo == Logo(path.read_bytes(), kind, 7, 4)
    head, _, content = logo.as_address.partition(",")
    assert head == f"data:{kind};base64"
    assert base64.b64decode(content) == logo.content


def test_a_report_without_a_logo_has_none() -> None:
    assert read_logo(None) == Logo(b"", "", 0, 0, "")


def test_a_logo_that_cannot_be_read_is_a_fault_that_names_it(tmp_path: Path) -> None:
    assert read_logo(tmp_path / "a.png").fault == (
        "Without the logo a.png, which cannot be read: No such file or directory"
    )
    other = tmp_path / "b.png"
    Image.new("RGB", (7, 4)).save(other, "GIF")
    assert read_logo(other).fault == (
        "Without the logo b.png, which cannot be read: it is no PNG or JPEG image"
    )
    broken = tmp_path / "c.png"
    Image.new("RGB", (70, 40)).save(broken, "PNG")
    broken.write_bytes(broken.read_bytes()[:60])
    assert read_logo(broken).fault.startswith("Without the logo c.png, which ")
    assert read_logo(broken).content == b""
