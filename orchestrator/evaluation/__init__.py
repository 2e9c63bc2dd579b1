"""What standard tests make of recorded or measured signals: quantities, verdicts, pictures."""
