"""How fast recordings are read: bags of every format, detections of every tool.

usage: python -m benchmarks.ingest [DATA]      (DATA: ../shared/data/real_outdoor)
"""

import sys
from pathlib import Path

from benchmarks.ingest_bags import print_bags
from benchmarks.ingest_detections import print_detections

ROOT = Path(__file__).resolve().parents[1]


def main():
    data = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT.parent / "shared/data/real_outdoor"
    print_bags(data)
    print()
    print_detections(data)


if __name__ == "__main__":
    main()
