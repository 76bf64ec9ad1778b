"""A Ray cluster of several nodes on this machine, whose processes can be killed."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final
from unittest import mock

from gymnasium.error import DependencyNotInstalled

_LEAST_STORE: Final = 80 * 2**20
"""Smallest object store of a node that Ray takes, bytes."""


class LocalCluster:
    """A head that computes nothing, and nodes of one processor each."""

    def __init__(self, cluster: Any) -> None:
        self._cluster = cluster
        self.nodes: list[Any] = []

    @property
    def address(self) -> str:
        """HOST:PORT of the head."""
        return str(self._cluster.address)

    def add_node(self) -> None:
        """Start a node."""
        self.nodes.append(self._cluster.add_node(num_cpus=1, object_store_memory=_LEAST_STORE, wait=False))

    def kill_node(self, index: int) -> None:
        """Kill (−9) a node's own processes; its workers end with them."""
        self._cluster.remove_node(self.nodes.pop(index), allow_graceful=False)

    def working(self) -> list[int]:
        """Process numbers of the workers that are in the middle of a job."""
        raylets = {node.all_processes["raylet"][0].process.pid for node in self.nodes}
        listed = subprocess.run(["ps", "-A", "-o", "pid=,ppid=,args="], capture_output=True, text=True, check=True)
        processes = [line.split(maxsplit=2) for line in listed.stdout.splitlines()]
        return [
            int(pid) for pid, parent, title in processes if int(parent) in raylets and title.startswith("ray::work")
        ]

    def kill_worker(self, pid: int) -> None:
        """Kill (−9) a worker."""
        os.kill(pid, signal.SIGKILL)


@contextmanager
def local_cluster(nodes: int) -> Iterator[LocalCluster]:
    """Start a cluster whose workers find the modules that this process finds; end all its processes."""
    try:
        from ray.cluster_utils import Cluster
    except ImportError as error:
        raise DependencyNotInstalled('ray is not installed: pip install "aframe-heave[cluster]"') from error
    path = os.pathsep.join(filter(None, sys.path))
    with mock.patch.dict(os.environ, RAY_USAGE_STATS_ENABLED="0", PYTHONPATH=path):
        head = {"num_cpus": 0, "object_store_memory": _LEAST_STORE, "include_dashboard": False}
        cluster = Cluster(initialize_head=True, head_node_args=head)
        try:
            started = LocalCluster(cluster)
            for _ in range(nodes):
                started.add_node()
            cluster.wait_for_nodes()
            yield started
        finally:
            cluster.shutdown()
