"""Are covers told from what is below them? Finished releases, as they are and with the covers taken away.

usage: python -m benchmarks.covers PROJECT...      (folders of projects with a release and their recordings)

By recording, of every third released picture with a cover: `covers`; `sound`: of what a cover shows, the most times as
much as encoding it leaves over (`cover_checks.TIMES` and `MORE` are allowed), and `alarms`: pictures that are told of.
`bare`: pictures that are told of where the recorded picture is put in their place, encoded as they are; those in which
nothing but an even background is below the covers are not.
"""

import json
import sys
from pathlib import Path

import cv2
import numpy as np
import pyarrow.parquet as pq
import yaml

from dior.ingest import bags
from dior.release import jpeg
from dior.release.verify import cover_checks
from dior.tables import tables

EVERY = 3


def ratios(data, covers, how):
    """What each cover of a picture shows beside its cells, over what encoding these leaves."""
    found, table = [], cover_checks.luma_table(data)
    for cover in cover_checks._covers(cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR), covers, how):
        left, means = cover.fitted(cover.part)
        # less than a twentieth of a grey level is nothing
        found.append(left / max(cover.fitted(cover_checks.coded(cover.drawn(means), table))[0], 0.05))
    return found


def of_recording(project, release, path, how):
    """The ratios of all covers, and the counts of pictures, of alarms and of those told of where they are bare."""
    sequence, camera = path.name.split(".")[:2]
    table = pq.read_table(path, columns=["frame", "image"])
    kept = {f: image["bytes"] for f, image in zip(*(c.to_pylist() for c in table.columns), strict=True) if image}
    kept = dict(list(kept.items())[::EVERY])
    covers = tables.read(release / "covers" / path.parent.name / path.name, "released_covers")
    by_frame = {frame: tables.rows(covers, covers["frame"] == frame) for frame in kept}
    index = tables.of_camera(tables.read(project / f"results/frames/{sequence}.parquet", "frames"), camera)
    index = tables.rows(index, np.isin(index["frame"], [frame for frame, own in by_frame.items() if len(own["frame"])]))
    data_root = project / yaml.safe_load((project / "config/config.yaml").read_text())["data_root"]
    found, counts = [], np.zeros(3, int)
    for row, picture in bags.read_pictures(index, data_root):
        frame = int(index["frame"][row])
        data, mine = kept[frame], by_frame[frame]
        found += ratios(data, mine, how)
        recorded = jpeg.encoded(picture, *jpeg.settings(data))
        counts += (1, cover_checks.shows(data, mine, how), cover_checks.shows(recorded, mine, how))
    return found, counts


def main():
    print(f"{'recording':<28}{'pictures':>9}{'covers':>8}{'sound':>8}{'alarms':>8}{'bare':>7}")
    for project in map(Path, sys.argv[1:]):
        for about in sorted(project.glob("results/release/*/provenance.json")):
            how = json.loads(about.read_text())["config"]["release.faces"]
            for path in sorted(about.parent.glob("frames/*/*.parquet")) if how != "shown" else ():
                found, (pictures, alarms, bare) = of_recording(project, about.parent, path, how)
                if pictures:
                    name = path.name.removesuffix(".parquet")
                    print(f"{name:<28}{pictures:>9}{len(found):>8}{max(found):>8.2f}{alarms:>8}{bare / pictures:>7.0%}")


if __name__ == "__main__":
    main()
