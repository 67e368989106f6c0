"""`shm gap adopt`, `adopted`, `drop`: effects made part of a hanger's model class, and undone."""

from __future__ import annotations

from typing import Any

import rich_click as click

from shm.errors import NothingThere, UsageError
from shm.pipeline import utc_now
from shm.pipeline.adopting import AdoptionRequest, gap_watch
from shm.pipeline.adopting import adopt as adopt_in_store
from shm.report.formatting import model_class
from shm.store import Store, StoredAdoption
from shm.store.watch import list_adoptions, list_selected_models
from shm_cli import completion, flags
from shm_cli.common import answer, opened_store, progress_bar, show, show_rows


@click.command()
@flags.hanger(required=True)
@click.option(
    "--effect",
    "effects",
    multiple=True,
    required=True,
    shell_complete=completion.effects,
    help="May be given twice.",
)
@click.option("--at", multiple=True, show_default="most probable of the diagnosis", help="Where.")
@click.option(
    "--baseline",
    default="",
    show_default="of the diagnosis, else the hanger's own",
    shell_complete=completion.models,
    help="A model class.",
)
@flags.why
@flags.who
@flags.json
def adopt(
    hanger_id: int,
    effects: tuple[str, ...],
    at: tuple[str, ...],
    baseline: str,
    why: str,
    who: str,
) -> None:
    """Make an effect part of a hanger's model class.

    The tests that made the hanger's baseline are updated in baseline + effect, which later tests
    use from then on: selection, updating, drift. The gap is watched afterwards; `shm gap drop`
    undoes it. Where the effect acts is taken from the latest diagnosis unless --at says so.

    \b
    Example: shm gap adopt --hanger 3 --effect point_mass --why "clamp of the lamp at 3.4 m"
    """
    request = AdoptionRequest(effects, at, baseline, why, who)
    with opened_store() as (workspace, store):
        hanger = workspace.bridge.hanger(hanger_id)
        with progress_bar() as progress:
            made = adopt_in_store(workspace, store, hanger, request, utc_now(), progress)
        watch = gap_watch(store, hanger_id)
    sentence = f"Hanger {hanger_id} has the model class {made.adoption.model} from now on."
    answer(_document(made), f"{sentence}\n{watch}")


@click.command()
@flags.hanger()
@click.option("--all", "undone", is_flag=True, help="Those that were dropped too.")
@flags.json
def adopted(hanger_id: int | None, undone: bool) -> None:
    """List adopted effects and the gap since then.

    \b
    Example: shm gap adopted --hanger 3
    """
    with opened_store() as (workspace, store):
        if hanger_id is not None:
            workspace.bridge.hanger(hanger_id)
        found = list_adoptions(store, hanger_id, undone=undone)
        documents = [_watched(store, each) for each in found]
    if not found:
        raise NothingThere(
            "no effect has been adopted.", remedy="Adopt one with `shm gap adopt --effect NAME`."
        )
    if flags.wants_json():
        show({"adoptions": documents})
        return
    headings = (
        "number", "hanger", "class", "adopted", "who", "why", "gap before, with it, now (%)",
        "dropped",
    )  # fmt: skip
    show_rows("adopted effects", headings, map(_row, documents))


@click.command()
@flags.hanger(required=True)
@click.option("--number", type=int, show_default="the only one in force", help="Which adoption.")
@flags.why
@flags.who
@flags.json
def drop(
    hanger_id: int,
    number: int | None,
    why: str,
    who: str,
) -> None:
    """Undo an adoption.

    Class and baseline before it are in force again; tests updated meanwhile keep their posteriors.

    \b
    Example: shm gap drop --hanger 3 --why "the clamp was taken off"
    """
    with opened_store() as (workspace, store):
        workspace.bridge.hanger(hanger_id)
        chosen = _chosen(store, hanger_id, number)
        made = store.posteriors.drop_adoption(chosen.id, why, who, utc_now())
        model = list_selected_models(store)[hanger_id]
    answer(
        _document(made),
        f"Dropped {made.adoption.model}; hanger {hanger_id} has the class {model} again.",
    )


def _chosen(store: Store, hanger_id: int, number: int | None) -> StoredAdoption:
    """Return the adoption asked for, or the only one; raises NothingThere or UsageError."""
    found = list_adoptions(store, hanger_id)
    numbers = ", ".join(str(each.id) for each in found)
    if not found:
        raise NothingThere(
            f"hanger {hanger_id} has adopted nothing.", remedy="See `shm gap adopted --all`."
        )
    if number is None and len(found) > 1:
        raise UsageError(
            f"hanger {hanger_id} has {len(found)} adoptions in force.",
            remedy=f"Give --number, one of {numbers}.",
        )
    if number is None:
        return found[0]
    for each in found:
        if each.id == number:
            return each
    raise NothingThere(
        f"hanger {hanger_id} has no adoption {number} in force.", remedy=f"Give one of {numbers}."
    )


def _watched(store: Store, adopted: StoredAdoption) -> dict[str, Any]:
    watch = gap_watch(store, adopted.adoption.hanger)
    mine = watch is not None and watch.adopted.id == adopted.id
    return {
        **_document(adopted),
        "gap_now_percent": watch.now_percent if watch and mine else None,
        "gap_has_grown": watch.has_grown if watch and mine else None,
    }


def _document(adopted: StoredAdoption) -> dict[str, Any]:
    return {
        "id": adopted.id,
        **vars(adopted.adoption),
        "adopted_at": adopted.adopted_at,
        "undone_at": adopted.undone_at,
        "undone_why": adopted.undone_why or None,
        "undone_who": adopted.undone_who or None,
    }


def _row(document: dict[str, Any]) -> tuple[str, ...]:
    gaps = (document[f"gap_{when}percent"] for when in ("before_", "", "now_"))
    undone = document["undone_at"]
    return (
        str(document["id"]),
        str(document["hanger"]),
        model_class(document["model"]),
        f"{document['adopted_at']:%Y-%m-%d %H:%M}",
        document["who"],
        document["why"],
        ", ".join("none" if gap is None or gap != gap else f"{gap:.2f}" for gap in gaps),
        f"{undone:%Y-%m-%d %H:%M}: {document['undone_why']}" if undone else "",
    )
