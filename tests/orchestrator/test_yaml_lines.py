"""YAML files: aliases, merge keys and comments, what they come to, and where they end."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.refusals import each_mentions, mentions
from yawbench.orchestrator.scenario.yaml_lines import Document, read


def sentences(made):
    return [str(error) for error in made.sorted_errors()]


@pytest.fixture
def document(tmp_path, monkeypatch):
    """Read a text as the file a.yaml."""
    monkeypatch.chdir(tmp_path)

    def read_text(text: str) -> Document:
        Path("a.yaml").write_text(text, encoding="utf-8")
        return read(Path("a.yaml"), what="scenario file")

    return read_text


def test_a_merge_key_takes_in_what_the_mapping_does_not_give_itself_with_its_line(document):
    made = document("a: &a\n  x: 1\n  y: {z: 2}\nb:\n  y: 3\n  <<: *a\n  w: 4\n")
    assert made.data["b"] == {"x": 1, "y": 3, "w": 4}
    assert not made.errors
    assert str(made.location(("b", "x"))) == "a.yaml:2: b.x"
    assert str(made.location(("b", "y"))) == "a.yaml:5: b.y"


def test_of_several_merged_mappings_the_first_one_counts(document):
    made = document("a: &a {x: 1}\nb: &b {x: 2, y: 2}\nc: {<<: [*a, *b]}\n")
    assert made.data["c"] == {"x": 1, "y": 2}


def test_a_quoted_merge_key_is_a_name_like_any_other(document):
    assert document("a: {'<<': 1}\n").data == {"a": {"<<": 1}}


@pytest.mark.parametrize("value", ["1", "[1]", "[*a, 2]"])
def test_a_merge_key_takes_nothing_but_mappings(document, value):
    made = document(f"a: &a {{x: 1}}\nb: {{<<: {value}}}\n")
    assert each_mentions(sentences(made), ("a.yaml:2", "alias", "aliases"))


@pytest.mark.parametrize("text", ["a: &a {x: 1, <<: *a}\n", "a: &a [*a]\n"])
def test_what_holds_or_merges_itself_is_refused(document, text):
    (sentence,) = sentences(document(text))
    assert mentions(sentence, "a.yaml:1", "alias", "itself")


@pytest.mark.parametrize(
    ("first", "next_", "line"),
    [("[1, 1, 1, 1, 1, 1, 1, 1, 1, 1]", "[{}]", "a.yaml:3"), ("{a: 1}", "{{<<: [{}]}}", "a.yaml:4")],
)
def test_aliases_of_aliases_that_would_fill_the_memory_are_refused(document, monkeypatch, first, next_, line):
    monkeypatch.setattr("yawbench.orchestrator.scenario.yaml_lines.ALIASED", 1000)
    lines = [f"x0: &x0 {first}"]
    lines += [f"x{n}: &x{n} {next_.format(', '.join([f'*x{n - 1}'] * 10))}" for n in range(1, 10)]
    made = document("\n".join(lines))
    assert made.data is None
    assert each_mentions(sentences(made), (line, "1000"))


def test_a_chain_of_aliases_too_deep_to_follow_is_refused(document):
    opened, closed = "[" * 30, "]" * 30
    lines = [f"x0: &x0 {opened}{closed}", *(f"x{n}: &x{n} {opened}*x{n - 1}{closed}" for n in range(1, 20))]
    (sentence,) = sentences(document("\n".join(lines)))
    assert mentions(sentence, "a.yaml:2", "40 collections")


def test_a_long_list_without_aliases_is_no_bomb(document, monkeypatch):
    monkeypatch.setattr("yawbench.orchestrator.scenario.yaml_lines.ALIASED", 50)
    assert document(f"a: {[*range(100)]}").data == {"a": [*range(100)]}


def test_a_line_that_names_the_version_of_yaml_is_read(document):
    assert document("%YAML 1.2\n---\na: yes\n").data == {"a": "yes"}


def test_a_text_that_was_read_before_has_the_same_errors_and_data_of_its_own(document):
    text = "a: {b: 1}\nc: !!int x\nd: !!int x\n"
    first, again = document(text), document(text)
    assert len(sentences(first)) == 2
    assert sentences(first) == sentences(again)
    first.data["a"]["b"] = 2
    assert document(text).data["a"] == again.data["a"] == {"b": 1}


def test_very_many_brackets_are_refused_before_they_are_scanned(document):
    (sentence,) = sentences(document("a:\n  " + "[" * 100_000))
    assert mentions(sentence, "a.yaml:2", "40 brackets")


def test_comments_are_kept_by_their_line_and_a_number_sign_in_a_text_is_none(document):
    made = document(
        "# first\n#  above\na: {b: 'x # y', c: z#1}  # beside: d # e\n\n"
        "'k # l': |  \n  # text\n  more\nm: 1 #last"
    )
    assert made.comments == {3: "beside: d # e", 8: "last"}
    assert made.comment_lines == {1: "first", 2: "above"}
    assert made.comment(("a", "b")) == "beside: d # e"
    assert (made.comment_above(("a",)), made.comment_above(("m",))) == ("first above", "")
    assert made.comment(("k # l",)) == made.comment(("nothing",)) == ""
