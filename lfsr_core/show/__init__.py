"""Images on displays: through Looking Glass Bridge, or full screen in a browser."""
