"""Figures that benchmarks report: read from their output, put in a table, compared with those of another run."""
import dataclasses
import json
import re


@dataclasses.dataclass
class Figure:
    """What one benchmark says of one piece of work."""

    benchmark: str
    work: str
    value: float
    unit: str                 # of value; less is better unless it ends with "/s"
    ratio: float | None = None    # of value to that of `against`
    against: str = ""         # floor or peer, in the same run
    accuracy: str = ""        # beside the time

    @property
    def key(self):
        return f"{self.benchmark}: {self.work}"

    def worse_than(self, before):
        """How many times worse this is: by the ratio where both have one, since it does not depend on the machine."""
        now, then = (self.ratio, before.ratio) if self.ratio and before.ratio else (self.value, before.value)
        if not now or not then:
            return 1.0
        return then / now if self.unit.endswith("/s") else now / then


def number(text):
    return float(text.replace(" ", ""))


def google_figures(benchmark, text, floors, accuracy=()):
    """Of Google Benchmark's JSON: the least processor time of all repetitions, of real time where that alone is
    measured. `floors`: work by regular expression to that which it is compared with, as a replacement."""
    least, said = {}, {}
    for row in json.loads(text)["benchmarks"]:
        if row.get("run_type") == "aggregate":
            continue
        if "error_message" in row:
            raise ValueError(f"{row['name']}: {row['error_message']}")
        work = re.sub(r"/(process_time|real_time)|/repeats:\d+", "", row["name"])
        spent = row["cpu_time"] if "process_time" in row["name"] else row["real_time"]
        least[work] = min(spent, least.get(work, spent))
        said[work] = ", ".join(f"{name} {row[name]:.3g}" for name in accuracy if name in row)
    figures = []
    for work, spent in least.items():
        floor = next((re.sub(f"^{of}$", to, work) for of, to in floors.items() if re.fullmatch(of, work)), "")
        ratio = spent / least[floor] if floor in least else None
        figures.append(Figure(benchmark, work, spent, "ms", ratio, floor if ratio else "", said[work]))
    return figures


def odometry_figures(benchmark, text):
    """Of odometry_benchmark's table: the median of the runs of each sequence."""
    rows = {}
    for line in text.splitlines()[1:]:
        match = re.match(r"(\S+) +(\d+)/(\d+) +\d+ +-?\d+ +([\d.]+) +([\d.]+) \| +([\d.]+)", line)
        if match:
            rows.setdefault(match[1], []).append(match)
    figures = []
    for sequence, runs in rows.items():
        spent = sorted(float(run[6]) for run in runs)
        tracked, frames, ate, share = runs[0].group(2, 3, 4, 5)
        figures.append(Figure(benchmark, sequence, spent[len(spent) // 2], "CPU ms a picture",
                              accuracy=f"{tracked}/{frames} tracked, ATE {ate} m, {share} % of the path"))
    return figures


def evaluate_figures(benchmark, text):
    """Of evaluate_benchmark's lines; the ratio is of the time of a point to that of the smallest map's."""
    figures, place, first = [], "", None
    for line in text.splitlines():
        match = re.match(r" *(\d+) points: +([\d.]+) s, +([\d.]+) s of processors, +(\d+) MB \| (mean \S+ median \S+)", line)
        if not match:
            place, first = line.split(",")[0], None
            continue
        points, spent = int(match[1]), float(match[3])
        first = first or (points, spent)
        ratio = spent / points / (first[1] / first[0])
        figures.append(Figure(benchmark, f"{place}, {points} points", spent, "CPU s", ratio, f"a point's share, {first[0]} points",
                              f"{match[5]}, {match[4]} MB"))
    return figures


def tiles_figures(benchmark, text):
    """Of tiles_benchmark's lines; the ratio is of reading, without the server's own time, to decoding."""
    figures, tileset = [], ""
    for line in text.splitlines():
        match = re.match(r"  (\S.*?)  +([\d.]+) s +[\d.]+ CPU s .*?([\d.]+) x decoding \( *([\d.]+) without the server\) +([\d.]+) MB", line)
        if match:
            figures.append(Figure(benchmark, f"{tileset}: {match[1]}", float(match[2]), "s", float(match[4]), "decoding, from memory",
                                  f"{match[5]} MB"))
        elif line and not line.startswith(" "):
            tileset = line.split(":")[0]
    return figures


def weather_figures(benchmark, text):
    return [Figure(benchmark, m[1].strip(), float(m[2]), "CPU ms", float(m[3]), "plain")
            for m in re.finditer(r"^(\S.*?) +([\d.]+) ms +([\d.]+) x$", text, re.M)]


def server_figures(benchmark, text):
    figures = []
    for m in re.finditer(r"^\| (\d+ x \d+ \S+) \| ([\d.]+) \| ([\d.]+) \| ([\d.]+) \|$", text, re.M):
        figures.append(Figure(benchmark, f"{m[1]}, 1 client", float(m[2]), "images/s"))
        figures.append(Figure(benchmark, f"{m[1]}, 4 clients", float(m[3]), "images/s", float(m[3]) / float(m[2]), "1 client"))
        figures.append(Figure(benchmark, f"{m[1]}, a call", float(m[4]), "CPU ms"))
    return figures


def python_figures(benchmark, text):
    return [Figure(benchmark, m[1], float(m[3]), "CPU ms", float(m[4]), "C++")
            for m in re.finditer(r"^\| (\d+ x \d+) \| ([\d.]+) \| ([\d.]+) \| ([\d.]+) \|$", text, re.M)]


def to_json(machine, figures):
    return json.dumps({"machine": machine, "figures": [dataclasses.asdict(f) for f in figures]}, indent=1) + "\n"


def from_json(text):
    document = json.loads(text)
    return document["machine"], [Figure(**f) for f in document["figures"]]


def to_markdown(machine, figures, before=(), tolerance=1.1):
    """A table a benchmark; figures that are more than `tolerance` times worse than before are named first."""
    known = {figure.key: figure for figure in before}
    lines = ["# Benchmarks", "", *(f"- {name}: {value}" for name, value in machine.items()), ""]
    worse = [(f.worse_than(known[f.key]), f) for f in figures if f.key in known]
    if before:
        slower = sorted(((times, f) for times, f in worse if times > tolerance), key=lambda pair: -pair[0])
        lines += [f"{len(slower)} of {len(worse)} figures are more than {tolerance:g} times worse than before"
                  + (":" if slower else "."), ""]
        lines += [f"- {f.key}: {times:.2f} times" for times, f in slower] + ([""] if slower else [])
        missing = sorted(set(known) - {f.key for f in figures})
        if missing:
            lines += ["Not measured, but before: " + "; ".join(missing) + ".", ""]
    for benchmark in dict.fromkeys(f.benchmark for f in figures):
        lines += [f"## {benchmark}", "", "| work | | ratio | accuracy |" + (" before |" if before else ""),
                  "| --- | ---: | --- | --- |" + (" ---: |" if before else "")]
        for f in figures:
            if f.benchmark != benchmark:
                continue
            ratio = f"{f.ratio:.2f} x {f.against}" if f.ratio is not None else ""
            row = f"| {f.work} | {f.value:.4g} {f.unit} | {ratio} | {f.accuracy} |"
            if before:
                row += f" {f.worse_than(known[f.key]):.2f} times |" if f.key in known else " new |"
            lines.append(row)
        lines.append("")
    return "\n".join(lines)
