import inspect
import pathlib
import signal
import subprocess
import sys
import unittest

import place

import tileflight as tf


class CommandsTest(unittest.TestCase):
    def test_the_whole_chain_gives_the_keys_of_its_files(self):
        folder = place.work_folder() / "chain"
        folder.mkdir()
        tf.extract(place.tileset(), out=folder / "truth", voxel=0.5)
        tf.render(place.tileset(), flight=place.flight_file(), out=folder / "dataset")
        tf.odometry(folder / "dataset", out=folder / "odometry")
        transform = tf.align(
            folder / "odometry", to=folder / "truth", dataset=folder / "dataset", start="true-poses",
            out=folder / "transform.json",
        )
        self.assertGreater(transform["scale"], 0)
        metrics = tf.evaluate(
            folder / "odometry", truth=folder / "truth", transform=folder / "transform.json",
            dataset=folder / "dataset", out=folder / "metrics.json",
        )
        self.assertLess(metrics["surface"]["median"], 0.2)

    def test_lists_flags_and_paths_become_options(self):
        summary = tf.inspect(str(place.tileset() / "tileset.json"))
        self.assertFalse(summary["georeferenced"])
        out = place.work_folder() / "corner"
        part = tf.extract(
            place.tileset(), center_local=(-10, -10.0, 0), size=[20, 20, 20], out=pathlib.Path(out), allow_incomplete=True
        )
        whole = place.scene().triangles
        self.assertLess(part["triangles"], whole / 4)

    def test_signatures_and_help_are_the_programs(self):
        signature = inspect.signature(tf.extract)
        self.assertEqual(list(signature.parameters)[0], "source")
        self.assertIs(signature.parameters["out"].default, inspect.Parameter.empty)
        self.assertIn("voxel: edge of a voxel, metres", tf.extract.__doc__)
        with self.assertRaises(TypeError):
            tf.extract(place.tileset(), out="x", vxel=1.0)
        with self.assertRaises(TypeError):
            tf.extract(place.tileset())

    def test_errors_are_one_line(self):
        with self.assertRaisesRegex(tf.InputError, "nowhere"):
            tf.extract("/nowhere", out=place.work_folder() / "none")
        with self.assertRaisesRegex(ValueError, "--voxel"):
            tf.extract(place.tileset(), out=place.work_folder() / "none", voxel=-1)
        self.assertFalse((place.work_folder() / "none").exists())

    def test_progress_is_told_and_its_exceptions_end_the_work(self):
        class Enough(Exception):
            pass

        def stop(done, total, what):
            raise Enough

        out = place.work_folder() / "stopped"
        with self.assertRaises(Enough):
            tf.render(place.tileset(), flight=place.flight_file(), out=out, progress=stop)
        self.assertFalse(out.exists())
        told = []
        tf.render(place.tileset(), flight=place.flight_file(), out=out, progress=lambda *news: told.append(news))
        self.assertTrue(told)
        self.assertIsInstance(told[0][2], str)

    def test_an_interrupt_ends_a_command_and_leaves_nothing(self):
        out = place.work_folder() / "interrupted"
        script = (
            "import os, signal, sys, tileflight as tf\n"
            "def interrupt(done, total, what): os.kill(os.getpid(), signal.SIGINT)\n"
            f"tf.render({str(place.tileset())!r}, flight={str(place.flight_file())!r}, out={str(out)!r}, "
            "progress=interrupt)\n"
        )
        done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=120)
        self.assertEqual(done.returncode, -signal.SIGINT, done.stderr)
        self.assertIn("KeyboardInterrupt", done.stderr)
        self.assertFalse(out.exists())

    def test_every_command_but_the_servers_is_here(self):
        from tileflight import _core

        names = {command["name"] for command in _core._commands()} - {"serve", "play", "completion"}
        names = {name.replace("scene ", "make_") for name in names}
        self.assertIn("make_stadium", names)
        self.assertEqual(set(tf.commands.__all__), names)
        for name in names:
            self.assertTrue(callable(getattr(tf, name)), name)
            self.assertIn(name, tf.__all__)

    def test_a_command_with_parts_is_one_function(self):
        with self.assertRaisesRegex(tf.InputError, "exists"):
            tf.make_stadium(place.tileset())

    def test_the_module_is_the_program(self):
        done = subprocess.run(
            [sys.executable, "-m", "tileflight", "--version"], capture_output=True, text=True, timeout=120
        )
        self.assertEqual(done.stdout.splitlines()[0], "tileflight " + tf.__version__)


if __name__ == "__main__":
    unittest.main()
