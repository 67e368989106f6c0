"""What must be there, given other rows of the store: a query a rule, each row of it a finding.

Steps are written since schema 0005, holds and fingerprints since 0007. A recording of before 0005
has no step `archived`, so a rule on what happens to a recording asks for that first.
"""

from __future__ import annotations

from dataclasses import dataclass

HISTORY = "What is shown does not need it; a backup has it: `shm db restore FILE --replace`."
WATCH_MISSING = "what the watch said of test {test} of recording {recording} is missing."
WATCH_AGAIN = "Make it again: `shm ingest --again {recording} --from watched`."
RESTORE = "Only a backup has it: `shm db restore FILE --replace`."


@dataclass(frozen=True)
class Rule:
    """Rows of `table` that are missing, one for each row of the query.

    `said` and `remedy` name columns of it. With `counts`, columns that grow as work is done again,
    only those rows count where the first exceeds the second, by as many rows as are missing.
    """

    table: str
    said: str
    remedy: str
    query: str
    counts: tuple[str, ...] = ()


RULES = (
    Rule(
        "holds",
        "the hold of recording {recording} is missing: it waits for a decision that nobody can "
        "make.",
        "Do it again, so that it is held anew: `shm ingest --again {recording}`.",
        """
        SELECT r.id AS recording FROM recordings r
        WHERE r.stage = 'held' AND NOT EXISTS (
            SELECT 1 FROM holds h WHERE h.recording_id = r.id AND h.decision IS NULL)
        """,
    ),
    Rule(
        "holds",
        "a hold of recording {recording} is missing: events tell of {events}, {holds} are there.",
        RESTORE,
        """
        SELECT e.recording_id AS recording, count(*) AS events, (SELECT count(*) FROM holds h
            WHERE h.recording_id = e.recording_id
            AND coalesce(h.decision, '') NOT IN ('withdrawn', 'reinstated')) AS holds
        FROM events e WHERE e.kind = 'held' GROUP BY e.recording_id
        """,
        ("events", "holds"),
    ),
    Rule(
        "events",
        "an event of recording {recording} is missing: it was held {holds} times, events tell of "
        "{events}.",
        HISTORY,
        """
        SELECT h.recording_id AS recording, h.holds, coalesce(e.events, 0) AS events FROM
            (SELECT recording_id, count(*) AS holds FROM holds
             WHERE coalesce(decision, '') NOT IN ('withdrawn', 'reinstated')
             GROUP BY recording_id) h
            LEFT JOIN (SELECT recording_id, count(*) AS events FROM events
             WHERE kind = 'held' GROUP BY recording_id) e ON h.recording_id = e.recording_id
        """,
        ("holds", "events"),
    ),
    Rule(
        "events",
        "an event of recording {recording} is missing: it was {decision}, no event tells of that.",
        HISTORY,
        """
        SELECT h.recording_id AS recording, h.decision, count(*) AS holds,
            (SELECT count(*) FROM events e
                WHERE e.recording_id = h.recording_id AND e.kind = h.decision) AS events
        FROM holds h WHERE h.decision IS NOT NULL GROUP BY h.recording_id, h.decision
        """,
        ("holds", "events"),
    ),
    Rule(
        "holds",
        "a hold of recording {recording} is missing: an event tells that it was {decision}.",
        RESTORE,
        """
        SELECT e.recording_id AS recording, e.kind AS decision, count(*) AS events,
            (SELECT count(*) FROM holds h
                WHERE e.recording_id = h.recording_id AND e.kind = h.decision) AS holds
        FROM events e
        WHERE e.kind IN ('confirmed', 'discarded', 'replaced', 'withdrawn', 'reinstated')
        GROUP BY e.recording_id, e.kind
        """,
        ("events", "holds"),
    ),
    Rule(
        "events",
        "an event of recording {recording} is missing: steps tell of {steps} refusals, events of "
        "{events}.",
        HISTORY,
        """
        SELECT s.recording_id AS recording, s.steps, coalesce(e.events, 0) AS events FROM
            (SELECT recording_id, count(*) AS steps FROM steps
             WHERE stage = 'refused' AND test_id IS NULL GROUP BY recording_id) s
            LEFT JOIN (SELECT recording_id, count(*) AS events FROM events
             WHERE kind IN ('refused', 'discarded', 'withdrawn') GROUP BY recording_id) e
            ON e.recording_id = s.recording_id
        """,
        ("steps", "events"),
    ),
    Rule(
        "events",
        "an event of recording {recording} is missing: it was done {steps} times, none tells why.",
        HISTORY,
        """
        SELECT s.recording_id AS recording, s.steps, s.steps - 1 AS again,
            coalesce(e.events, 0) AS events FROM
            (SELECT recording_id, count(*) AS steps FROM steps
             WHERE stage = 'received' GROUP BY recording_id HAVING count(*) > 1) s
            LEFT JOIN (SELECT recording_id, count(*) AS events FROM events
             WHERE kind IN ('reopened', 'redescribed', 'again') GROUP BY recording_id) e
            ON e.recording_id = s.recording_id
        """,
        ("again", "events", "steps"),
    ),
    Rule(
        "steps",
        "the step {stage} of recording {recording} is missing.",
        HISTORY,
        """
        SELECT r.id AS recording, 'received' AS stage FROM recordings r WHERE NOT EXISTS (
            SELECT 1 FROM steps s WHERE s.recording_id = r.id AND s.stage = 'received')
        UNION ALL SELECT r.id, 'archived' FROM recordings r WHERE r.modified_at IS NOT NULL
            AND NOT EXISTS (
                SELECT 1 FROM steps s WHERE s.recording_id = r.id AND s.stage = 'archived')
            AND NOT EXISTS (SELECT 1 FROM events e WHERE e.recording_id = r.id
                AND e.kind IN ('reopened', 'redescribed'))
        UNION ALL SELECT r.id, r.stage FROM recordings r
            JOIN steps a ON a.recording_id = r.id AND a.stage = 'archived'
            WHERE r.stage IN ('identified', 'done', 'refused', 'held') AND NOT EXISTS (
                SELECT 1 FROM steps s WHERE s.recording_id = r.id AND s.stage = r.stage
                AND s.test_id IS NULL)
        UNION SELECT r.id, r.stage FROM recordings r
            JOIN steps a ON a.recording_id = r.id AND a.stage = 'archived'
            WHERE r.stage = 'done' AND
                (SELECT max(s.id) FROM steps s JOIN tests t ON t.id = s.test_id
                    WHERE s.recording_id = r.id AND s.stage = 'watched'
                    AND t.superseded_at IS NULL) >
                (SELECT max(s.id) FROM steps s WHERE s.recording_id = r.id AND s.stage = 'done')
        """,
    ),
    Rule(
        "steps",
        "the step {stage} of test {test} of recording {recording} is missing.",
        HISTORY,
        """
        SELECT t.recording_id AS recording, t.id AS test, 'identified' AS stage FROM tests t
        WHERE NOT EXISTS (SELECT 1 FROM steps s WHERE s.test_id = t.id AND s.stage = 'identified')
        UNION ALL SELECT t.recording_id, t.id, t.stage FROM tests t
            JOIN steps a ON a.recording_id = t.recording_id AND a.stage = 'archived'
            WHERE t.stage <> (SELECT s.stage FROM steps s WHERE s.test_id = t.id
                AND s.stage <> 'notified' ORDER BY s.id DESC LIMIT 1)
        UNION ALL SELECT t.recording_id, t.id, 'updated' FROM tests t
            JOIN steps a ON a.recording_id = t.recording_id AND a.stage = 'archived'
            WHERE EXISTS (SELECT 1 FROM watches w WHERE w.test_id = t.id
                AND w.superseded_at IS NULL) AND NOT EXISTS (
                SELECT 1 FROM steps s WHERE s.test_id = t.id AND s.stage = 'updated')
        """,
    ),
    Rule(
        "steps",
        "a step of recording {recording} is missing: events tell of {events} refusals, steps of "
        "{steps}.",
        HISTORY,
        """
        SELECT e.recording_id AS recording, count(*) AS events,
            (SELECT count(*) FROM steps s WHERE s.recording_id = e.recording_id
                AND s.stage = 'refused' AND s.test_id IS NULL) AS steps
        FROM events e JOIN steps a ON a.recording_id = e.recording_id AND a.stage = 'archived'
        WHERE e.kind IN ('refused', 'discarded') GROUP BY e.recording_id
        """,
        ("events", "steps"),
    ),
    Rule(
        "steps",
        "a step of recording {recording} is missing: it was received once more than steps tell.",
        HISTORY,
        """
        SELECT e.recording_id AS recording, count(*) + 1 AS events,
            (SELECT count(*) FROM steps s WHERE s.recording_id = e.recording_id
                AND s.stage = 'received') AS steps
        FROM events e JOIN steps a ON a.recording_id = e.recording_id AND a.stage = 'archived'
        WHERE e.kind IN ('reopened', 'redescribed') GROUP BY e.recording_id
        """,
        ("events", "steps"),
    ),
    Rule(
        "steps",
        "a step of recording {recording} is missing: it was held {holds} times.",
        HISTORY,
        """
        SELECT h.recording_id AS recording, count(*) AS holds,
            (SELECT count(*) FROM steps s WHERE s.recording_id = h.recording_id
                AND s.stage = 'held' AND s.test_id IS NULL) AS steps
        FROM holds h WHERE coalesce(h.decision, '') NOT IN ('withdrawn', 'reinstated')
        GROUP BY h.recording_id
        """,
        ("holds", "steps"),
    ),
    Rule(
        "steps",
        "the step notified of test {test} is missing: all hooks were told of its alert.",
        HISTORY,
        """
        SELECT x.test_id AS test, count(*) AS told,
            (SELECT count(*) FROM steps s WHERE s.test_id = x.test_id
                AND s.stage = 'notified') AS steps
        FROM alerts x JOIN tests t ON t.id = x.test_id
        JOIN steps a ON a.recording_id = t.recording_id AND a.stage = 'archived'
        WHERE EXISTS (SELECT 1 FROM deliveries d WHERE d.alert_id = x.id)
            AND NOT EXISTS (
                SELECT 1 FROM deliveries d WHERE d.alert_id = x.id AND d.state = 'waiting'
                AND d.news = 'raised')
        GROUP BY x.test_id
        """,
        ("told", "steps"),
    ),
    Rule(
        "fingerprints",
        "the fingerprint of recording {recording} is missing: a copy of it would not be noticed.",
        "Make it again: `shm ingest --again {recording}`.",
        """
        SELECT r.id AS recording FROM recordings r
        WHERE r.modified_at IS NOT NULL AND r.stage <> 'refused'
            AND NOT EXISTS (SELECT 1 FROM fingerprints f WHERE f.recording_id = r.id)
            AND lower(r.file_name) NOT LIKE '%.modes.json'
            AND EXISTS (SELECT 1 FROM tests t WHERE t.recording_id = r.id
                AND NOT EXISTS (SELECT 1 FROM events e WHERE e.recording_id = r.id
                    AND e.kind IN ('reopened', 'redescribed') AND e.at >= t.identified_at))
        """,
    ),
    Rule(
        "tests",
        "the tests of recording {recording} are missing: it is {stage}, and none is in force.",
        "Make them again: `shm ingest --again {recording}`.",
        """
        SELECT r.id AS recording, r.stage FROM recordings r
        WHERE r.stage NOT IN ('received', 'refused') AND NOT EXISTS (
            SELECT 1 FROM tests t WHERE t.recording_id = r.id AND t.superseded_at IS NULL)
        """,
    ),
    Rule(
        "posterior_tests",
        "the posterior of test {test} of recording {recording} is missing: the test is {stage}.",
        "Make it again: `shm ingest --again {recording} --from updated`.",
        """
        SELECT t.id AS test, t.recording_id AS recording, t.stage FROM tests t
        WHERE t.stage IN ('updated', 'watched') AND t.superseded_at IS NULL
            AND NOT EXISTS (SELECT 1 FROM posterior_tests p WHERE p.test_id = t.id)
        """,
    ),
    Rule(
        "selection_entries",
        "an entry of selection {selection} of hanger {hanger} is missing: ranks have a gap.",
        RESTORE,
        """
        SELECT s.id AS selection, s.hanger FROM selections s
        LEFT JOIN selection_entries e ON e.selection_id = s.id
        GROUP BY s.id, s.hanger HAVING count(e.rank) <> coalesce(max(e.rank), 0) + 1
        """,
    ),
    Rule(
        "selection_entries",
        "an entry of selection {selection} of hanger {hanger} is missing: posterior {posterior} "
        "was made for it.",
        RESTORE,
        """
        SELECT DISTINCT s.id AS selection, s.hanger, p.id AS posterior FROM selections s
        JOIN selection_entries n ON n.selection_id = s.id
        JOIN posteriors p ON p.id IN (n.posterior_id - 1, n.posterior_id + 1)
        WHERE p.hanger = s.hanger AND p.updated_at = s.selected_at
            AND p.id NOT IN (SELECT posterior_id FROM selection_entries)
            AND p.id NOT IN (SELECT posterior_id FROM baselines)
            AND NOT EXISTS (SELECT 1 FROM selection_entries e
                JOIN posteriors o ON o.id = e.posterior_id
                WHERE e.selection_id = s.id AND o.model = p.model)
        """,
    ),
    Rule(
        "selection_entries",
        "an entry of selection {selection} of hanger {hanger} is missing: an adoption adds one to "
        "those of the selection before.",
        RESTORE,
        """
        SELECT s.id AS selection, s.hanger FROM selections s
        JOIN adoptions a ON a.selection_id = s.id
        JOIN selection_entries e ON e.selection_id = s.id
        GROUP BY s.id, s.hanger HAVING NOT EXISTS (
            SELECT 1 FROM selections b JOIN selection_entries f ON f.selection_id = b.id
            WHERE b.hanger = s.hanger AND b.id < s.id GROUP BY b.id
            HAVING count(*) + 1 = (SELECT count(*) FROM selection_entries g
                WHERE g.selection_id = s.id))
        """,
    ),
    Rule(
        "baselines",
        "the baseline of selection {selection} of hanger {hanger} is missing.",
        RESTORE,
        """
        SELECT s.id AS selection, s.hanger FROM selections s
        JOIN selection_entries e ON e.selection_id = s.id AND e.rank = 0
        WHERE NOT EXISTS (SELECT 1 FROM baselines b WHERE b.posterior_id = e.posterior_id)
        """,
    ),
    Rule(
        "baselines",
        "a baseline of hanger {hanger} is missing: posterior {posterior} was made for it.",
        RESTORE,
        """
        SELECT p.hanger, max(p.id) AS posterior FROM posteriors p
        JOIN posterior_tests t ON t.posterior_id = p.id
        WHERE p.superseded_at IS NULL
            AND p.id NOT IN (SELECT posterior_id FROM baselines)
            AND p.id NOT IN (SELECT posterior_id FROM selection_entries)
        GROUP BY p.hanger, t.test_id HAVING count(*) > 1
        UNION SELECT p.hanger, p.id FROM posteriors p
        JOIN posterior_tests t ON t.posterior_id = p.id
        WHERE p.superseded_at IS NULL
            AND p.id NOT IN (SELECT posterior_id FROM baselines)
            AND p.id NOT IN (SELECT posterior_id FROM selection_entries)
        GROUP BY p.hanger, p.id HAVING count(*) > 1
        """,
    ),
    Rule(
        "adoptions",
        "the adoption that made selection {selection} of hanger {hanger} is missing.",
        RESTORE,
        """
        SELECT s.id AS selection, s.hanger FROM selections s
        WHERE EXISTS (SELECT 1 FROM selections f WHERE f.hanger = s.hanger AND f.id < s.id)
            AND NOT EXISTS (SELECT 1 FROM adoptions a WHERE a.selection_id = s.id)
        """,
    ),
    Rule(
        "watches",
        WATCH_MISSING,
        WATCH_AGAIN,
        """
        SELECT t.id AS test, t.recording_id AS recording FROM tests t
        JOIN steps a ON a.recording_id = t.recording_id AND a.stage = 'archived'
        WHERE t.stage = 'watched' AND t.superseded_at IS NULL
            AND NOT EXISTS (SELECT 1 FROM watches w WHERE w.test_id = t.id
                AND w.superseded_at IS NULL)
            AND (SELECT max(s.id) FROM steps s WHERE s.test_id = t.id AND s.stage = 'updated')
                > (SELECT max(s.id) FROM steps s WHERE s.test_id = t.id AND s.stage = 'identified')
            AND (t.hanger, t.name) NOT IN (SELECT o.hanger, o.name FROM baselines b
                JOIN posterior_tests p ON p.posterior_id = b.posterior_id
                JOIN tests o ON o.id = p.test_id)
            AND NOT EXISTS (SELECT 1 FROM silences m WHERE m.is_maintenance
                AND (m.hanger IS NULL OR m.hanger = t.hanger) AND m.starts_at <= t.time
                AND t.time < coalesce(m.ended_at, m.ends_at))
        """,
    ),
    Rule(
        "archive_copies",
        "the note that recording {recording} has a copy in {folder} is missing: its raw file was "
        "removed for that.",
        RESTORE,
        """
        SELECT e.recording_id AS recording, e.message AS folder FROM events e
        WHERE e.kind = 'removed' AND NOT EXISTS (SELECT 1 FROM archive_copies c
            WHERE c.recording_id = e.recording_id AND c.folder = e.message)
        """,
    ),
)
