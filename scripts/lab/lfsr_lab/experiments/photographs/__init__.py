"""Calibration from photographs: simulated telephones before random lens sheets."""
