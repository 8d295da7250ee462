"""docs/science.md names every number of a metrics.json.

    check_science.py SCIENCE.md METRICS.json
"""

import json
import pathlib
import re
import sys

#: Parts of numbers that the page explains as a whole.
WITHIN = {"histogram", "percentiles", "quantization_floor", "rpe", "rpe_frames", "area", "accuracy", "completeness", "f_score", "cumulative", "warnings"}
#: Members of each part of the budget, which its table has as columns.
COLUMNS = {"metres", "kind", "how"}


def keys(value):
    for key, inner in value.items():
        yield key
        if isinstance(inner, dict) and key not in WITHIN:
            yield from keys(inner)


def main(page, metrics):
    if not pathlib.Path(metrics).exists():
        print("skipped: the example map_error was skipped, so there is no metrics.json")
        return 77
    named = set(re.findall(r"`([^`\n]+)`", pathlib.Path(page).read_text(encoding="utf-8")))
    named |= {part for name in named for part in name.split(".")}
    missing = sorted(set(keys(json.loads(pathlib.Path(metrics).read_text()))) - named - COLUMNS)
    if missing:
        print(f"check_science: {page} does not explain {', '.join(missing)}", file=sys.stderr)
    return 1 if missing else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
