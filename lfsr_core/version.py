"""Version of LFSR, as blender_manifest.toml has it."""

__version__ = "0.2.0"
