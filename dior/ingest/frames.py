"""The index of all pictures of a sequence.

INPUTS   the sequence's bags (one per recording computer, possibly split in time).
OUTPUTS  `frames` table: cameras in the order of their names, frames numbered from 0 per camera by header stamp (ns);
         with bag, topic, receive stamp and nth it takes to read a picture back (`bags.read_pictures`).
"""

import os
from collections import Counter
from pathlib import Path

import numpy as np

from dior import tables
from dior.errors import DiorError
from dior.ingest import bags as rosbag


def run(*, sequence, bags, data_root, topics, out):
    """Index `bags` (paths) for the cameras of `topics` (dict camera -> image topic). See the module's docstring."""
    for what, values in (("bag", [str(bag) for bag in bags]), ("topic", list(topics.values()))):
        twice = [value for value, count in Counter(values).items() if count > 1]
        if twice:
            raise DiorError(f"{sequence}: {what} {twice[0]} is given twice")
    if not bags:
        raise DiorError(f"{sequence}: no bag is given; fill in `bags` in sequences.tsv")
    holders = {camera: rosbag.bags_with(bags, topic, f"{sequence}, {camera}") for camera, topic in topics.items()}
    indexes = {}
    for bag in bags:
        wanted = [topics[camera] for camera, holding in holders.items() if bag in holding]
        if wanted:
            indexes[_relative(bag, data_root)] = rosbag.index(bag, wanted)
    parts = [_of_camera(sequence, camera, topics[camera], indexes) for camera in sorted(topics)]
    tables.write(out, "frames", {key: np.concatenate([part[key] for part in parts]) for key in parts[0]})


def _relative(bag, data_root):
    return Path(os.path.relpath(bag, data_root)).as_posix()


def _of_camera(sequence, camera, topic, indexes):
    """Rows of one camera from the indexes of all bags, sorted by header stamp."""
    picked = {bag: tables.rows(index, index["topic"] == topic) for bag, index in indexes.items()}
    table = {key: np.concatenate([part[key] for part in picked.values()]) for key in next(iter(picked.values()))}
    table["bag"] = np.concatenate([np.full(len(part["topic"]), bag, object) for bag, part in picked.items()])
    order = np.lexsort((table["receive_ns"], table["stamp_ns"]))
    table = tables.rows(table, order)
    _check_one_size(sequence, camera, table)
    table["camera"] = np.full(len(order), camera, object)
    table["frame"] = np.arange(len(order), dtype=np.int32)
    return table


def _check_one_size(sequence, camera, table):
    width, height = table["width"], table["height"]
    other = (width != width[0]) | (height != height[0])
    if other.any():
        i = int(np.argmax(other))
        raise DiorError(
            f"{sequence}, {camera}: frame {i} ({table['bag'][i]}) is {width[i]}x{height[i]} where frame 0 "
            f"({table['bag'][0]}) is {width[0]}x{height[0]}; a camera must keep one resolution in a recording"
        )
