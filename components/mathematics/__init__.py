"""Mathematics that knows nothing of cars."""
