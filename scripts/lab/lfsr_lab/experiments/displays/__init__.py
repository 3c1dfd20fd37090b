"""Three kinds of displays: this way of making their images against the usual one, on the panel and for the eye."""
