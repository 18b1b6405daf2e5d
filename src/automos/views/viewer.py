"""Rerun's viewer for a run: in a window, in a browser on this machine, or as a file for later.

Rerun's own calls to serve a recording listen on every network the machine is in. Its program has an option against it,
so it is started here, bound to 127.0.0.1, and the recording is sent to it.
"""

from __future__ import annotations

import socket
import subprocess
import tempfile
import time
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from automos.core.atomic import atomic_path
from automos.core.claims import claim_file
from automos.core.errors import InputError
from automos.results.run_files import RunFiles
from automos.views.rerun_layout import load_rerun
from automos.views.rerun_log import log_run, make_recording

if TYPE_CHECKING:
    from rerun import RecordingStream

HOST = "127.0.0.1"
START = 20.0
"""Seconds the viewer has to start listening."""
SETTLE = 1.0
"""Seconds after which a window that could not be opened has ended the viewer, which listens before it opens one."""


def save_recording(run: RunFiles, path: Path, max_static: int) -> None:
    """Write `run` as a recording of Rerun to `path`, completely or not at all.

    Raises
    ------
    MissingExtraError
        Rerun is not installed.
    InputError
        A place that cannot be written, or results that are missing or damaged.
    """
    claim_file(path, b"\n\x07automos")  # the application's name and its length, as Rerun writes them
    if not path.parent.is_dir():
        raise InputError(f"{path.parent} is not a folder; choose another --rrd")
    with atomic_path(path) as temporary:
        stream = make_recording(run)
        try:
            stream.save(temporary)
        except RuntimeError as error:
            raise InputError(f"{path} cannot be written ({error}): choose another --rrd") from None
        log_run(run, stream, max_static)
        stream.flush()
        stream.disconnect()


class Viewer:
    """A running viewer to which recordings can be sent; as a context manager, it ends at exit."""

    def __init__(self, web: bool = False, port: int = 0, memory: str = "75%"):
        """Start the viewer: in a window, or `web` to be shown by a browser at `url` (its `port`, 0: any free one).

        Of what it was sent it keeps the latest that fits into `memory`.

        Raises
        ------
        MissingExtraError
            Rerun is not installed.
        InputError
            The viewer does not start.
        """
        program = _program()
        self._port = _free_port()
        self.url = None
        arguments = ["--bind", HOST, "--port", str(self._port)]
        arguments += ["--server-memory-limit", memory, "--memory-limit", memory]
        if web:
            page = port or _free_port()
            arguments += ["--serve-web", "--web-viewer-port", str(page)]
            self.url = f"http://{HOST}:{page}/?url=rerun%2Bhttp%3A%2F%2F{HOST}%3A{self._port}%2Fproxy"
        else:
            arguments += ["--expect-data-soon", "--hide-welcome-screen"]
        self._said = tempfile.TemporaryFile()  # noqa: SIM115 (closed with the viewer)
        self._process = subprocess.Popen(
            [program, *arguments],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=self._said,
            start_new_session=True,  # Ctrl-C is for the one who sends: he ends the viewer when he is done
        )
        try:
            for listening in [self._port, *([page] if web else [])]:
                self._wait_for(listening)
            if not web:
                time.sleep(SETTLE)
                self._require_running()
        except BaseException:
            self.close()
            raise

    @property
    def is_open(self) -> bool:
        """Whether it still runs."""
        return self._process.poll() is None

    def connect(self, stream: RecordingStream) -> None:
        """Connect `stream` to the viewer."""
        stream.connect_grpc(f"rerun+http://{HOST}:{self._port}/proxy")

    def send(self, run: RunFiles, max_static: int) -> None:
        """Send `run` to the viewer, scan after scan; errors as for `log_run`."""
        stream = make_recording(run)
        self.connect(stream)
        log_run(run, stream, max_static)
        while self.is_open:  # a viewer that was closed takes no more
            with suppress(RuntimeError):  # not all was taken within a second
                stream.flush(timeout_sec=1.0)
                break

    def wait(self) -> None:
        """Wait until the viewer is closed, or until Ctrl-C."""
        self._process.wait()

    def close(self) -> None:
        """End the viewer."""
        if self._process.poll() is None:
            self._process.terminate()
            self._process.wait()
        self._said.close()

    def __enter__(self) -> Viewer:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def _wait_for(self, port: int) -> None:
        end = time.monotonic() + START
        while time.monotonic() < end:
            self._require_running()
            with socket.socket() as probe:
                if probe.connect_ex((HOST, port)) == 0:
                    return
            time.sleep(0.05)
        raise InputError(f"the viewer does not answer within {START:.0f} s; write a file with --rrd instead")

    def _require_running(self) -> None:
        if self._process.poll() is None:
            return
        self._said.seek(0)
        last = self._said.read().decode(errors="replace").strip().splitlines()[-1:] or ["it says nothing"]
        raise InputError(
            f"the viewer does not start ({last[0]}); without a screen, write a file with --rrd or use --web"
        )


def _program() -> Path:
    """Return Rerun's program itself, not the script around it, which would leave the program behind when ended."""
    load_rerun()
    import rerun_cli

    folder = Path(rerun_cli.__file__).parent
    names = ("Rerun.app/Contents/MacOS/Rerun", "rerun", "rerun.exe")
    found = next((folder / name for name in names if (folder / name).is_file()), None)
    if found is None:
        raise InputError(
            f"{folder} holds no program of Rerun: install it again, pip install --force-reinstall rerun-sdk"
        )
    return found


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind((HOST, 0))
        return int(probe.getsockname()[1])
