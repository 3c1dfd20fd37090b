"""The paper's figures and tables, measured again: ``python -m lfsr_lab.experiments.seed_paper``."""
