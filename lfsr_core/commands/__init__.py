"""The verbs of ``lfsr``: arguments in, calls to the core, one printed summary out."""
