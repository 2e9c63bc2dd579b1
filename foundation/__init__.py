"""What every other room stands on: errors and diagnostics, messages, files, the cache, processes, plug-ins.

It knows nothing of FMUs, runs or cars. Whoever changes what a diagnostic looks like, how a file is written
whole, how a child process is started and ended, or how a package registers what it adds, is right here.

Not here: what an error says (where it is raised).
"""
