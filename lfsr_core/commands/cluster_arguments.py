"""Arguments of verbs that can work on several workers."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from lfsr_core.errors import LfsrError

if TYPE_CHECKING:
    from lfsr_core.sequence.cluster import Cluster

MOST_WORKERS = 256


def add_cluster_arguments(parser: argparse.ArgumentParser, when: str = "") -> None:
    """Whose workers do the work; ``when``: words of help before each."""
    parser.add_argument("--workers", type=int, metavar="N", help=f"{when}on N workers of this machine")
    parser.add_argument("--cluster", metavar="ADDRESS",
                        help=f"{when}on the workers of this Dask scheduler, such as tcp://host:8786")


def chosen_cluster(arguments: argparse.Namespace) -> Cluster | None:
    """The cluster asked for, None for this process alone; LfsrError where both kinds were."""
    from lfsr_core.sequence.cluster import Cluster

    if arguments.workers is not None and arguments.cluster is not None:
        raise LfsrError(f"--workers {arguments.workers} and --cluster were both given: leave out one of them")
    if arguments.workers is not None and not 1 <= arguments.workers <= MOST_WORKERS:
        raise LfsrError(f"workers are {arguments.workers}, but they must be 1 to {MOST_WORKERS}")
    if arguments.cluster is not None:
        return Cluster(arguments.cluster)
    return Cluster(workers=arguments.workers) if arguments.workers else None
