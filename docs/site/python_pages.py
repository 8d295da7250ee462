"""The Python reference, from the package's type stubs: signatures and docstrings of the module as it was built."""

import ast
import inspect
import re

import rst

#: Pages and what they list, in order; what none of them names goes to the last of the module's own pages.
PAGES = [
    ("places", "Places and ground truth", ["load", "Scene", "VoxelGrid", "read_binvox"]),
    ("images", "Cameras, flights, images", ["Camera", "Flight", "render_flight", "FlightFrames", "Renderer", "Frame"]),
    ("sensors", "Other sensors", ["Path", "Lidar", "simulate_imu"]),
    ("odometry", "Odometry and scores", ["Odometry", "TrackedFrame", "umeyama", "icp", "evaluate_trajectory"]),
    ("simulator", "A simulated drone", ["Simulator"]),
    ("general", "General", ["InputError", "set_threads", "__version__", "commit"]),
]


def docstring(node):
    text = ast.get_docstring(node)
    if not text:
        return ""
    paragraphs = inspect.cleandoc(text).split("\n\n")
    return "\n\n".join(paragraphs)


def described(text):
    """A docstring: paragraphs and lists of text in which only `code` is markup."""
    out = []
    for paragraph in text.split("\n\n"):
        lines = paragraph.splitlines()
        if lines and all(line.startswith("    ") for line in lines):
            out.append(rst.code(inspect.cleandoc(paragraph), "python").rstrip())
        elif lines and lines[0].startswith("- ") and all(line.startswith(("- ", "  ")) for line in lines):
            items = []
            for line in lines:
                if line.startswith("- "):
                    items.append(line[2:])
                else:
                    items[-1] += " " + line.strip()
            out.append("\n".join("- " + rst.escape(item) for item in items))
        else:
            out.append(rst.escape(" ".join(lines)))
    return "\n\n".join(out)


def is_open(node):
    """def f(*args: Any, **kwargs: Any): made for what has no constructor of its own."""
    return [a.arg for a in node.args.args] == [] and node.args.vararg is not None and node.args.kwarg is not None


def signature(node, is_method):
    arguments = node.args
    if is_method and arguments.args and not any(getattr(d, "id", "") == "staticmethod" for d in node.decorator_list):
        arguments.args.pop(0)
    returned = f" -> {ast.unparse(node.returns)}" if node.returns is not None and node.name != "__init__" else ""
    return f"({ast.unparse(arguments)}){returned}"


def function(node, kind="function"):
    decorators = {getattr(d, "id", "") for d in node.decorator_list}
    if "property" in decorators:
        return f".. py:property:: {node.name}\n   :type: {ast.unparse(node.returns)}\n\n{rst.indented(described(docstring(node)))}\n\n"
    options = "   :staticmethod:\n" if "staticmethod" in decorators else ""
    return f".. py:{kind}:: {node.name}{signature(node, kind == 'method')}\n{options}\n{rst.indented(described(docstring(node)))}\n\n"


def class_(node):
    members = [m for m in node.body if isinstance(m, ast.FunctionDef)]
    init = next((m for m in members if m.name == "__init__" and not is_open(m)), None)
    text = described(docstring(node))
    arguments = ""
    if init:
        arguments = signature(init, True)
        text += "\n\n" + described(docstring(init))
    out = [f".. py:class:: {node.name}{arguments}\n\n{rst.indented(text)}\n\n"]
    shown = [m for m in members if not m.name.startswith("_")]
    shown.sort(key=lambda m: (any(getattr(d, "id", "") == "property" for d in m.decorator_list), m.name))
    out += [rst.indented(function(m, "method")) + "\n\n" for m in shown]
    return "".join(out)


def entry(name, nodes):
    node = nodes[name]
    if isinstance(node, ast.ClassDef):
        return class_(node)
    if isinstance(node, ast.FunctionDef):
        return function(node)
    return f".. py:data:: {name}\n   :type: {ast.unparse(node.annotation)}\n\n"


def named(file):
    tree = ast.parse(file.read_text(encoding="utf-8"))
    nodes = {n.name: n for n in tree.body if isinstance(n, (ast.ClassDef, ast.FunctionDef))}
    nodes.update({n.target.id: n for n in tree.body if isinstance(n, ast.AnnAssign) and isinstance(n.target, ast.Name)})
    return tree, nodes


def write(stage, package):
    core_tree, core = named(package / "_core.pyi")
    pages = [(file, title, [n for n in names if n in core]) for file, title, names in PAGES]
    listed = {n for _, _, names in pages for n in names}
    pages[-1][2].extend(n for n in core if n not in listed and (not n.startswith("_")))
    head = ".. py:currentmodule:: tileflight\n\n"
    for file, title, names in pages:
        stage.write(f"reference/python/{file}.rst", rst.heading(title) + head + "".join(entry(n, core) for n in names))

    tree, commands = named(package / "commands.pyi")
    text = rst.heading("Commands as functions") + head + described(docstring(ast.parse((package / "commands.py").read_text(encoding="utf-8")))) + "\n\n"
    for name, node in commands.items():
        if isinstance(node, ast.FunctionDef) and not name.startswith("_"):
            page = re.sub("^make_", "scene-", name)
            text += f".. py:function:: {name}{signature(node, False)}\n\n   :doc:`tileflight {page.replace('-', ' ')} <../commands/{page}>`: options and examples.\n\n"
    stage.write("reference/python/commands.rst", text)

    tree, classes = named(package / "navigation.py")
    text = rst.heading("Navigation: reinforcement learning") + ".. py:module:: tileflight.navigation\n\n" + described(docstring(tree)) + "\n\n"
    text += "".join(class_(n) for n in classes.values() if isinstance(n, ast.ClassDef) and not n.name.startswith("_"))
    stage.write("reference/python/navigation.rst", text)

    tree = ast.parse((package / "__init__.py").read_text(encoding="utf-8"))
    names = [file for file, _, _ in pages] + ["commands", "navigation"]
    text = rst.heading("Python reference") + ".. py:module:: tileflight\n\n" + described(docstring(tree)) + (
        "\n\nGenerated from the module's docstrings when the site is built. How to install it, and what holds: :doc:`../../python`.\n\n"
    ) + "".join(f"- :doc:`{name}`\n" for name in names) + "\n" + rst.toctree(names)
    stage.write("reference/python/index.rst", text)
