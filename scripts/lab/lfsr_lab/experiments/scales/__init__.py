"""Which scale is best at equal rays, and the model of `--scale auto` fitted to it."""
