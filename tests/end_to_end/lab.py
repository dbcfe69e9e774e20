"""A capture as a lab would keep it: three people, their names in the sheet only, and recordings that tell of machines.

INPUTS   the simulation
OUTPUTS  a project folder without `simulate:`; a name of host, user, path and a word that is found nowhere else are in
         the topics, frame ids, callers and file names of the bags, in the C3D files and in the EXIF of the pictures
"""

import re
import struct

import ezc3d
from rosbags import rosbag1

from dior.simulate import config, settings, simulate, simulate_gallery, simulate_mocap

SETTINGS = {
    "subjects": 3, "sequences": 1, "duration_s": 3.0, "width": 640, "height": 360, "fx": 320.0, "gallery": True,
    "jpeg_quality": 80,
}  # fmt: skip
PEOPLE = {"S01": "Okonkwo", "S02": "Lindqvist", "S03": "Zielinska"}
STONES = {"01": "basalt", "02": "quartz", "03": "marble"}
WALKS = {
    f"{place}_{n}": f"{name}_{STONES[n]}" for place, name in (("indoor", "hall"), ("outdoor", "lawn")) for n in STONES
}
HOST, USER, PLACE, WORD = "gaitpc-7b", "j.recorder", "/home/j.recorder/nvme0", "Xylophage"
MACHINE = (HOST, USER, "nvme0", WORD)
DATA = f"recordings/{HOST}"


def write(folder, monkeypatch):
    """Write the project; bags and motion capture are made by the simulation, and told about by a machine."""
    config.write(settings.from_dict(SETTINGS), folder / "config")
    for path in sorted((folder / "config").rglob("*")):
        if path.is_file():
            path.write_text(_renamed(path.read_text()))
            path.rename(path.with_name(_renamed(path.name)))
    path = folder / "config/config.yaml"
    text = path.read_text().split("\n# The capture is simulated.")[0] + "\n"
    text = text.replace("data_root: results/simulate", f"data_root: {DATA}")
    path.write_text(text.replace("clip_seconds: 4.0", "clip_seconds: 0.5"))
    for path in (folder / "config/sessions").glob("*/cam*.yaml"):
        path.write_text(path.read_text().replace("topic: /", f"topic: /{HOST.replace('-', '_')}/"))
    sheet = folder / "config/sequences.tsv"
    sheet.write_text("".join(re.sub(r"\t[^\t]*$", "\n", line) for line in sheet.open()))
    _record(folder / DATA, monkeypatch)


def _renamed(text):
    for old, new in {**WALKS, **PEOPLE, "pc1.bag": f"{HOST}-a.bag", "pc2.bag": f"{HOST}-b.bag"}.items():
        text = re.sub(rf"(?<![A-Za-z0-9]){re.escape(old)}(?![A-Za-z0-9])", new, text)
    return text


def _record(data, monkeypatch):
    class Writer(rosbag1.Writer):
        def add_connection(self, topic, *args, **kwargs):
            topic = f"/{HOST.replace('-', '_')}{topic}"
            return super().add_connection(topic, *args, **kwargs | {"callerid": f"/record_{USER}_{WORD}"})

    header, image = simulate._header, simulate._image
    with monkeypatch.context() as patched:
        patched.setattr(rosbag1, "Writer", Writer)
        patched.setattr(simulate, "_header", lambda s, i, ns, name: header(s, i, ns, f"{HOST}/{WORD}/{name}"))
        patched.setattr(simulate, "_image", lambda store, head, jpeg: image(store, head, signed(jpeg)))
        for walk in WALKS:
            for step in (simulate, simulate_mocap, simulate_gallery):
                if step != simulate_mocap or walk.startswith("indoor"):
                    step.run(settings=SETTINGS, sequence=walk, out=data)
    for path in sorted(data.rglob("*.jpg")):
        path.write_bytes(signed(path.read_bytes()).tobytes())
    for path in sorted(data.rglob("*.c3d")):
        _sign_c3d(path)
    for path in sorted(data.rglob("*"), key=lambda path: -len(path.parts)):
        path.rename(path.with_name(_renamed(path.name)))


def signed(jpeg):
    """JPEG bytes with an EXIF block and a comment of the machine."""
    import numpy as np

    jpeg = bytes(bytearray(jpeg))
    text = f"{HOST} {USER} {PLACE} {WORD}\0".encode()
    tiff = b"II*\0" + struct.pack("<IHHHIII", 8, 1, 0x010E, 2, len(text), 26, 0) + text
    segments = b"".join(
        marker + struct.pack(">H", len(content) + 2) + content
        for marker, content in ((b"\xff\xe1", b"Exif\0\0" + tiff), (b"\xff\xfe", text))
    )
    return np.frombuffer(jpeg[:2] + segments + jpeg[2:], np.uint8)


def _sign_c3d(path):
    file = ezc3d.c3d(str(path))
    labels = file["parameters"]["POINT"]["LABELS"]["value"]
    file["parameters"]["POINT"]["LABELS"]["value"] = [_renamed(label) for label in labels]
    file.add_parameter("SUBJECTS", "NAMES", [PEOPLE["S01"]])
    file.add_parameter("MANUFACTURER", "COMPANY", [f"{USER} at {HOST}"])
    file.add_parameter("TRIAL", "FOLDER", [f"{PLACE}/{WORD}"])
    file.write(str(path))
