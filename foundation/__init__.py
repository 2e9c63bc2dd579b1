"""Foundation: errors, messages, files, the cache and processes; knows nothing of FMUs or cars."""
