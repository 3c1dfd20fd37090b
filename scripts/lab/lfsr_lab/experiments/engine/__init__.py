"""One engine for all studies: cells, renders, records, accuracy, report."""
