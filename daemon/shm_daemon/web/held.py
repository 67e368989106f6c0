"""What is held, as the pages and documents of the interface show it."""

from __future__ import annotations

from typing import Any

from shm_daemon.web.site import Site


def held_documents(site: Site, hanger: int | None = None) -> list[dict[str, Any]]:
    """What nobody has decided on yet, the oldest first; of one hanger where named."""
    return [
        {
            "recording": hold.recording_id,
            "file": hold.file_name,
            "hanger": hold.hanger,
            "held_at": hold.held_at,
            "message": hold.message,
        }
        for hold in site.store.recordings.list_holds(hanger)
    ]
