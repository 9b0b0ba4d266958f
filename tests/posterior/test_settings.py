"""Settings of an inference are written and changed by name."""

import pytest

import tanteo
from tanteo.posterior import DEFAULTS


def test_a_representation_has_the_changed_fields_only():
    assert repr(DEFAULTS) == "Settings()"
    assert repr(DEFAULTS.changed("search.rounds", 4)) == "Settings(search.rounds=4)"


def test_an_unknown_setting_is_refused_with_a_near_name():
    with pytest.raises(tanteo.InputError, match=r"search\.rounds"):
        DEFAULTS.changed("search.round", 4)
