"""Models of a single tyre, shared by several components."""
