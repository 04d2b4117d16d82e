"""docs/refusals.md has what the boot says now, and no sentence of it leaves a person without the next step."""

from __future__ import annotations

import re

from campaign.refusals import CLASSES, PAGE, REFUSALS, WRONG_STATE, outcome, page
from canbase_campaign.advice import read_advice

STEPS = re.compile(r"manufacturer's tool|switch the drive off and on|check `axis`|`mode`|the manual of the drive")


def test_the_page_is_up_to_date() -> None:
    before = PAGE.read_text(encoding="utf-8")
    assert page(before) == before, "make refusals"
    assert WRONG_STATE in " ".join(before.split())


def test_what_the_page_says_once_is_said_of_every_required_object() -> None:
    """The rows leave out a refusal that ends so; no other one does."""
    ends = {way for refusal in REFUSALS for way in refusal.ways if outcome(refusal, CLASSES[way]).endswith(WRONG_STATE)}
    assert ends == {"not in this state"}


def test_every_error_names_an_object_and_a_next_step() -> None:
    said = [outcome(refusal, CLASSES[way]) for refusal in REFUSALS for way in refusal.ways]
    errors = [sentence for sentence in said if "**error**" in sentence]
    assert len(errors) > 40
    for sentence in errors:
        advice = read_advice(sentence)
        assert advice.objects, sentence
        assert advice.keys or advice.gives_up or STEPS.search(sentence), sentence


def test_an_optional_object_ends_no_boot_whatever_the_answer_is() -> None:
    optional = {0x1000, 0x1016, 0x1018, 0x1019, 0x1029, 0x6007, 0x605A, 0x605E, 0x6061, 0x6077, 0x6083, 0x6084, 0x6085}
    for refusal in REFUSALS:
        if refusal.key[0] in optional:
            assert not any("**error**" in outcome(refusal, CLASSES[way]) for way in refusal.ways), refusal
