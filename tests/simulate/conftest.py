import pytest

from dior.simulate import settings, simulate, simulate_mocap

TINY = {"subjects": 1, "sequences": 1, "duration_s": 2.0, "width": 640, "height": 360, "fx": 320.0}


@pytest.fixture(scope="session")
def tiny(tmp_path_factory):
    """A tiny capture on disk: its settings and its data_root."""
    folder = tmp_path_factory.mktemp("capture")
    for name in ("indoor_01", "outdoor_01"):
        simulate.run(settings=TINY, sequence=name, out=folder)
    simulate_mocap.run(settings=TINY, sequence="indoor_01", out=folder)
    return settings.from_dict(TINY), folder
