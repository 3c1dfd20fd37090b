"""The hint in sentences about unknown names."""

from lfsr_core.base.errors import LfsrError, did_you_mean

FRUIT = ("apple", "banana", "cherry")


def test_the_nearest_name_is_suggested():
    assert did_you_mean("aple", FRUIT) == "did you mean 'apple'? "


def test_nothing_is_suggested_where_nothing_is_near():
    assert did_you_mean("xyz", FRUIT) == did_you_mean("apple", ()) == ""


def test_a_lower_cutoff_suggests_what_is_less_alike():
    assert did_you_mean("berry", FRUIT, cutoff=0.9) == "" and "cherry" in did_you_mean("berry", FRUIT, cutoff=0.4)


def test_a_message_is_one_line_of_bounded_length_with_both_its_ends():
    message = str(LfsrError("what is\nwrong " + "x" * 10_000 + " what to do"))
    assert len(message) <= 300
    assert message.startswith("what is wrong xx") and message.endswith("xx what to do")
