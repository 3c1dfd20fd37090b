"""Marks of tests that need more than the package: they skip on a developer's machine and fail where CI is set."""

import importlib.util
import os

import pytest

needs_bpy = pytest.mark.skipif(importlib.util.find_spec("bpy") is None and not os.environ.get("CI"),
                               reason="needs the bpy wheel")
