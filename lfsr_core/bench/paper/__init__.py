"""The paper's figures and tables, measured again: ``scripts/reproduce_paper.py``."""
