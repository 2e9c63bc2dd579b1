"""All campaigns, one after the other: `make campaigns`, or `python -m campaigns [--seed 1] [NAME ...]`."""

from __future__ import annotations

import argparse
import subprocess
import sys
import time

CAMPAIGNS = {
    "altered": "--each 100",
    "result_folders": "--every 4",
    "wrong_calls": "",
    "hostile_fmus": "",
    "kills": "--each 10",
    "kills --full-disk": "--each 3",
    "translated": "--programs 600",
    "translated --classes": "--programs 600",
    "random_calls": "--sequences 5",
}
"""Campaign, with what it tries -> its options, so that each takes minutes."""
UNSEEDED = ("result_folders", "wrong_calls", "hostile_fmus")
"""They try all cases, or every so manieth."""


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m campaigns", description=__doc__.partition("\n")[0])
    parser.add_argument("names", nargs="*", help=f"default: all ({', '.join(CAMPAIGNS)})")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    if unknown := set(given.names) - set(CAMPAIGNS):
        parser.error(f"{', '.join(sorted(unknown))} is none of {', '.join(CAMPAIGNS)}")
    failed = []
    for name in given.names or CAMPAIGNS:
        seeded = [] if name in UNSEEDED else ["--seed", str(given.seed)]
        command = ["-m", *f"campaigns.{name} {CAMPAIGNS[name]}".split(), *seeded]
        print(f"\n== python {' '.join(command)}", flush=True)
        began = time.monotonic()
        if subprocess.run([sys.executable, *command], check=False).returncode:
            failed.append(name)
        print(f"== {name}: {time.monotonic() - began:.0f} s", flush=True)
    sys.exit(f"did not hold: {', '.join(failed)}" if failed else 0)


if __name__ == "__main__":
    main()
