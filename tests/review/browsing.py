"""Waiting for a page in a browser."""

import time


def wait_for(browser, script, seconds=15):
    """Return what `script` returns as soon as that is something."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        found = browser.execute_script(f"return {script}")
        if found:
            return found
        time.sleep(0.05)
    raise AssertionError(f"never true: {script}")
