"""Grafana's files: as built, complete to the SDK's models, and with the words of our states."""

from __future__ import annotations

import importlib.util
import json
import sys
from types import ModuleType

import pytest
import yaml
from grafana_foundation_sdk.cog.encoder import JSONEncoder
from grafana_foundation_sdk.cog.plugins import register_default_plugins
from grafana_foundation_sdk.models import alerting
from grafana_foundation_sdk.models.dashboard import Dashboard

from shm.report.hanger_status import Status
from shm.values.messages import URGENCIES
from tests.helpers.pages import ROOT

FOLDER = ROOT / "config" / "grafana"
BOARDS = sorted(FOLDER.glob("*/dashboards/*.json"))
RULES = sorted(FOLDER.glob("*/alert-rules.yaml"))


@pytest.fixture(scope="module")
def built() -> ModuleType:
    """Import the script that writes them; nothing is written."""
    spec = importlib.util.spec_from_file_location("grafana_files", ROOT / "docs/grafana_files.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["grafana_files"] = module  # its dataclasses look their module up
    spec.loader.exec_module(module)
    return module


def test_files_are_as_built(built: ModuleType) -> None:
    found = {
        str(path.relative_to(FOLDER)): path.read_text()
        for path in FOLDER.rglob("*")
        if path.is_file()
    }
    assert found == built.files()


def test_levels_are_our_states(built: ModuleType) -> None:
    assert tuple(state.value for state in reversed(Status)) == built.STATES
    assert tuple(word.replace(" ", "_") for word in built.URGENCIES) == URGENCIES


@pytest.mark.parametrize("path", BOARDS, ids=lambda path: f"{path.parts[-3]}-{path.stem}")
def test_dashboard_fits_its_model(path) -> None:
    register_default_plugins()
    document = json.loads(path.read_text())
    read = Dashboard.from_json(document)

    assert json.loads(json.dumps(read, cls=JSONEncoder))["panels"] == document["panels"]
    assert document["uid"]
    assert {panel["datasource"]["uid"] for panel in document["panels"]} == {
        panel["targets"][0]["datasource"]["uid"] for panel in document["panels"]
    }


@pytest.mark.parametrize("path", RULES, ids=lambda path: path.parts[-2])
def test_alert_rules_fit_their_model(path) -> None:
    (group,) = yaml.safe_load(path.read_text())["groups"]
    for document in group["rules"]:
        rule = alerting.Rule.from_json(document)
        refs = {query.ref_id for query in rule.data}
        assert rule.condition in refs
        assert {query["model"]["refId"] for query in document["data"]} == refs
    assert len({rule["uid"] for rule in group["rules"]}) == len(group["rules"])
