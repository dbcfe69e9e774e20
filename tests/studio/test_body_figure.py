"""The drawn body has every marker, and left is left."""

from dior.body import names
from dior.studio import body_figure


def test_every_marker_has_words_and_a_place():
    views = body_figure.drawn()
    shown = {name for view in views.values() for name, _, _ in view}
    assert shown == set(names.PLUG_IN_GAIT_39)
    assert all(body_figure.words(name) for name in names.PLUG_IN_GAIT_39) and not body_figure.words("MARKER_7")
    assert all(0 < x < 100 and 0 < y < 220 for view in views.values() for _, x, y in view)
    assert set(body_figure.EASY) <= set(names.PLUG_IN_GAIT_39)


def test_the_subjects_left_is_to_the_right_of_the_front_and_to_the_left_of_the_back():
    views = {view: {name: (x, y) for name, x, y in found} for view, found in body_figure.drawn().items()}
    for view, sign in (("front", 1), ("back", -1)):
        for name, (x, y) in views[view].items():
            if names.side_of(name) == "left":
                assert sign * (x - 50) > 0
                assert views[view][names.mirrored(name)] == (100 - x, y)
    assert views["back"]["RBAK"][0] > 50
    assert body_figure.words("LWRA") == "left wrist, on the side of the thumb"
