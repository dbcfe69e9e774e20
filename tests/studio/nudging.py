"""A long-range camera nudged by keys, and how long that takes; `benchmarks/studio.py` prints it."""


def opened(one):
    """Wait until the page Long range has drawn its skeletons."""
    one.wait_for_selector("#crops[data-count]")


def pressed(one, key):
    """Press a key and wait until what it does is drawn: ms it took."""
    count = one.get_attribute("#crops", "data-count")
    one.keyboard.press(key)
    one.wait_for_selector(f"#crops:not([data-count='{count}'])")
    return float(one.get_attribute("#crops", "data-redraw"))


def redraws(one, times=100):
    """ms that each of so many steps of a nudge takes from the key to the drawn skeletons, as the page measures it."""
    return [pressed(one, "ArrowRight" if i % 2 else "ArrowLeft") for i in range(times)]
