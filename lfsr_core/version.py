"""Version of LFSR, as blender_manifest.toml has it."""

__version__ = "0.1.0"
