"""A choice that does not exist is one clear error, wherever it is made."""

from __future__ import annotations

import pytest

from naoimitate.balance.offset import OffsetLaw
from naoimitate.core.errors import SettingsError
from naoimitate.settings import CHOICES, SHIFTS, Settings


@pytest.mark.parametrize("name", CHOICES)
def test_a_choice_that_does_not_exist_is_named_with_those_that_do(name: str) -> None:
    for choice in CHOICES[name]:
        assert getattr(Settings(**{name: choice}), name) == choice
    with pytest.raises(
        SettingsError, match=f"^settings: {name} is 'nonsense', choose one of {', '.join(CHOICES[name])}$"
    ):
        Settings(**{name: "nonsense"})


def test_so_is_one_of_the_weight_shift() -> None:
    for shift in SHIFTS:
        assert Settings(offset=OffsetLaw(shift=shift)).offset.brisk == (shift == "pendulum")
    with pytest.raises(SettingsError, match="pendulum, parabola"):
        Settings(offset=OffsetLaw(shift="nonsense"))
