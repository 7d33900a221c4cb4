"""The first exchange with @title@: each test has a separate plant, whose clock advances only in the verbs.

    pytest

docs/guide/python.md describes the fixture `commram`.
"""


def test_the_firmware_answers(commram):
@writes_python@
    commram.wait("@prefix@@answer@", @answered@, "@within@")


# A failing test. Remove the first character of each line to see how a failure is reported.
#
#def test_a_wrong_expectation(commram):
#    commram.expect("@prefix@@answer@", @wrong@)
