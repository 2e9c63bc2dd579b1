"""Self-contained HTML pages made from results."""
