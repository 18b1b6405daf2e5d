"""The process behind a `LocalPool`: orders from its standard input, reports to its standard output, until both end."""

import logging
import os
import pickle
import queue
import signal
import threading
from typing import BinaryIO

from automos.fleet.orders import Order


def main() -> None:
    """Do orders until there are no more, or the parent is gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole group; the parent decides
    logging.basicConfig(level=logging.ERROR, format="%(name)s: %(message)s")
    incoming, outgoing = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    with open(os.devnull) as nothing:
        os.dup2(nothing.fileno(), 0)
    os.dup2(2, 1)  # what libraries print must not get among the reports
    orders: queue.Queue[Order] = queue.Queue()
    threading.Thread(target=_listen, args=(incoming, orders), daemon=True).start()

    from automos.fleet.units import work

    while True:
        pickle.dump(work(orders.get()), outgoing)
        outgoing.flush()


def _listen(incoming: BinaryIO, orders: queue.Queue[Order]) -> None:
    try:
        while True:
            orders.put(pickle.load(incoming))
    finally:
        os._exit(0)  # nobody is left to report to, even in the middle of an order


if __name__ == "__main__":
    main()
