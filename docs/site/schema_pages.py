"""A page for each kind of file that people write, from its JSON Schema in schemas/."""

import json

import rst


def resolved(schema, root):
    """A schema with `$ref` and a single-member `allOf` followed; what stands beside the reference counts before it."""
    seen = set()
    while "$ref" in schema and schema["$ref"] not in seen:
        seen.add(schema["$ref"])
        target = root
        for step in schema["$ref"].removeprefix("#").strip("/").split("/"):
            target = target.get(step.replace("~1", "/").replace("~0", "~"), {}) if step else target
        schema = {**target, **{key: value for key, value in schema.items() if key != "$ref"}}
        if "$ref" in target:
            schema["$ref"] = target["$ref"]
    if len(schema.get("allOf", [])) == 1:
        schema = {**resolved(schema["allOf"][0], root), **{key: value for key, value in schema.items() if key != "allOf"}}
    return schema


def shown(value):
    return "`" + json.dumps(value, ensure_ascii=False).strip('"') + "`"


def type_in_words(schema, root):
    schema = resolved(schema, root)
    if "const" in schema:
        return shown(schema["const"])
    if "enum" in schema:
        return " or ".join(shown(value) for value in schema["enum"])
    choices = schema.get("oneOf") or schema.get("anyOf")
    if choices and "type" not in schema:
        words = []
        for choice in choices:
            word = type_in_words(choice, root)
            if word and word not in words:
                words.append(word)
        return ", or ".join(words)
    kinds = schema.get("type", "")
    if isinstance(kinds, list) and "object" in kinds:
        kinds = "object"  # a section without keys may be left empty
    words = []
    for kind in kinds if isinstance(kinds, list) else [kinds]:
        word = {"integer": "whole number", "number": "number", "string": "text", "boolean": "true or false", "object": "mapping", "null": "null"}.get(kind, kind)
        if kind == "array":
            item = schema.get("items", {})
            inner = type_in_words(item, root) if isinstance(item, dict) and item else ""
            inner = inner or (type_in_words(schema["prefixItems"][0], root) if schema.get("prefixItems") else "")
            least, most = schema.get("minItems"), schema.get("maxItems")
            count = f"{least} " if least and least == most else f"{least} to {most} " if least and most else f"{least} and more " if least else ""
            word = f"list of {count.strip()}× {inner}" if count and inner else f"list of {inner}" if inner else "list"
        words.append(word)
    limits = [(schema.get("exclusiveMinimum"), "> "), (schema.get("minimum"), "≥ "), (schema.get("exclusiveMaximum"), "< "), (schema.get("maximum"), "≤ ")]
    limits = ", ".join(f"{sign}{limit}" for limit, sign in limits if limit is not None and limit is not True and limit is not False)
    return " or ".join(w for w in words if w) + (f", {limits}" if limits else "")


def rows_of(schema, root, path="", required=False, above=()):
    """(path, type, unit, default, meaning) of a schema and of all that is in it."""
    reference = schema.get("$ref")
    if reference in above:
        return  # a kind that holds itself is listed once
    above = above + ((reference,) if reference else ())
    schema = resolved(schema, root)
    if path:
        meaning = schema.get("description", schema.get("title", ""))
        unit = schema.get("x-unit", schema.get("unit", ""))
        default = shown(schema["default"]) if "default" in schema else "required" if required else ""
        yield path, type_in_words(schema, root), unit, default, meaning
    listed = set()
    for part in [schema, *schema.get("oneOf", []), *schema.get("anyOf", []), *schema.get("allOf", [])]:
        part = resolved(part, root)
        for key, value in part.get("properties", {}).items():
            if key not in listed and isinstance(value, dict):
                listed.add(key)
                yield from rows_of(value, root, f"{path}.{key}" if path else key, key in part.get("required", []), above)
        item = part.get("items")
        if isinstance(item, dict) and not listed:
            inner = list(rows_of(item, root, path + "[]", False, above))
            yield from inner[1:]
        extra = part.get("additionalProperties")
        if isinstance(extra, dict) and extra:
            yield from rows_of(extra, root, f"{path}.NAME" if path else "NAME", False, above)


def page(title, schema, file_name):
    rows = list(rows_of(schema, schema))
    has_unit = any(row[2] for row in rows)
    out = [rst.heading(title), rst.escape(schema.get("description", "")) + "\n\n",
           f"Generated from :download:`{file_name} <{file_name}>`, which editors can use to check and complete such a file. ``[]`` is each entry of a list.\n\n"]
    groups = {}  # a table for each section, under the path that leads to it
    for row in rows:
        groups.setdefault(row[0].rpartition(".")[0], []).append(row)
    for section, group in groups.items():
        out.append(rst.heading(f"``{section}``" if section else "Top level", "-"))
        out.append(".. list-table::\n   :header-rows: 1\n   :class: keys\n\n   * - key\n     - type\n" + ("     - unit\n" if has_unit else "") + "     - default\n     - meaning\n")
        for path, kind, unit, default, meaning in group:
            cells = [f"``{path.rpartition('.')[2]}``", rst.escape(kind), *([rst.escape(unit)] if has_unit else []), rst.escape(default), rst.escape(" ".join(meaning.split()))]
            out.append("   * - " + "\n     - ".join(cells) + "\n")
        out.append("\n")
    return "".join(out)


def write(stage, folder):
    files = sorted(folder.glob("*.schema.json")) if folder.is_dir() else []
    names, list_ = [], []
    for file in files:
        name = file.name.removesuffix(".schema.json")
        schema = json.loads(file.read_text(encoding="utf-8"))
        stage.write(f"reference/keys/{file.name}", file.read_text(encoding="utf-8"))
        stage.write(f"reference/keys/{name}.rst", page(schema.get("title", f"{name.capitalize()} files"), schema, file.name))
        names.append(name)
        list_.append(f"- :doc:`{name}`\n")
    text = rst.heading("Keys of files that people write")
    if files:
        text += "Generated from the JSON Schemas in ``schemas/`` when the site is built.\n\n" + "".join(list_) + "\n" + rst.toctree(names)
    text += ("How they are used: :doc:`../../your-own-place` (experiments), :doc:`../../formats` (flights, cameras), "
             ":doc:`../../simulated-camera` (``degrade``), :doc:`../../sensors`, :doc:`../../vehicles`, :doc:`../../systems` (studies).\n")
    stage.write("reference/keys/index.rst", text)
