"""What the tables show of seconds, memory and sizes that other things than single stages take."""

from __future__ import annotations

from rows import Rows


def cost(*results: list[dict]) -> Rows:
    """One row a preset and length of the recording: processor seconds a scan, and memory at its peak."""
    rows = [["recording", "preset", "CPU s per scan", "peak memory"]]
    for preset, result in zip(("default", "paper"), results, strict=False):
        for row in result:
            cells = [f"{row['cpu_seconds_per_scan']:.2f}", f"{row['peak_mb']['all']:.0f} MB"]
            rows.append([row["recording"], f"`{row.get('preset', preset)}`", *cells])
    return rows


def scale(result: list[dict]) -> Rows:
    kinds = {"pool": ("one process", "two processes"), "ray": ("", "Ray, two machines of one core")}
    rows = [
        [
            "workers",
            "recordings",
            "wall s",
            "CPU s per scan",
            "busy",
            "a worker waits between two",
            "memory, first quarter -> all",
        ]
    ]
    for row in result:
        waits = f"{row['overhead_per_recording_s']:.2f} s"
        memory = f"{row['peak_mb_first_quarter']:.0f} -> {row['peak_mb']:.0f} MB"
        cells = [f"{row['wall_s']:.1f}", f"{row['cpu_per_scan_s']:.3f}", f"{100 * row['busy']:.0f} %"]
        rows.append([kinds[row["what"]][row["workers"] - 1], str(row["recordings"]), *cells, waits, memory])
    return rows


def libraries(result: dict) -> Rows:
    """One row a job and implementation, with all that was measured of it."""
    rows = [["job", "of", "measured"]]
    for job, found in result.items():
        if job != "packages":
            rows += [[job, name, _facts(facts)] for name, facts in found.items()]
    return rows


def _facts(facts: dict) -> str:
    return "; ".join(f"{name}: {_fact(value)}" for name, value in facts.items())


def _fact(value: object) -> str:
    if isinstance(value, dict):
        return f"({_facts(value)})"
    if isinstance(value, float):
        return f"{value:,.0f}" if abs(value) >= 100 else f"{value:.3g}"
    return f"{value:,}" if isinstance(value, int) and not isinstance(value, bool) else str(value)


def packages(result: dict) -> Rows:
    rows = [["library", "version", "licence", "MB", "MB with what it needs beside ours"]]
    for name, row in result.get("packages", {}).items():
        rows.append([name, row["version"], row["licence"], f"{row['own MB']:.1f}", f"{row['MB beside ours']:.1f}"])
    return rows


def first_minute(result: dict) -> Rows:
    """One row a command: seconds of the wall and of the processor, kernels to be compiled, compiled, and all there."""
    kinds = ("cold", "warm", "again")
    rows = [["", *kinds]]
    for command, runs in result.items():
        rows.append([f"`{command}`", *(_seconds(runs[kind]) if kind in runs else "-" for kind in kinds)])
    return rows


def _seconds(run: dict) -> str:
    return f"{run['wall']:.0f} s ({run['cpu']:.0f} s CPU)"


def simulator_speed(result: dict) -> Rows:
    rows = [["scenario", "road users", "seen moving", "mean, ms", "max, ms"]]
    for scenario, row in result.items():
        rows.append([f"`{scenario}`", *(f"{row[key]:.0f}" for key in ("movers", "movers_seen", "mean_ms", "max_ms"))])
    return rows
