"""The machines of a Ray cluster: work is placed by cores and memory; machines may come and go."""

import logging
import socket
from typing import Any

from automos.core.errors import InputError
from automos.core.extras import import_extra
from automos.core.parallel import SAFE_PATH
from automos.core.working_folder import standing_elsewhere
from automos.fleet.local_pool import Executor
from automos.fleet.orders import Ended, Order
from automos.fleet.units import work
from automos.fleet.work_folder import thread_limits

_log = logging.getLogger(__name__)


class RayCluster(Executor):
    """A cluster on whose machines automos is installed; `cores` and `slots` follow it as machines come and go."""

    def __init__(self, address: str, memory: int):
        """Join the cluster at `address` ("auto": the one this machine belongs to); each order needs `memory` bytes.

        Raises
        ------
        MissingExtraError : Ray is not installed.
        InputError : no cluster answers.
        """
        ray = import_extra("ray", "scale", "--ray needs Ray, which is not installed: {1}")
        try:
            if not ray.is_initialized():
                _probe(address)
                environment = {"env_vars": {**thread_limits(1), **SAFE_PATH}}
                with standing_elsewhere():  # Ray's workers look for modules where its driver stands when it joins
                    ray.init(address, log_to_driver=False, logging_level=logging.ERROR, runtime_env=environment)
        except (ConnectionError, ValueError, RuntimeError, OSError) as error:
            raise InputError(f"no Ray cluster answers at {address} ({error}): start one: ray start --head") from None
        self._ray, self._memory = ray, memory
        self._work = ray.remote(max_retries=0)(work)
        self._orders: dict[Any, Order] = {}
        super().__init__(1, 1, max_threads=1)
        self._count()
        self._warn_if_none_fits()

    def submit(self, order: Order) -> None:
        """Hand an order to the cluster."""
        from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

        where = "DEFAULT" if order.home is None else NodeAffinitySchedulingStrategy(order.home, soft=False)
        options = self._work.options(num_cpus=order.threads, memory=self._memory, scheduling_strategy=where)
        self._orders[options.remote(order)] = order

    def wait(self, seconds: float) -> list[Ended]:
        """Return orders that ended or were lost with their process or machine."""
        self._count()
        done, _ = self._ray.wait(list(self._orders), num_returns=1, timeout=seconds) if self._orders else ([], [])
        return [self._ended(reference) for reference in done]

    def has(self, place: str) -> bool:
        """Return whether a machine is in the cluster and alive."""
        return any(node["NodeID"] == place and node["Alive"] for node in self._ray.nodes())

    def close(self) -> None:
        """Call back what is not done and leave the cluster."""
        for reference in self._orders:
            self._ray.cancel(reference, force=True)
        self._orders.clear()
        self._ray.shutdown()

    def _count(self) -> None:
        self.cores = max(1, int(self._ray.cluster_resources().get("CPU", 1)))
        # A few more than there are cores: none waits, and a cluster that can grow sees what it would grow for.
        self.slots = self.cores + max(2, self.cores // 4)

    def _warn_if_none_fits(self) -> None:
        """Warn if no machine is large enough, which would look like a run that hangs; one may still join."""
        alive = [node["Resources"] for node in self._ray.nodes() if node["Alive"]]
        largest = max((has.get("memory", 0.0) for has in alive if has.get("CPU", 0.0) >= 1.0), default=0.0)
        if largest < self._memory:
            _log.warning(
                "a worker is to have %.1f GB (--memory), but no machine of the cluster offers more than %.1f GB with a "
                "core: waiting for one that does",
                self._memory / 1e9,
                largest / 1e9,
            )

    def _ended(self, reference: Any) -> Ended:
        order = self._orders.pop(reference)
        try:
            return Ended(order, self._ray.get(reference))
        except self._ray.exceptions.RayError as error:
            kind, line = type(error).__name__, (str(error).strip().splitlines() or [""])[0]
            return Ended(order, None, f"its worker was lost ({kind}: {line[:200].rstrip('.')})")


def _probe(address: str) -> None:
    """Raise OSError if nobody listens at a host:port; Ray itself would wait for minutes."""
    host, _, port = address.rpartition("//")[2].rpartition(":")
    if port.isdecimal():
        socket.create_connection((host, int(port)), timeout=10.0).close()
