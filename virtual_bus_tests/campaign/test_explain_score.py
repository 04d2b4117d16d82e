"""Recordings whose truth is known: `canbase explain` is right, or cannot tell. Hundreds: campaign.explain_score."""

from __future__ import annotations

import pytest

from campaign.explain_score import answers, told
from campaign.scores import WRONG

pytestmark = [pytest.mark.campaign, pytest.mark.timeout(600)]
WERE_WRONG = (6003, 6036, 6047, 6089, 6128)
"""Numbers across a gap, a velocity that is stuck, old statuswords, and a TRC file with a date."""


def test_explain_is_right_or_cannot_tell() -> None:
    found = list(answers(WERE_WRONG))
    assert len(found) == 6 * len(WERE_WRONG)
    assert [told(answer) for answer in found if answer.score == WRONG] == []
