"""General mathematics: integration, filters, control and optimization."""
