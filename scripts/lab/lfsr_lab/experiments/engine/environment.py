"""The machine and the versions of packages that measured figures depend on."""

from __future__ import annotations

import dataclasses
import importlib.util
import os
import platform
import sys
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from lfsr_core import __version__
from lfsr_core.base.errors import LfsrError

PACKAGES = ("bpy", "numpy", "pyoidn", "torch", "OpenImageIO", "opencolorio")
REPORT_PACKAGES = ("Jinja2", "matplotlib")  # of the package lfsr-lab


@dataclasses.dataclass(frozen=True)
class Environment:
    """Machine and versions that figures were measured with; every report has it."""

    cpu: str  # name of the processor
    cores: int  # number of its logical cores
    memory_gib: float | None  # main memory, None where it is not known
    system: str  # operating system
    python: str  # version of Python
    gpu: str | None  # name of the graphics card that PyTorch used, None without one
    versions: dict[str, str]  # of LFSR and of each package that is installed, by name

    @property
    def machine(self) -> str:
        """Processor and graphics card in words."""
        return f"{self.cores} cores of {self.cpu}" + (f" and {self.gpu}" if self.gpu else "")

    @property
    def packages(self) -> str:
        """Names and versions in words."""
        return ", ".join(f"{name} {number}" for name, number in self.versions.items())


def environment() -> Environment:
    """Return the environment of this process; a graphics card is named only once PyTorch is loaded."""
    versions = {"lfsr": __version__} | {name: found for name in PACKAGES if (found := _version(name))}
    return Environment(_cpu(), os.cpu_count() or 1, _memory_gib(), platform.system(), platform.python_version(), _gpu(),
                       versions)


def check_packages() -> None:
    """LfsrError if a package that writes the reports is not installed: before hours of measuring, not after them."""
    for package in REPORT_PACKAGES:
        if importlib.util.find_spec(package.lower()) is None:
            raise LfsrError(f"reports need the Python package {package!r}, which is not installed: install lfsr-lab")


def load_average() -> float | None:
    """Return the load average of the last minute, None where it is not known."""
    return os.getloadavg()[0] if hasattr(os, "getloadavg") else None


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def _cpu() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    return next((line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), platform.machine())


def _memory_gib() -> float | None:
    if sys.platform == "win32":
        return None
    try:
        return round(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30, 1)
    except (ValueError, OSError):
        return None


def _gpu() -> str | None:
    torch = sys.modules.get("torch")  # not imported only to ask: without it no method used a GPU
    return torch.cuda.get_device_name() if torch is not None and torch.cuda.is_available() else None
