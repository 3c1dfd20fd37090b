"""Train comparators on photographs; write weights with their provenance.

Needs torch, OpenCV, safetensors and, for the loss curve, matplotlib; neither
OpenImageIO nor OpenColorIO, so it runs on a bare GPU machine.
"""
