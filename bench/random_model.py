"""What comes of a language model that knows nothing: random weights behind a real local server.

Prints, for several random models, how many answers could not be used, how many led to a question or
to a proposal, how many proposals nobody could have meant, how much was carried out though nobody
confirmed anything (must be 0), and how often anything crashed (must be 0).
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import asdict
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))

from noise import listen, served, write_model


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--requests", type=int, default=500, help="requests to each model")
    parser.add_argument("--models", type=int, default=4, help="random models")
    args = parser.parse_args()
    for seed in range(args.models):
        with TemporaryDirectory() as folder:
            path = Path(folder) / "noise.gguf"
            write_model(path, seed)
            with served(path) as url:
                begin = perf_counter()
                tally = listen(url, args.requests)
                seconds = perf_counter() - begin
        counts = asdict(tally)
        proposals = counts.pop("proposals")
        shown = ", ".join(f"{key} {value}" for key, value in counts.items())
        print(f"model {seed}: {shown}; {seconds:.0f} s", flush=True)
        for proposal, times in sorted(proposals.items()):
            print(f"    {times} x {proposal}", flush=True)


if __name__ == "__main__":
    main()
