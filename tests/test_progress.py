import pytest

from dior.progress import reporting


def clock(step_s):
    """A clock that goes on by `step_s` at every look."""
    return (step_s * i for i in range(10**6)).__next__


def test_a_short_step_says_nothing(capsys):
    assert list(reporting(range(29), 29, "pictures", "walk", clock(0.1))) == list(range(29))
    assert capsys.readouterr() == ("", "")


def test_a_long_step_says_now_and_then_how_far_it_is(capsys):
    asked = []
    items = reporting(range(301), lambda: asked.append(1) or 301, "pictures", "walk, cam01", clock(0.1))
    assert list(items) == list(range(301))
    out, err = capsys.readouterr()
    assert out == "" and "\r" not in err and err.endswith("\n") and asked == [1]
    assert err.splitlines() == [
        "walk, cam01: 29 of 301 pictures (10 %), about 28 s left",
        "walk, cam01: 129 of 301 pictures (43 %), about 17 s left",
        "walk, cam01: 229 of 301 pictures (76 %), about 7 s left",
    ]


def test_more_than_was_said_is_no_reason_to_stop(capsys):
    assert len(list(reporting(range(100), 10, "pictures", "walk", clock(0.1)))) == 100
    assert "29 of 10 pictures (290 %)\n" in capsys.readouterr().err


def test_an_error_of_the_items_comes_through():
    def broken():
        yield 1
        raise ValueError("half a bag")

    with pytest.raises(ValueError, match="half a bag"):
        list(reporting(broken(), 2, "pictures", "walk"))
