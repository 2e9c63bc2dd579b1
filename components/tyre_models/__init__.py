"""Laws of one tyre, where more than one unit asks for them."""
