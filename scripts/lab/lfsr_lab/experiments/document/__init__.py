"""The whole instrument as one document: every study by one command, one manifest, one report."""
