"""LFSR: path-traced light-field images for integral-imaging displays.

Importing this package imports neither Blender nor torch.
"""

__version__ = "0.1.0"
