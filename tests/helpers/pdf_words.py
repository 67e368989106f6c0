"""The words of a PDF file that reportlab made, page by page, by the fonts' own tables of signs."""

from __future__ import annotations

import base64
import re
import zlib
from dataclasses import dataclass

_OBJECT = re.compile(rb"(\d+) 0 obj\r?\n(.*?)endobj", re.DOTALL)
_STREAM = re.compile(rb"stream\r?\n(.*?)\s*endstream", re.DOTALL)
_FONT_USE = re.compile(rb"/(F\d+(?:\+\d+)?) [\d.]+ Tf|\(((?:\\.|[^\\()])*)\) Tj", re.DOTALL)
_ESCAPE = re.compile(rb"\\([0-7]{1,3}|.)", re.DOTALL)
_NAMED = {b"n": b"\n", b"r": b"\r", b"t": b"\t", b"b": b"\b", b"f": b"\f"}


@dataclass(frozen=True)
class Pdf:
    """A parsed file: its objects as bytes by number, streams decoded."""

    objects: dict[int, bytes]

    @classmethod
    def parse(cls, content: bytes) -> Pdf:
        return cls({int(n): _decoded(body) for n, body in _OBJECT.findall(content)})

    @property
    def pages(self) -> list[str]:
        """The words of each page in the order in which they were set."""
        bodies = [body for body in self.objects.values() if re.search(rb"/Type /Page\b", body)]
        return [self._words(self._referred(body, rb"Contents")) for body in bodies]

    @property
    def words(self) -> str:
        """All pages, blanks and line ends as one blank."""
        return " ".join(" ".join(self.pages).split())

    @property
    def fonts(self) -> dict[str, bytes]:
        """The font objects by the names that pages use."""
        named = {}
        for body in self.objects.values():
            for name, number in re.findall(rb"/(F\d+(?:\+\d+)?) (\d+) 0 R", body):
                named[name.decode()] = self.objects[int(number)]
        return named

    def _words(self, content: bytes) -> str:
        signs = {name: self._signs(font) for name, font in self.fonts.items()}
        told, font = [], ""
        for name, text in _FONT_USE.findall(content):
            if name:
                font = name.decode()
            else:
                told.append("".join(signs[font].get(code, "\ufffd") for code in _plain(text)))
        return " ".join(told)

    def _signs(self, font: bytes) -> dict[int, str]:
        table = self._referred(font, rb"ToUnicode")
        single = re.findall(rb"<(\w\w)> <(\w{4})>\n", table)
        found = {int(code, 16): chr(int(sign, 16)) for code, sign in single}
        for first, signs in re.findall(rb"<(\w\w)> <\w\w> \[(.*?)\]", table, re.DOTALL):
            for offset, sign in enumerate(re.findall(rb"<(\w{4})>", signs)):
                found[int(first, 16) + offset] = chr(int(sign, 16))
        return found

    def _referred(self, body: bytes, key: bytes) -> bytes:
        found = re.search(rb"/" + key + rb" (\d+) 0 R", body)
        return self.objects[int(found[1])] if found else b""


def _decoded(body: bytes) -> bytes:
    stream = _STREAM.search(body)
    if stream is None:
        return body
    data = stream[1].strip() if b"/ASCII85Decode" in body else stream[1]
    if b"/ASCII85Decode" in body:
        data = base64.a85decode(b"<~" + data, adobe=True)
    return zlib.decompressobj().decompress(data) if b"/FlateDecode" in body else data


def _plain(text: bytes) -> bytes:
    def byte(found: re.Match[bytes]) -> bytes:
        code = found[1]
        return bytes([int(code, 8)]) if code.isdigit() else _NAMED.get(code, code)

    return _ESCAPE.sub(byte, text)
