"""[[hook]] tables: what is read, what is refused, and that no message shows a secret."""

from __future__ import annotations

from itertools import takewhile
from pathlib import Path

import pytest

from shm.bridge import AppriseHook, CommandHook, Hook, WebhookHook, load_bridge
from shm.errors import BadInput
from shm.resources import default_config


def read(tmp_path: Path, table: str) -> Hook:
    path = tmp_path / "bridge.toml"
    path.write_text(f'[[hook]]\nname = "ops"\n{table}\n')
    (hook,) = load_bridge(path).hooks
    return hook


def test_the_key_that_only_it_has_tells_the_kind_of_hook(tmp_path: Path) -> None:
    assert read(tmp_path, 'command = ["mail", "x"]') == CommandHook("ops", ("mail", "x"))
    assert read(tmp_path, 'url = "https://a.example/x"\nsecret_env = "S"') == WebhookHook(
        "ops", "https://a.example/x", secret_env="S"
    )
    assert read(tmp_path, 'apprise = ["mailto://u:p@a.example"]') == AppriseHook(
        "ops", ("mailto://u:p@a.example",)
    )
    hook = read(tmp_path, 'apprise_file = "people.txt"')
    assert hook == AppriseHook("ops", address_file="people.txt")
    assert hook.kind == "apprise"


@pytest.mark.parametrize("host", ["localhost", "127.0.0.1", "[::1]"])
def test_this_machine_may_be_told_without_encryption(tmp_path: Path, host: str) -> None:
    hook = read(tmp_path, f'url = "http://{host}:8080/x"\nsecret_file = "s"')
    assert isinstance(hook, WebhookHook)
    assert hook.host == host.strip("[]")


def test_another_machine_is_told_without_encryption_only_where_that_is_asked_for(
    tmp_path: Path,
) -> None:
    table = 'url = "http://10.0.0.7/x"\nsecret_file = "s"\n'
    with pytest.raises(BadInput, match=r"hook ops: url is not encrypted.*allow_http = true"):
        read(tmp_path, table)
    assert isinstance(read(tmp_path, table + "allow_http = true"), WebhookHook)


@pytest.mark.parametrize(
    ("table", "problem"),
    [
        ("", "exactly one of command, url, apprise"),
        ('command = ["x"]\nurl = "https://a.example"', "exactly one of"),
        ('command = "rm -rf"', "command is not a list"),
        ("command = []", "command is not a list"),
        ('command = ["x"]\ntimeout = 3', "unknown key timeout"),
        ('url = "https://a.example"', "needs a secret"),
        ('url = "https://a.example"\nsecret_file = "s"\nsecret_env = "S"', "needs a secret"),
        ('url = "https://a.example"\nsecret_file = ""', "secret_file is not a text"),
        ('url = "ftp://a.example"\nsecret_env = "S"', "not an address of the web"),
        ('url = "https://a.example:port"\nsecret_env = "S"', "not an address of the web"),
        ('url = "https:///x"\nsecret_env = "S"', "not an address of the web"),
        ('url = "https://a.example"\nsecret_env = "S"\nallow_http = 1', "neither true nor false"),
        ('apprise = "json://a.example"', "apprise is not a list"),
        ('apprise = ["json://a.example"]\napprise_file = "x"', "both apprise and apprise_file"),
        ('apprise = ["people"]', "not of the form"),
    ],
)
def test_a_wrong_hook_is_refused_by_name_with_a_remedy(
    tmp_path: Path, table: str, problem: str
) -> None:
    with pytest.raises(BadInput, match=problem) as caught:
        read(tmp_path, table)
    assert caught.value.message.startswith("hook ops: ")
    assert caught.value.remedy


@pytest.mark.parametrize("name", ["", "name = ''", "name = 3", 'name = "a\\nb"'])
def test_a_hook_has_a_name_that_can_be_shown(tmp_path: Path, name: str) -> None:
    path = tmp_path / "bridge.toml"
    path.write_text(f'[[hook]]\n{name}\ncommand = ["true"]\n')
    with pytest.raises(BadInput, match="has no name"):
        load_bridge(path)


@pytest.mark.parametrize(
    "address",
    ["syslog://", "syslog://local0", "rsyslog://h"]
    + [f"{kind}://x" for kind in ("dbus", "windows", "file")],
)
def test_alerts_do_not_go_by_what_acts_on_this_machine(tmp_path: Path, address: str) -> None:
    with pytest.raises(BadInput, match="hook ops"):
        read(tmp_path, f'apprise = ["json://a.example", "{address}"]')


@pytest.mark.parametrize(
    "table",
    [
        'url = "https://a.example/x"\nsecret = "hunter2"',
        'url = "https://me:hunter2@a.example/x"\nsecret_env = "S"',
        'url = "http://a.example/hunter2"\nsecret_env = "S"',
        'apprise = ["exec://me:hunter2@a.example"]',
        'apprise = ["json:/me:hunter2@a.example"]',
    ],
)
def test_no_refusal_shows_a_secret(tmp_path: Path, table: str) -> None:
    with pytest.raises(BadInput) as caught:
        read(tmp_path, table)
    assert "hunter2" not in str(caught.value)


def test_a_hook_does_not_show_its_address_when_it_is_printed(tmp_path: Path) -> None:
    for table in ('apprise = ["json://me:hunter2@a.example"]', WITH_TOKEN):
        assert "hunter2" not in repr(read(tmp_path, table))


WITH_TOKEN = 'url = "https://a.example/hunter2"\nsecret_env = "S"'


def test_each_hook_of_the_template_is_a_valid_one(tmp_path: Path) -> None:
    lines = default_config().read_text().splitlines()
    starts = [number for number, line in enumerate(lines) if line == "# [[hook]]"]
    shown = []
    for start in starts:
        hook = takewhile(lambda line: line.startswith("# "), lines[start:])
        shown += [line.removeprefix("# ") for line in hook]
    path = tmp_path / "bridge.toml"
    path.write_text("\n".join(shown))
    assert [hook.kind for hook in load_bridge(path).hooks] == ["command", "webhook", "apprise"]
