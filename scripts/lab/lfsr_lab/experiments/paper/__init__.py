"""The paper's figures and tables, measured again: ``python -m lfsr_lab.experiments.paper``."""
