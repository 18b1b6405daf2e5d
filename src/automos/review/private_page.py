"""A file by which the browser of a review finds the page, for its owner alone.

Every user of a machine sees the arguments of its processes, and a browser's are what it is to open. So it is to open a
file that only the reviewer may read, and the token at the end of the address stands in there.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from automos.core.atomic import faults_reported


@contextmanager
def private_page(folder: Path, url: str) -> Iterator[Path]:
    """Yield a page in `folder` that leads to `url`, which its owner alone may read; it is gone after the block.

    Browsers in a sandbox may not read the system's folder for temporary files, but the results that they show.
    """
    path = folder / "open_review.html"
    with faults_reported(path):
        path.unlink(missing_ok=True)  # of a review that was killed
        with open(path, "x", encoding="utf-8", opener=partial(os.open, mode=0o600)) as file:
            file.write(
                f'<!doctype html><title>AutoMOS review</title><meta http-equiv="refresh" content="0; url={url}">\n'
            )
    try:
        yield path.absolute()
    finally:
        path.unlink(missing_ok=True)
