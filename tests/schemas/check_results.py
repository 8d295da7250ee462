"""Results against schemas/.

    check_results.py SOURCE_DIR READ_FILE WORK_DIR FOLDER...

Every metrics.json, transform.json, extract.json and results.json below the folders, of which there must be some, is as
its schema says and has no key that the schema does not know. A metrics.json without a key that the schema requires is
refused by the program, too.
"""

import copy
import json
import pathlib
import sys

from check_schemas import Reader, jsonschema, load

KINDS = ("metrics", "transform", "extract", "results")


def undescribed(schema, value, path="$"):
    """Keys of a result that the schema does not know; results are open for later versions, not for forgotten keys."""
    found = []

    def follow(part):
        while "$ref" in part:
            target = schema
            for step in part["$ref"].removeprefix("#/").split("/"):
                target = target[step]
            part = {**target, **{k: v for k, v in part.items() if k != "$ref"}}
        return part

    def walk(part, value, at):
        part = follow(part)
        if isinstance(value, dict) and "properties" in part:
            for key, inner in value.items():
                if key in part["properties"]:
                    walk(part["properties"][key], inner, f"{at}.{key}")
                elif isinstance(part.get("additionalProperties"), dict):
                    walk(part["additionalProperties"], inner, f"{at}.{key}")
                else:
                    found.append(f"{at}.{key}")
        if isinstance(value, list) and isinstance(part.get("items"), dict):
            for index, inner in enumerate(value):
                walk(part["items"], inner, f"{at}[{index}]")

    walk(schema, value, path)
    return found


def result_faults(name, schema, file):
    value = json.loads(file.read_text(encoding="utf-8"))
    validator = jsonschema.Draft202012Validator(schema)
    faults = [f"{file}: {error.json_path}: {error.message[:200]}" for error in validator.iter_errors(value)]
    if name != "results":  # which holds whole other files
        faults += [f"{file}: the schema of {name} does not describe {key}" for key in undescribed(schema, value)]
    return faults


def required_faults(schema, value, reader):
    """Of metrics.json: each key that the schema requires is one that the program misses, at the top and in its sections."""
    faults = []
    for path, part in [((), schema)] + [((key,), schema["properties"][key]) for key in ("map", "surface", "trajectory")]:
        for key in part.get("required", []):
            document = copy.deepcopy(value)
            section = document[path[0]] if path else document
            if not section or key not in section or (path, key) == ((), "warnings"):  # absent in older files, which are read
                continue
            del section[key]
            if reader.answer("metrics", document) == "ok":
                faults.append(f"metrics:{'.'.join(path)}.{key}: required by the schema, not by the program")
    return faults


def main(source, program, work, *folders):
    schemas = load(pathlib.Path(source))
    reader = Reader(program, pathlib.Path(work))
    faults = []
    for kind in KINDS:
        files = [file for folder in folders for file in sorted(pathlib.Path(folder).rglob(kind + ".json"))]
        for file in files:
            faults += result_faults(kind, schemas[kind], file)
            value = json.loads(file.read_text(encoding="utf-8"))
            if kind == "metrics" and "map" in value:
                faults += required_faults(schemas[kind], value, reader)
        if not files:
            faults.append(f"there is no {kind}.json to check")
        print(f"{kind}: {len(files)} files")
    for fault in faults:
        print(fault)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
