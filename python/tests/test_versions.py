import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

import tileflight


class TestVersions(unittest.TestCase):
    def test_another_python_is_told_which_ones_are_served(self):
        with tempfile.TemporaryDirectory() as folder:
            package = pathlib.Path(folder) / "tileflight"
            package.mkdir()
            for file in pathlib.Path(tileflight.__file__).parent.glob("*.py"):
                shutil.copy(file, package)
            for module in ("_core.cpython-35-x86_64-linux-gnu.so", "_core.cpython-399-x86_64-linux-gnu.so"):
                (package / module).touch()
            done = subprocess.run([sys.executable, "-B", "-c", "import tileflight"], cwd=folder, env={}, capture_output=True, text=True)
        self.assertEqual(done.returncode, 1)
        self.assertIn("ImportError: tileflight: this package is for Python 3.5 and 3.99; this is Python "
                      f"{sys.version_info.major}.{sys.version_info.minor}", done.stderr.splitlines()[-1])


if __name__ == "__main__":
    unittest.main()
