"""Waiting for a page in a browser, and for what goes on beside a test."""

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


def open_list(browser, server):
    """Open the page with all objects in its list, sure ones too; return the id of the one that is shown."""
    browser.get(server.url)
    shown = int(wait_for(browser, "document.body.dataset.shown", 30))
    browser.execute_script(
        "[...document.querySelectorAll('#filters button')].find((one) => one.textContent.startsWith('all')).click()"
    )
    return shown


def until(asks, seconds=60):
    """Return what `asks` returns as soon as that is something."""
    end = time.monotonic() + seconds
    while not (found := asks()):
        assert time.monotonic() < end
        time.sleep(0.02)
    return found
