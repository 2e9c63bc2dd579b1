"""Laws of one tyre, shared by several components."""
