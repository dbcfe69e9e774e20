"""C3D files by bytes of our own: every field can be set, also to what no writer should write.

Source: the C3D file format, user guide of c3d.org.
"""

import struct

import numpy as np

BLOCK = 512
PROCESSORS = {"intel": 84, "dec": 85, "mips": 86}
# a person of 1.7 m who stands, m
PLACES = {
    "LFHD": (0.09, 0.06, 1.64), "RFHD": (0.09, -0.06, 1.64), "LBHD": (-0.05, 0.06, 1.66), "RBHD": (-0.05, -0.06, 1.66),
    "C7": (-0.08, 0.0, 1.45), "T10": (-0.10, 0.0, 1.23), "CLAV": (0.07, 0.0, 1.38), "STRN": (0.10, 0.0, 1.23),
    "LSHO": (-0.01, 0.17, 1.43), "RSHO": (-0.01, -0.17, 1.43), "LELB": (-0.04, 0.3, 1.12), "RELB": (-0.04, -0.3, 1.12),
    "LASI": (0.08, 0.12, 0.96), "RASI": (0.08, -0.12, 0.96), "LPSI": (-0.12, 0.05, 0.98), "RPSI": (-0.12, -0.05, 0.98),
    "LKNE": (0.01, 0.14, 0.49), "RKNE": (0.01, -0.14, 0.49), "LANK": (-0.02, 0.12, 0.08), "RANK": (-0.02, -0.12, 0.08),
    "LHEE": (-0.08, 0.09, 0.05), "RHEE": (-0.08, -0.09, 0.05), "LTOE": (0.12, 0.10, 0.05), "RTOE": (0.12, -0.10, 0.05),
}  # fmt: skip
# words of the header by name, counted from 1 as in the user guide
WORDS = {"points": 2, "analogs": 3, "first": 4, "last": 5, "gap": 6, "start": 9, "samples": 10}


def person(labels, frames, rate=100.0):
    """Points (F, N, 3) m of a person who glides along x at 1 m/s; other labels are beside the person."""
    still = [PLACES.get(label.rpartition(":")[2], (0.5, 0.01 * i, 1.0)) for i, label in enumerate(labels)]
    steps = np.arange(frames)[:, None, None] / rate
    return np.array(still)[None] + steps * (1.0, 0.0, 0.0)


def floats(values, processor):
    """Bytes of 4-byte floats as a processor holds them."""
    values = np.atleast_1d(np.asarray(values, np.float32)).ravel()
    if processor == "mips":
        return values.astype(">f4").tobytes()
    if processor == "intel":
        return values.astype("<f4").tobytes()
    # VAX F: four times as large a bias of the exponent, and the 16-bit halves exchanged
    halves = (values * np.float32(4)).view("<u2").reshape(-1, 2)
    return np.ascontiguousarray(halves[:, ::-1]).tobytes()


def shorts(values, processor):
    """Bytes of 2-byte integers, those above 32767 as the negative ones of the same bits."""
    return (
        (np.atleast_1d(np.asarray(values, np.int64)) & 0xFFFF).astype(">u2" if processor == "mips" else "<u2").tobytes()
    )


def parameter(name, group, value, processor):
    """A record: int -> 2 bytes, float -> 4, str or list of str -> text, array -> its shape, dimensions reversed."""
    if isinstance(value, (str, list)):
        texts = [value] if isinstance(value, str) else value
        texts = [text.encode("utf-8") if isinstance(text, str) else text for text in texts]
        width = max(map(len, texts), default=0)
        dimensions = [width] if isinstance(value, str) else [width, len(texts)]
        kind, content = -1, b"".join(text.ljust(width) for text in texts)
    else:
        array = np.asarray(value)
        dimensions = list(array.shape[::-1])
        kind, content = (2, shorts(array, processor)) if array.dtype.kind in "iu" else (4, floats(array, processor))
    after = struct.pack("bB", kind, len(dimensions)) + bytes(dimensions) + content + b"\0"
    return record(name, group, after, processor)


def record(name, group, after, processor):
    """A record of the parameter section; `group` negative for a group itself."""
    letters = name.encode("utf-8")
    return struct.pack("bb", len(letters), group) + letters + shorts([len(after) + 2], processor) + after


def c3d_bytes(
    labels,
    points,
    *,
    rate=100.0,
    units=("mm",),
    processor="intel",
    scale=-1.0,
    first=1,
    analogs=None,
    analog_rate=None,
    more=None,
    header=None,
    without=(),
):
    """A C3D of `points` (F, N, 3) in its units, NaN where missing (residual -1).

    `scale`: negative for floats, positive for integers in units of it; `analogs` (F, samples, channels); `more`:
    {"GROUP:NAME": value}, also in place of what is written by itself; `header`: {name of WORDS: value}, as `more`;
    `without`: parameters that are left out.
    """
    frames, count = points.shape[:2]
    samples, channels = (0, 0) if analogs is None else analogs.shape[1:]
    whole = scale > 0
    parameters = {
        "POINT:USED": np.int16(count), "POINT:SCALE": float(scale), "POINT:RATE": float(rate),
        "POINT:DATA_START": np.int16(0), "POINT:FRAMES": np.uint16(min(frames, 65535)),
        **{f"POINT:LABELS{i + 1 if i else ''}": labels[255 * i : 255 * (i + 1)] for i in range(-(-count // 255))},
        "POINT:UNITS": list(units),
        "ANALOG:USED": np.int16(channels), "ANALOG:GEN_SCALE": 1.0, "ANALOG:OFFSET": np.zeros(channels, np.int16),
        "ANALOG:SCALE": np.ones(channels, np.float32), "ANALOG:LABELS": [f"ch{i}" for i in range(channels)],
        "ANALOG:RATE": float(analog_rate if analog_rate is not None else samples * rate),
        **(more or {}),
    }  # fmt: skip
    parameters = {name: value for name, value in parameters.items() if name not in without}
    blocks, section = _section(parameters, processor, 0)
    if "POINT:DATA_START" in parameters and "POINT:DATA_START" not in (more or {}):
        blocks, section = _section(parameters, processor, 2 + blocks)
    words = {
        "points": count, "analogs": samples * channels, "first": first, "last": min(first + frames - 1, 65535),
        "gap": 10, "start": 2 + blocks, "samples": samples, **(header or {}),
    }  # fmt: skip
    head = bytearray(BLOCK)
    head[:2] = 2, 0x50
    for name, value in words.items():
        if name in WORDS:
            head[2 * (WORDS[name] - 1) : 2 * WORDS[name]] = shorts([value], processor)
    head[12:16], head[20:24] = floats([words.get("scale", scale)], processor), floats([rate], processor)
    return bytes(head) + section + _data(points, analogs, scale, whole, processor)


def _section(parameters, processor, start):
    """Number of blocks of the parameter section, and its bytes."""
    groups = list(dict.fromkeys(name.split(":")[0] for name in parameters))
    section = b"".join(record(name, -1 - i, b"\0", processor) for i, name in enumerate(groups))
    for name, value in parameters.items():
        group, _, short = name.partition(":")
        value = np.int16(start) if start and name == "POINT:DATA_START" else value
        section += parameter(short, 1 + groups.index(group), value, processor)
    blocks = -(-(len(section) + 5) // BLOCK)
    return blocks, (struct.pack("4B", 1, 0x50, blocks, PROCESSORS[processor]) + section).ljust(BLOCK * blocks, b"\0")


def _data(points, analogs, scale, whole, processor):
    missing = ~np.isfinite(points).all(axis=-1)
    xyz = np.where(missing[..., None], 0.0, points) / (scale if whole else 1.0)
    residual = np.where(missing, -1, 0)[..., None]
    rows = np.concatenate([np.rint(xyz) if whole else xyz, residual], axis=-1).reshape(len(points), -1)
    if analogs is not None:
        rows = np.concatenate([rows, analogs.reshape(len(points), -1)], axis=-1)
    content = shorts(rows, processor) if whole else floats(rows, processor)
    return content.ljust(-(-len(content) // BLOCK) * BLOCK, b"\0")
