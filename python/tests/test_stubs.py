import ast
import pathlib
import unittest

import tileflight as tf
from tileflight import _core


class StubsTest(unittest.TestCase):
    def parse(self, name):
        return ast.parse((pathlib.Path(tf.__file__).parent / name).read_text())

    def test_the_module_is_described_whole(self):
        tree = self.parse("_core.pyi")
        classes = {node.name: {m.name for m in node.body if isinstance(m, ast.FunctionDef)}
                   for node in tree.body if isinstance(node, ast.ClassDef)}
        functions = {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
        for name, member in vars(_core).items():
            if isinstance(member, type):
                public = {n for n in vars(member) if not n.startswith("_")}
                self.assertLessEqual(public, classes[name], name)
            elif callable(member):
                self.assertIn(name, functions)

    def test_signatures_keep_the_names_of_arguments(self):
        tree = self.parse("_core.pyi")
        load = next(n for n in tree.body if isinstance(n, ast.FunctionDef) and n.name == "load")
        self.assertEqual([a.arg for a in load.args.args], ["source"])
        self.assertIn("allow_incomplete", [a.arg for a in load.args.kwonlyargs])

    def test_everything_public_is_documented(self):
        for name in tf.__all__:
            if name not in ("__version__", "commit"):
                self.assertGreater(len(getattr(tf, name).__doc__ or ""), 20, name)

    def test_commands_have_their_options(self):
        tree = self.parse("commands.pyi")
        extract = next(n for n in tree.body if isinstance(n, ast.FunctionDef) and n.name == "extract")
        self.assertIn("voxel", [a.arg for a in extract.args.kwonlyargs])


if __name__ == "__main__":
    unittest.main()
