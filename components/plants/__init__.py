"""Plants: vehicle models without the tyres."""
