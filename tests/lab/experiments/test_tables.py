"""The one Markdown table."""

from __future__ import annotations

from lfsr_lab.experiments.tables import count, markdown_table, number


def test_cells_are_written_by_what_they_are():
    assert markdown_table(["name", "value"], [["a", 0.12345], [1, None], [True, False]]) == [
        "| name | value |", "| --- | --- |", "| a | 0.123 |", "| 1 | – |", "| yes | no |"]


def test_the_last_letter_aligns_the_columns_behind_it():
    assert markdown_table("abc", [], "lr")[1] == "| --- | ---: | ---: |"
    assert markdown_table("abc", [], "lrlr")[1] == "| --- | ---: | --- |"


def test_numbers_show_what_is_known():
    assert (number(None), number(2, 0.25, 2), number(2.0)) == ("–", "2.00 ± 0.25", "2.000")
    assert (count(None), count(1234567.0)) == ("–", "1,234,567")
