"""The golden sentences themselves: what they refuse, and what rewriting keeps."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from orchestrator.errors import ScenarioError
from tests import sentences
from tests.sentences import golden, golden_in, refused


@pytest.fixture
def own(monkeypatch):
    """Sentences of a test of its own."""
    made = sentences._Sentences()
    made.of, made.test = {"t": ["mass must be above 0", "the second"]}, "t"
    monkeypatch.setattr(sentences, "_sentences", made)
    yield made
    made.of = {}


def test_another_text_than_the_golden_is_refused(own):
    assert golden("mass must be above 0")
    with pytest.raises(AssertionError, match="not as in"):
        golden("the second, reworded")
    with pytest.raises(AssertionError, match="no sentence is known"):
        golden("a third")


def test_a_text_without_the_sentence_is_refused(own):
    assert golden_in("a.yaml:3: mass must be above 0 (got -1)")
    with pytest.raises(AssertionError, match="is not in the text"):
        golden_in(["the first", "the third"])


def test_another_code_is_refused(own):
    with pytest.raises(AssertionError), refused(ScenarioError, "axis-unknown"):
        raise ScenarioError("mass must be above 0", code="value-invalid")
    with refused(ScenarioError, "axis-unknown", "value-invalid"):
        raise ScenarioError("mass must be above 0", code="value-invalid")
    own.given = own.of["t"]


def test_a_sentence_that_is_not_asked_for_is_an_error(own):
    assert golden("mass must be above 0")
    with pytest.raises(AssertionError, match="the second"):
        own.end()
    own.of = {}


def test_a_sentence_of_a_test_that_does_not_exist_fails_a_whole_run_and_is_removed_by_rewriting(own):
    here, other = "tests/orchestrator/test_sentences.py", "tests/docs/test_site.py"
    item = SimpleNamespace(nodeid=f"{here}::test_there", get_closest_marker=lambda name: None)

    def collect(*arguments):
        sentences.pytest_collection_modifyitems(SimpleNamespace(args=arguments), [item])

    own.of = {item.nodeid: ["kept"], f"{here}::test_gone": ["unused"]}
    collect(item.nodeid)  # a part of the file
    with pytest.raises(pytest.UsageError, match="test_gone"):
        collect("tests")
    own.of[f"{other}::test_elsewhere"] = ["of a file that is not run"]
    collect(here)
    del own.of[f"{other}::test_elsewhere"]
    own.of["tests/test_that_is_gone.py::test_a"] = ["unused"]
    with pytest.raises(pytest.UsageError, match="test_that_is_gone"):
        collect("tests")
    own.rewriting = True
    collect("tests")
    assert own.of == {item.nodeid: ["kept"]}
    own.rewriting = False


def test_rewriting_keeps_a_sentence_that_holds_and_takes_the_line_most_like_one_that_does_not(own):
    own.rewriting = True
    assert golden_in("a.yaml:3: mass must be above 0 (got -1)")
    assert golden_in("other\nthe very second\n")
    own.end()
    assert own.of["t"] == ["mass must be above 0", "the very second"]
    own.rewriting = False
