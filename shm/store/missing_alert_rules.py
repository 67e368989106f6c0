"""What must be there of alerts, given other rows of the store: see `missing_rules`."""

from __future__ import annotations

from shm.store.missing_rules import HISTORY, RESTORE, Rule

ALERT_RULES = (
    Rule(
        "acknowledgements",
        "the acknowledgement of alert {alert} is missing: its hold was {decision}.",
        "Acknowledge it anew: `shm alerts ack {alert} --why WHY`.",
        """
        SELECT a.id AS alert, h.decision FROM holds h JOIN recordings r ON r.id = h.recording_id
        JOIN alerts a ON a.key = 'hanger-' || CAST(r.hanger AS TEXT) || ':held-'
            || CAST(h.id AS TEXT)
        WHERE h.decision IS NOT NULL
            AND NOT EXISTS (SELECT 1 FROM acknowledgements k WHERE k.alert_id = a.id)
        """,
    ),
    Rule(
        "deliveries",
        "a delivery is missing: test {test} has a step notified, and no alert of it was told.",
        HISTORY,
        """
        SELECT s.test_id AS test, count(*) AS steps,
            (SELECT count(*) FROM alerts x WHERE x.test_id = s.test_id
                AND EXISTS (SELECT 1 FROM deliveries d WHERE d.alert_id = x.id)) AS told
        FROM steps s WHERE s.stage = 'notified' GROUP BY s.test_id
        """,
        ("steps", "told"),
    ),
    Rule(
        "deliveries",
        "a delivery is missing: {hook} may not be told that alert {alert} is resolved.",
        HISTORY,
        """
        SELECT d.alert_id AS alert, d.hook FROM deliveries d
        JOIN resolutions e ON e.alert_id = d.alert_id
        WHERE d.news = 'raised' AND d.state = 'delivered' AND NOT EXISTS (
            SELECT 1 FROM deliveries o WHERE o.alert_id = d.alert_id AND o.hook = d.hook
                AND o.news = 'resolved')
        """,
    ),
    Rule(
        "resolutions",
        "the resolution of alert {alert} is missing: {hook} is owed the news of it.",
        RESTORE,
        """
        SELECT d.alert_id AS alert, d.hook FROM deliveries d
        WHERE d.news = 'resolved' AND NOT EXISTS (
            SELECT 1 FROM resolutions e WHERE e.alert_id = d.alert_id)
        """,
    ),
)
