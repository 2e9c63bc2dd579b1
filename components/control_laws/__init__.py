"""Laws that controllers, allocators and wheel controls share."""
