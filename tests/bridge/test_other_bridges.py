"""[[other_bridge]] tables: what is read, and what is refused with a remedy."""

from __future__ import annotations

from pathlib import Path

import pytest

from shm.bridge import OtherBridge, load_bridge
from shm.errors import BadInput


def read(folder: Path, *tables: str) -> tuple[OtherBridge, ...]:
    path = folder / "bridge.toml"
    path.write_text("\n".join(f"[[other_bridge]]\n{table}\n" for table in tables))
    return load_bridge(path).other_bridges


def test_a_bridge_is_named_with_its_dashboard_and_its_files(tmp_path: Path) -> None:
    plain = 'name = "Severn"\naddress = "http://127.0.0.1:8401/"'
    whole = 'name = "Arch"\naddress = "https://arch.example:8400"\ntoken_file = "a.token"\n'
    whole += 'certificate_file = "ours.pem"'
    assert read(tmp_path, plain, whole) == (
        OtherBridge("Severn", "http://127.0.0.1:8401"),
        OtherBridge("Arch", "https://arch.example:8400", "a.token", "ours.pem"),
    )
    assert read(tmp_path) == ()


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ('address = "https://a.example"', "name is missing"),
        ('name = "a\\u001b"\naddress = "https://a.example"', "name = "),
        ('name = "a"', "address is not an address of the web"),
        ('name = "a"\naddress = "ftp://a.example"', "address is not an address of the web"),
        ('name = "a"\naddress = "http://a.example"', "address is not encrypted"),
        ('name = "a"\naddress = "https://u:p@a.example"', "address holds a user or password"),
        ('name = "a"\naddress = "https://a.example/hangers/3"', "address is that of a page"),
        ('name = "a"\naddress = "https://a.example/?x=1"', "address is that of a page"),
        ('name = "a"\naddress = "https://a.example"\ntoken = "t0p"', "no place for a token"),
        ('name = "a"\naddress = "https://a.example"\ntoken_file = 3', "token_file = 3"),
        ('name = "a"\naddress = "https://a.example"\nurl = "x"', "unknown key url"),
    ],
)
def test_a_wrong_table_is_refused_with_a_remedy(tmp_path: Path, table: str, said: str) -> None:
    with pytest.raises(BadInput) as caught:
        read(tmp_path, table)
    assert said in caught.value.message
    assert caught.value.remedy
    assert caught.value.line is not None
    assert "t0p" not in str(caught.value)


def test_a_network_that_is_trusted_may_go_without_encryption(tmp_path: Path) -> None:
    table = 'name = "a"\naddress = "http://a.example"\nallow_http = true'
    assert read(tmp_path, table) == (OtherBridge("a", "http://a.example"),)


def test_two_bridges_of_one_name_are_refused(tmp_path: Path) -> None:
    table = 'name = "a"\naddress = "https://a.example"'
    with pytest.raises(BadInput, match="other_bridge name a is given twice"):
        read(tmp_path, table, table)
