"""What a stranger's machine throws at the interface: whatever its own description allows, and not.

SHM_SCHEMA_EXAMPLES says how many requests each route gets; the suite gives it few.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterator

import pytest
import schemathesis
from hypothesis import HealthCheck, given, settings
from schemathesis.checks import not_a_server_error
from schemathesis.specs.openapi.checks import (
    content_type_conformance,
    response_schema_conformance,
    status_code_conformance,
)

from shm_daemon.heartbeat import HEARTBEAT
from tests.helpers.slow import few_of
from tests.helpers.taken_in import with_a_loss
from tests.helpers.web_servers import Served, served

EXAMPLES = int(os.environ.get("SHM_SCHEMA_EXAMPLES", "5"))
CHECKS = [
    not_a_server_error,
    status_code_conformance,
    content_type_conformance,
    response_schema_conformance,
]
ROUTES = (
    "POST /api/recordings",
    "POST /api/imports",
    "GET /api/recordings",
    "GET /api/recordings/{key}",
    "POST /api/streams/{name}/chunks",
    "GET /api/status",
    "GET /api/hangers",
    "GET /api/hangers/{hanger_id}",
    "GET /api/hangers/{hanger_id}/trend",
    "GET /api/hangers/{hanger_id}/figures/{name}",
    "GET /api/hangers/{hanger_id}/tests",
    "GET /api/hangers/{hanger_id}/tests/{test}",
    "GET /api/hangers/{hanger_id}/tests/{test}/hits",
    "GET /api/hangers/{hanger_id}/tests/{test}/figures/{figure}",
    "GET /api/alerts",
    "POST /api/alerts/{alert_id}/acknowledgement",
    "GET /api/bridge",
    "GET /api/bridge/moved",
    "GET /api/bridge/summary",
    "GET /api/bridges",
    "GET /api/compare/figure",
    "GET /api/operation",
    "GET /api/operation/examination",
    "GET /api/streams",
    "GET /api/streams/{name}/figure",
    "GET /health",
    "GET /metrics",
)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    """Yield a bridge with a history and an alert, whose daemon has just been seen."""
    workspace = with_a_loss(tmp_path_factory.mktemp("schema") / "bridge")
    with served(workspace) as site:
        heartbeat = workspace.folder / HEARTBEAT
        heartbeat.touch()
        later = time.time() + 3600  # however long the trial takes
        os.utime(heartbeat, (later, later))
        yield site


@pytest.fixture(scope="module")
def schema(site: Served) -> schemathesis.BaseSchema:
    return schemathesis.openapi.from_url(f"{site.url}/openapi.json")


def test_the_routes_are_those_that_are_tried(schema: schemathesis.BaseSchema) -> None:
    found = [result.ok().label for result in schema.get_all_operations()]
    assert sorted(found) == sorted(ROUTES)


@pytest.mark.parametrize("route", few_of(ROUTES, 8))
def test_requests_as_described(site: Served, schema: schemathesis.BaseSchema, route: str) -> None:
    verb, path = route.split()
    kinds = list(schemathesis.GenerationMode)
    if route == "GET /health":
        kinds.remove(schemathesis.GenerationMode.NEGATIVE)  # it takes nothing that could be wrong
    for kind in kinds:

        @given(case=schema[path][verb].as_strategy(generation_mode=kind))
        @settings(
            max_examples=EXAMPLES,
            deadline=None,
            database=None,
            derandomize=True,
            suppress_health_check=list(HealthCheck),
        )
        def tried(case: schemathesis.Case) -> None:
            headers = {"Authorization": f"Bearer {site.write_token}"}
            case.call_and_validate(checks=CHECKS, headers=headers)

        tried()
