"""What only Unix has is asked for, not taken for granted: labelling does without it, as on Windows."""

import ast
import subprocess
import sys
from pathlib import Path

import automos

UNIX = ("fcntl", "resource", "pwd", "grp", "termios")
WITHOUT = f"""
import os, shutil, subprocess, sys, tempfile

for name in {UNIX}:
    sys.modules[name] = None
for name in ("getuid", "geteuid", "fchmod", "mkfifo", "sysconf", "sched_getaffinity", "getloadavg", "O_DIRECTORY"):
    delattr(os, name)
from automos.cli import main
for line in sys.stdin:
    sys.argv = ["automos", *line.rstrip("\\n").split("\\t")]
    try:
        main()
    except SystemExit as ended:
        assert not ended.code, line
"""


def test_no_module_needs_what_only_unix_has_to_be_imported():
    for path in Path(automos.__file__).parent.rglob("*.py"):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            names = [one.name for one in node.names] if isinstance(node, ast.Import) else []
            names += [node.module] if isinstance(node, ast.ImportFrom) else []
            assert not set(names) & set(UNIX), path


def test_a_recording_is_labelled_and_exported_without_what_only_unix_has(lane_run, tmp_path):
    log, run = lane_run.parent / "lane", tmp_path / "run"
    commands = [
        ("label", log, "--out", run, "--workers", "1"),
        ("report", run),
        ("export", run, log, "--to", "pcd", "--out", tmp_path / "pcd"),
    ]
    lines = "".join("\t".join(map(str, words)) + "\n" for words in commands)
    ended = subprocess.run([sys.executable, "-c", WITHOUT], input=lines, capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stderr
    assert (run / "report.html").exists()
    assert list((tmp_path / "pcd").glob("*.pcd"))
    names = sorted(path.name for path in (run / "predictions").iterdir())
    assert names == sorted(path.name for path in (lane_run / "predictions").iterdir())
    for name in names:
        assert (run / "predictions" / name).read_bytes() == (lane_run / "predictions" / name).read_bytes()
