"""Training: photographs or rendered EIAs in, weights with provenance out.

Needs torch, OpenCV, safetensors and, for the loss curve, matplotlib; neither
OpenImageIO nor OpenColorIO, so it runs on a bare GPU machine.
"""
