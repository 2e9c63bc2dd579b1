"""The master and what stands around it; it never imports components."""
