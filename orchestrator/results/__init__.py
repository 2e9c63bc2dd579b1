"""Stage four: results written while a run goes on, and read back."""
