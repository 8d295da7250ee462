#!/usr/bin/env python3
"""run_all.py: real benchmarks give figures, and figures that became worse are named.

    run_all_test.py BUILD-FOLDER
"""
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

import figures
from figures import Figure

HERE = pathlib.Path(__file__).resolve().parent
BUILD = None


def run_all(out, *more):
    words = [sys.executable, HERE / "run_all.py", "--quick", "--build", BUILD, "--out", out, *more]
    return subprocess.run([str(word) for word in words], capture_output=True, text=True, check=False)


class RunAll(unittest.TestCase):
    def test_benchmarks_give_figures_with_their_floors(self):
        with tempfile.TemporaryDirectory() as folder:
            out = pathlib.Path(folder) / "new/table"
            done = run_all(out, "--only", "viewer", "odometry")
            self.assertEqual(done.returncode, 0, done.stderr)
            machine, found = figures.from_json((out / "benchmarks.json").read_text())
            self.assertIn("commit", machine["program"])
            delivery = [f for f in found if f.work.startswith("BM_Delivery")]
            self.assertEqual(len(delivery), 3)
            for figure in delivery:
                self.assertEqual(figure.against, figure.work.replace("Delivery", "Copy"))
                self.assertGreater(figure.ratio, 0)
            odometry = [f for f in found if f.benchmark == "odometry"]
            self.assertTrue(odometry)
            for figure in odometry:
                self.assertRegex(figure.accuracy, r"\d+/\d+ tracked, ATE [\d.]+ m")
            self.assertIn("## viewer", (out / "benchmarks.md").read_text())
            self.assertEqual((out / "benchmarks.md").read_text() + "\n", done.stdout)

            before = json.loads((out / "benchmarks.json").read_text())
            for figure in before["figures"]:
                if figure["benchmark"] == "viewer" and figure["ratio"]:
                    figure["ratio"] /= 1000
            faster = pathlib.Path(folder) / "faster.json"
            faster.write_text(json.dumps(before))
            again = run_all(pathlib.Path(folder) / "again", "--only", "viewer", "--against", faster)
            self.assertEqual(again.returncode, 0, again.stderr)
            self.assertIn("- viewer: BM_Delivery/80000: ", again.stdout)
            self.assertIn("Not measured, but before: odometry: ", again.stdout)

    def test_a_benchmark_that_fails_is_named(self):
        with tempfile.TemporaryDirectory() as folder:
            done = run_all(folder, "--only", "python", "--build", pathlib.Path(folder))
            self.assertNotEqual(done.returncode, 0)

    def test_a_benchmark_that_fails_leaves_the_others_figures(self):
        with tempfile.TemporaryDirectory() as folder:
            build = pathlib.Path(folder) / "build"
            (build / "bin").mkdir(parents=True)
            for program in ("tileflight", "viewer_benchmark"):
                (build / "bin" / program).symlink_to(pathlib.Path(BUILD).resolve() / "bin" / program)
            done = run_all(folder, "--only", "odometry", "viewer", "--build", build)
            self.assertEqual(done.returncode, 1)
            self.assertIn("run_all: odometry: ", done.stderr)
            _, found = figures.from_json((pathlib.Path(folder) / "benchmarks.json").read_text())
            self.assertEqual({figure.benchmark for figure in found}, {"viewer"})


class Parsers(unittest.TestCase):
    def test_google_takes_the_least_of_all_repetitions(self):
        rows = [{"name": f"{name}/process_time/real_time", "run_type": "iteration", "cpu_time": cpu, "real_time": 1, "error_m": 0.03}
                for name, cpu in [("Floor", 4), ("Beams", 3), ("Beams", 2), ("Floor", 5)]]
        rows.append({"name": "Floor_median", "run_type": "aggregate", "cpu_time": 1})
        floor, beams = figures.google_figures("render", json.dumps({"benchmarks": rows}), {"Beams": "Floor"}, ["error_m"])
        self.assertEqual((floor.value, floor.ratio), (4, None))
        self.assertEqual((beams.value, beams.ratio, beams.against, beams.accuracy), (2, 0.5, "Floor", "error_m 0.03"))

    def test_evaluate_compares_the_time_of_a_point(self):
        text = ("the stadium, 250 m x 250 m\n"
                "   100000 points:    1.1 s,    2.0 s of processors,    210 MB | mean 0.31 median 0.02 entropy 1 (1 asked) |cos| 1 (1 asked)\n"
                "  1000000 points:    5.0 s,   10.0 s of processors,    320 MB | mean 0.32 median 0.03 entropy 1 (1 asked) |cos| 1 (1 asked)\n")
        first, second = figures.evaluate_figures("evaluate", text)
        self.assertEqual((first.ratio, second.ratio), (1.0, 0.5))
        self.assertEqual(second.accuracy, "mean 0.32 median 0.03, 320 MB")

    def test_tiles(self):
        text = ("place, geometry: 10 triangles, 2 tiles, 1.0 MB\n"
                "  decoding alone, from memory   1.000 s   1.900 CPU s  server 0.000 CPU s   1.00 x decoding (1.00 without the server)    10.0 MB\n"
                "  server, 20 ms, no cache       2.000 s   1.900 CPU s  server 0.100 CPU s   1.45 x decoding (1.31 without the server)    12.0 MB  scene 0.500 s\n")
        decoding, server = figures.tiles_figures("tiles", text)
        self.assertEqual((decoding.value, decoding.ratio), (1.0, 1.0))
        self.assertEqual((server.work, server.value, server.ratio, server.accuracy),
                         ("place, geometry: server, 20 ms, no cache", 2.0, 1.31, "12.0 MB"))

    def test_what_is_counted_a_second_is_worse_when_less(self):
        rates = figures.server_figures("server", "| 640 x 480 RGB | 40.0 | 50.0 | 26.5 |\n")
        self.assertEqual([(f.work, f.value, f.unit) for f in rates],
                         [("640 x 480 RGB, 1 client", 40.0, "images/s"), ("640 x 480 RGB, 4 clients", 50.0, "images/s"),
                          ("640 x 480 RGB, a call", 26.5, "CPU ms")])
        before = Figure("server", "640 x 480", 40.0, "images/s")
        self.assertEqual(Figure("server", "640 x 480", 20.0, "images/s").worse_than(before), 2.0)
        self.assertEqual(Figure("server", "640 x 480", 80.0, "images/s").worse_than(before), 0.5)

    def test_ratios_count_more_than_times(self):
        before = Figure("render", "Beams", 100.0, "ms", 0.5, "Floor")
        self.assertEqual(Figure("render", "Beams", 300.0, "ms", 0.5, "Floor").worse_than(before), 1.0)

    def test_the_table_names_what_became_worse_first(self):
        before = [Figure("a", "x", 1.0, "ms"), Figure("a", "y", 1.0, "ms")]
        table = figures.to_markdown({}, [Figure("a", "x", 1.05, "ms"), Figure("a", "y", 3.0, "ms")], before)
        self.assertIn("1 of 2 figures are more than 1.1 times worse than before:\n\n- a: y: 3.00 times\n", table)


if __name__ == "__main__":
    BUILD = pathlib.Path(sys.argv.pop(1))
    unittest.main()
