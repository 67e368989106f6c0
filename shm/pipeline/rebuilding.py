"""Makes damaged results again: tests from the archive, posteriors from the tests.

Each is written over the damaged row, so that baselines, selections and alerts go on referring to
it. The same input, settings, seed and version give the same result, so nothing else changes.
"""

from __future__ import annotations

from datetime import datetime

from shm.pipeline.jobs import Jobs
from shm.pipeline.lineage import identify_lineage, update_terms
from shm.pipeline.registry import registered, run_step
from shm.store import Store, Workspace


def rebuild(workspace: Workspace, store: Store, recording_id: int, at: datetime) -> list[str]:
    """Heals what is damaged of a recording's results; a sentence for each kind of thing done.

    Raises StoreError where the raw file is damaged too, BadInput or UsageError where the present
    description or settings no longer take it.
    """
    said = []
    dropped = store.upkeep.drop_damaged(recording_id)
    if dropped:
        said.append(f"Damaged rows that are made again by themselves, removed: {dropped}.")
    damaged = store.upkeep.damaged_tests(recording_id)
    if damaged:
        recording, selected = store.recordings.get(recording_id), store.posteriors.selected_models()
        terms = (workspace.bridge, workspace.settings, selected)
        found = run_step(registered().identify, recording, workspace.archive, *terms)
        lineage = identify_lineage(recording, found[0].test.hanger, workspace)
        store.upkeep.heal_tests(damaged, found, lineage)
        said.append(f"Damaged tests, identified again from the archive: {len(damaged)}.")
    posteriors = store.upkeep.damaged_posteriors(recording_id)
    for each in posteriors:
        tests = [store.tests.get(test_id) for test_id in each.tests]
        hanger = workspace.bridge.hanger(tests[0].hanger)
        taught = Jobs(workspace, store, lambda: at).taught(hanger, min(t.time for t in tests))
        options, lineage = update_terms(
            hanger, [each.model], tests, workspace.settings, taught=taught
        )
        plain = [test.test for test in tests]
        selection = run_step(registered().select, plain, hanger, [each.model], options)
        store.upkeep.heal_posterior(each.id, selection.selected, tests, lineage, at)
    if posteriors:
        said.append(f"Damaged posteriors, made again from their tests: {len(posteriors)}.")
    return said
