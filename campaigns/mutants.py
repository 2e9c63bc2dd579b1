"""Mutants of the product, and whether tests notice them: `python -m campaigns.mutants cover|sample|try`.

    pip install coverage cosmic-ray                        # beside the environment of the tests
    git clone . /tmp/c                                     # its modules are altered; with .venv and FMUs
    python -m campaigns.mutants cover /tmp/c /tmp/cover    # which test of the first tier runs which line
    python -m campaigns.mutants sample /tmp/c /tmp/cover /tmp/m.json --number 240 --seed 1
    python -m campaigns.mutants try /tmp/c /tmp/m.json --out /tmp/before.json
    python -m campaigns.mutants try /tmp/c /tmp/m.json --out /tmp/after.json --killed-in /tmp/before.json

Mutants are those of cosmic-ray, drawn from all layers by their numbers of lines; those that differ in
annotations alone are none. A mutant is tried with tests that run its line: first those of the files that are
most about its module, the quickest first, until one fails. `try --killed-in` tries what another run killed,
as after a change of tests: the test that killed it before comes first. A test that also fails without the
mutant kills nothing. Modules that end processes are left out: a mutant of them may end others.
"""

from __future__ import annotations

import argparse
import ast
import contextlib
import json
import os
import random
import re
import resource
import signal
import subprocess
import sys
import time
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest

LAYERS = ("vocabulary", "components", "foundation", "fmus", "orchestrator", "yawbench")
LEFT_OUT = re.compile(
    r"fork_server|supervised_process|child_run|isolation|process_state|interrupts|workers|instance_process"
)
"""Modules of processes."""
DANGEROUS = re.compile(r"kill|rmtree|unlink|setrlimit|\bpid\b|getppid|waitpid|setpgid|fork")
"""Lines without mutants."""
STAGES = ((8, 12.0), (25, 45.0))
"""Most files, and most seconds of their tests as recorded, of each round with a mutant. Chosen: minutes."""
SLOWER = 4.0
"""Seconds that tests may take for each recorded one, after `AT_LEAST`. Chosen: other work goes on."""
AT_LEAST, WHOLE = 60.0, 15.0
TOO_SLOW = "too slow"
MEMORY = 8 << 30
"""Limit of a trial's memory [bytes]."""
AS_RECORDED = {"PYTHONDONTWRITEBYTECODE": "1", "OPENBLAS_NUM_THREADS": "1", "PYTHONHASHSEED": "0"}


# -- which test runs which line: this module as a plug-in of pytest


class Contexts:
    """Plug-in of pytest: tells coverage and child processes which test runs, and notes its time."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.took: dict[str, float] = {}
        self.failed: set[str] = set()

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        self._now(item.nodeid)
        began = time.monotonic()
        try:
            return (yield)
        finally:
            self.took[item.nodeid] = time.monotonic() - began
            self._now("")

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed:
            self.failed.add(report.nodeid)

    def pytest_sessionfinish(self) -> None:
        noted = {"took": self.took, "failed": sorted(self.failed)}
        name = f"took-{os.getpid()}.json"
        (self.folder / name).write_text(json.dumps(noted), encoding="utf-8")

    def _now(self, test: str) -> None:
        import coverage

        from yawbench.foundation import processes

        os.environ["YAWBENCH_TEST"] = test
        processes.server.close()  # the next tells its children of this test
        measured = coverage.Coverage.current()
        if measured is not None:
            measured.switch_context(test)


def pytest_configure(config: pytest.Config) -> None:
    folder = os.environ.get("YAWBENCH_COVER")
    if folder and not hasattr(config, "workerinput"):
        config.pluginmanager.register(Contexts(Path(folder)))


RC = """[run]
source = {checkout}
omit = {checkout}/tests/*
    {checkout}/campaigns/*
    {checkout}/docs/*
    {checkout}/.venv/*
parallel = true
data_file = {folder}/data
context = ${{YAWBENCH_TEST}}
patch = subprocess,fork,_exit
core = ctrace
"""


def cover(checkout: Path, folder: Path) -> None:
    """Run the first tier of the tests, and note which test runs which line, also of child processes."""
    folder.mkdir(parents=True)
    rc = folder / "coveragerc"
    rc.write_text(RC.format(checkout=checkout, folder=folder), encoding="utf-8")
    environment = os.environ | AS_RECORDED | {"YAWBENCH_TEST": "", "YAWBENCH_COVER": str(folder)}
    command = [sys.executable, "-m", "coverage", "run", f"--rcfile={rc}", "-m", "pytest", "-q"]
    options = ["-p", "campaigns.mutants", "-p", "no:cacheprovider", "-m", "not exhaustive"]
    subprocess.run([*command, *options], cwd=checkout, env=environment, check=False)
    subprocess.run([sys.executable, "-m", "coverage", "combine", f"--rcfile={rc}"], cwd=checkout, check=True)


class Covered:
    """Tests by the lines that they run.

    Attributes:
        took: test -> its time [s].
        of: module -> line -> tests.
        about: (module, file of tests) -> share of the lines that the file runs which are the module's.
    """

    def __init__(self, checkout: Path, folder: Path) -> None:
        import coverage

        self.took: dict[str, float] = {}
        failed: set[str] = set()
        for file in folder.glob("took-*.json"):
            noted = json.loads(file.read_text(encoding="utf-8"))
            self.took |= noted["took"]
            failed |= set(noted["failed"])
        for test in failed:
            self.took.pop(test, None)
        data = coverage.CoverageData(str(folder / "data"))
        data.read()
        self.of: dict[str, dict[int, set[str]]] = {}
        lines: dict[tuple[str, str], set[int]] = defaultdict(set)
        of_file: dict[str, int] = defaultdict(int)
        for file in data.measured_files():
            module = Path(file).relative_to(checkout).as_posix()
            by_line = {}
            for line, contexts in data.contexts_by_lineno(file).items():
                tests = {context.split("|")[-1] for context in contexts}
                by_line[line] = {test for test in tests if test in self.took}
                for test_file in {test.partition("::")[0] for test in by_line[line]}:
                    lines[module, test_file].add(line)
            self.of[module] = by_line
        for (_, test_file), ran in lines.items():
            of_file[test_file] += len(ran)
        self.about = {(m, f): len(ran) / of_file[f] for (m, f), ran in lines.items()}

    def rounds(self, module: str, first: int, last: int) -> list[list[str]]:
        """Return the tests to try with a mutant of a statement, in rounds."""
        by_line = self.of.get(module, {})
        tests = set().union(*(by_line.get(line, set()) for line in range(first, last + 1)))
        if not tests:  # what is run on import is seen by those who use the module
            tests = (
                set().union(*by_line.values()) if any(n in by_line for n in range(first, last + 1)) else set()
            )
        by_file: dict[str, list[str]] = defaultdict(list)
        for test in sorted(tests, key=lambda test: self.took[test]):
            by_file[test.partition("::")[0]].append(test)
        order = sorted(by_file, key=lambda file: -self.about.get((module, file), 0.0))
        rounds, done = [], set()
        for most_files, most_seconds in STAGES:
            chosen, left = [], most_seconds
            for file in order[:most_files]:
                share = max(left / 4, most_seconds / 10)
                for test in by_file[file]:
                    if test not in done and self.took[test] < min(share, left):
                        chosen.append(test)
                        done.add(test)
                        share -= self.took[test]
                        left -= self.took[test]
            if chosen:
                rounds.append(
                    sorted(chosen, key=lambda test: (order.index(test.partition("::")[0]), self.took[test]))
                )
        return rounds


# -- mutants


def sample(checkout: Path, covered: Covered, number: int, seed: int) -> list[dict[str, Any]]:
    """Draw mutants from all layers in proportion to their lines, mixed."""
    draw = random.Random(seed)
    modules = {layer: list(_modules(checkout, layer)) for layer in LAYERS}
    length = {
        m: len((checkout / m).read_text(encoding="utf-8").splitlines()) for of in modules.values() for m in of
    }
    lines = {layer: sum(length[m] for m in of) for layer, of in modules.items()}
    drawn: list[dict[str, Any]] = []
    for layer, of in modules.items():
        wanted = max(3, round(number * lines[layer] / sum(lines.values())))
        found: dict[tuple[str, str], dict[str, Any]] = {}
        while len(found) < wanted:
            module = draw.choices(of, [length[m] for m in of])[0]
            mutant = _mutant(checkout, module, draw)
            if mutant is not None:
                mutant["rounds"] = covered.rounds(module, mutant["line"], mutant["last"])
                found[module, mutant["code"]] = mutant
        drawn += found.values()
    draw.shuffle(drawn)
    return drawn


def _modules(checkout: Path, layer: str) -> Iterator[str]:
    for file in sorted((checkout / layer).rglob("*.py")):
        module = file.relative_to(checkout)
        linked = any((checkout / above).is_symlink() for above in module.parents)
        if not linked and not LEFT_OUT.search(file.name) and file.stat().st_size > 200:
            yield module.as_posix()


def _mutant(checkout: Path, module: str, draw: random.Random) -> dict[str, Any] | None:
    """Draw a place of a module, then one of its mutants; None if there is nothing worth a trial."""
    from cosmic_ray.ast import ast_nodes, get_ast
    from cosmic_ray.mutating import mutate_code
    from cosmic_ray.plugins import get_operator, operator_names

    code = (checkout / module).read_text(encoding="utf-8")
    nodes = list(ast_nodes(get_ast(code)))
    places: dict[tuple[int, int], list[tuple[str, int]]] = defaultdict(list)
    alike: dict[str, list[tuple[int, int]]] = {}  # operators that replace the same are where it is
    for name in sorted(operator_names()):
        if not name.startswith("core/") or "Variable" in name or "NoOp" in name:
            continue
        replaced = name.rpartition("_")[0] or name
        if replaced not in alike:
            operator = get_operator(name)()
            alike[replaced] = [start for node in nodes for start, _ in operator.mutation_positions(node)]
        for occurrence, start in enumerate(alike[replaced]):
            places[start].append((name, occurrence))
    if not places:
        return None
    (line, _), choices = draw.choice(sorted(places.items()))
    name, occurrence = draw.choice(choices)
    text = code.splitlines()[line - 1]
    mutated = mutate_code(code, get_operator(name)(), occurrence)
    try:
        if DANGEROUS.search(text) or mutated is None or _essence(mutated) == _essence(code):
            return None
    except SyntaxError:
        return None
    first, last = _statement(code, line)
    changed = [new for old, new in zip(code.splitlines(), mutated.splitlines(), strict=False) if old != new]
    return {
        **{"module": module, "line": line, "first": first, "last": last, "operator": name},
        **{"was": text.strip(), "is": changed[0].strip() if changed else "", "code": mutated},
    }


def _essence(code: str) -> str:
    """Return what a module does: its tree without annotations of functions and locals."""
    tree = ast.parse(code)
    for node in ast.walk(tree):
        if isinstance(node, ast.arg):
            node.annotation = None
        elif isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            node.returns = None
        elif isinstance(node, ast.AnnAssign):
            node.annotation = ast.Name("x", ast.Load())
    return ast.dump(tree)


def _statement(code: str, line: int) -> tuple[int, int]:
    """Return the first and the last line of the innermost statement, without the statements in it."""
    best = (line, line)
    for node in ast.walk(ast.parse(code)):
        if isinstance(node, ast.stmt) and node.lineno <= line <= (node.end_lineno or node.lineno):
            inner = getattr(node, "body", None)
            last = inner[0].lineno - 1 if inner and not isinstance(inner, ast.expr) else node.end_lineno
            if node.lineno >= best[0] or best == (line, line):
                best = (node.lineno, max(node.lineno, last or line))
    return best


# -- trials


def run_tests(checkout: Path, tests: Sequence[str], seconds: float, without: Sequence[str] = ()) -> str:
    """Run tests of a checkout; return the first that failed, or nothing."""
    options = ["-x", "-q", "-p", "no:cacheprovider", "-m", "not exhaustive"]
    options += [f"--deselect={test}" for test in without]
    with subprocess.Popen(
        [sys.executable, "-m", "pytest", *options, *tests], cwd=checkout, env=os.environ | AS_RECORDED,
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
        start_new_session=True, preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY)),
    ) as process:  # fmt: skip
        try:
            told, _ = process.communicate(timeout=seconds)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            return TOO_SLOW
    failed = re.search(r"(?m)^(?:FAILED|ERROR) (\S+?(?:::\S+?(?:\[.*?\])?)?)(?: - .*)?$", told)
    if process.returncode in (0, 5):
        return ""
    return failed[1] if failed else f"status {process.returncode}"


def existing(checkout: Path, tests: Iterable[str]) -> list[str]:
    """Return the tests that a checkout still has, by their files and functions."""
    kept = []
    for test in tests:
        file, _, name = test.partition("::")
        function = name.partition("[")[0].split("::")[-1]
        text = (checkout / file).read_text(encoding="utf-8") if (checkout / file).exists() else None
        if text is not None and (not function or f"def {function}(" in text):
            kept.append(test)
    return kept


class Trials:
    """Trials of mutants in a checkout, whose modules are altered meanwhile."""

    def __init__(self, checkout: Path, took: dict[str, float]) -> None:
        self.checkout = checkout
        self.took = took
        self.passes: dict[str, bool] = {}  # test -> whether it passes without a mutant

    def killer(self, mutant: dict[str, Any], first: str = "") -> str:
        """Return the test that kills a mutant, or nothing.

        Args:
            mutant: with the rounds of tests to try it with.
            first: test that killed it before, tried before all others.
        """
        rounds = [existing(self.checkout, tests) for tests in mutant["rounds"]]
        if first:
            rounds.insert(0, existing(self.checkout, [first]))
        for tests in filter(None, rounds):
            failing = []  # without a mutant, too
            while True:
                with self.mutated(mutant):
                    failed = self.run(tests, failing)
                if not failed:
                    break
                if failed == TOO_SLOW or "::" not in failed or self.passing(failed):
                    return failed
                failing.append(failed)
        return ""

    def passing(self, test: str) -> bool:
        """Whether a test passes without a mutant."""
        if test not in self.passes:
            self.passes[test] = not self.run([test])
        return self.passes[test]

    def run(self, tests: Sequence[str], without: Sequence[str] = ()) -> str:
        known = sum(self.took.get(test, WHOLE if "::" not in test else 1.0) for test in tests)
        return run_tests(self.checkout, tests, AT_LEAST + SLOWER * known, without)

    @contextlib.contextmanager
    def mutated(self, mutant: dict[str, Any]) -> Iterator[None]:
        """Have the checkout hold a mutant, which no compiled module passes for: it is newer than that."""
        file = self.checkout / mutant["module"]
        was, times = file.read_bytes(), file.stat()
        try:
            file.write_text(mutant["code"], encoding="utf-8")
            yield
        finally:
            file.write_bytes(was)
            os.utime(file, ns=(times.st_atime_ns, times.st_mtime_ns))


def try_all(checkout: Path, mutants: Path, out: Path, killed_in: Path | None) -> None:
    """Try mutants in their order, and write after each what became of it; goes on where it was stopped."""
    drawn = json.loads(mutants.read_text(encoding="utf-8"))
    before = json.loads(killed_in.read_text(encoding="utf-8")) if killed_in else {}
    outcomes = json.loads(out.read_text(encoding="utf-8")) if out.exists() else {}
    trials = Trials(checkout, drawn["took"])
    for number, mutant in enumerate(drawn["mutants"]):
        key = str(number)
        first = before.get(key, {}).get("killer", "")
        if key in outcomes or (killed_in and not first):
            continue
        began = time.monotonic()
        killer = trials.killer(mutant, first)
        outcomes[key] = {name: mutant[name] for name in ("module", "line", "operator", "was", "is")}
        outcomes[key] |= {"killer": killer, "tests": sum(map(len, mutant["rounds"]))}
        outcomes[key]["seconds"] = round(time.monotonic() - began, 1)
        out.write_text(json.dumps(outcomes, indent=1), encoding="utf-8")
        print(number, mutant["module"], mutant["line"], killer or "SURVIVES", flush=True)
    killed = sum(bool(one["killer"]) for one in outcomes.values())
    print(f"{killed} of {len(outcomes)} killed")


def main() -> None:
    reading = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    reading.add_argument("step", choices=("cover", "sample", "try"))
    reading.add_argument("checkout", type=Path)
    reading.add_argument("files", nargs="*", type=Path)
    reading.add_argument("--number", type=int, default=240)
    reading.add_argument("--seed", type=int, default=1)
    reading.add_argument("--out", type=Path)
    reading.add_argument("--killed-in", type=Path)
    asked = reading.parse_args()
    checkout = asked.checkout.resolve()
    if asked.step == "cover":
        cover(checkout, asked.files[0].resolve())
    elif asked.step == "sample":
        covered = Covered(checkout, asked.files[0])
        mutants = sample(checkout, covered, asked.number, asked.seed)
        of_all = {test for mutant in mutants for tests in mutant["rounds"] for test in tests}
        took = {test: covered.took[test] for test in sorted(of_all)}
        asked.files[1].write_text(json.dumps({"took": took, "mutants": mutants}, indent=1), encoding="utf-8")
    else:
        try_all(checkout, asked.files[0], asked.out, asked.killed_in)


if __name__ == "__main__":
    main()
