"""Stage two: from a scenario to a plan in which every input has its one source."""
