"""All warnings in run.json as sentences: for the terminal, the ledger of many recordings, the viewer and the review."""

from typing import Any

SHOWN = 4
"""Number of places worth a look that are listed in sentences; all are in the report and in the review."""


def sentences_of(run: dict[str, Any]) -> list[str]:
    """Return all warnings of `run`, what run.json holds: of the whole first, then of the gravest places."""
    places = [warning["sentence"] for warning in run.get("warnings", []) if "scan" in warning]
    left = len(places) - SHOWN
    more = [f"{left} more such; automos review shows them"] if left > 0 else []
    return [*general_sentences(run), *places[:SHOWN], *more]


def general_sentences(run: dict[str, Any]) -> list[str]:
    """Return the warnings of `run` that concern all of it: recording, odometry, poses, decisions that were lost."""
    return [
        *run.get("recording", {}).get("warnings", []),
        *run.get("odometry", {}).get("warnings", []),
        *(warning["sentence"] for warning in run.get("warnings", []) if "scan" not in warning),
        *run.get("review", {}).get("lost", []),
    ]
