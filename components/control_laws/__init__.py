"""Control laws shared by controllers, references, allocators and wheel controls."""
