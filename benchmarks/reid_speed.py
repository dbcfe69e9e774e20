"""How long the networks take for a gallery of 14 subjects, 8 cameras, 2 outfits and 2 walks: 448 sequences.

usage: OMP_NUM_THREADS=2 python -m benchmarks.reid_speed [SEQUENCES]      (random weights and people; 300 frames each)

Printed: seconds by the clock, and of the processor, which others on the machine do not change.
"""

import sys
import time

import numpy as np

from dior.reid import embed, inputs, networks


def main():
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 448
    random = np.random.default_rng(1)
    sequences = [random.uniform(60, 260, (inputs.LENGTH, 17, 2)) for _ in range(count)]
    threads = networks.torch().get_num_threads()
    for name in networks.NAMES:
        network = networks.build(name)
        began, processor = time.monotonic(), time.process_time()
        found = embed.embeddings(name, network, sequences)
        print(
            f"{name}: {len(found)} sequences of {inputs.LENGTH} frames in {time.monotonic() - began:.1f} s, "
            f"{time.process_time() - processor:.1f} s of the processor, {threads} threads",
            flush=True,
        )


if __name__ == "__main__":
    main()
