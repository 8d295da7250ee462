"""schemas/ against the program's own readers.

    check_schemas.py SOURCE_DIR READ_FILE WORK_DIR

- Each schema is one of JSON Schema 2020-12, and what several of them define is the same in all.
- Keys: what a reader lists as its keys, asked by an unknown one, is what the schema lists, in every section.
- Values: types, limits and words are refused or accepted by both; numbers far out tell of limits that only one has.
- Defaults are those that the readers give.
- Examples and adapters agree with the schema that their first line names.
"""

import copy
import json
import pathlib
import re
import subprocess
import sys

try:
    import jsonschema
    import yaml
    from PIL import Image
except ImportError as missing:
    print(f"check_schemas: skipped: {missing}")
    sys.exit(77)

UNKNOWN = "qqzzxx"
CAMERA = {"cam0": {"camera_model": "pinhole", "intrinsics": [100.0, 100.0, 63.5, 47.5], "distortion_model": "none", "distortion_coeffs": [], "resolution": [128, 96]}}
MISSION = [{"do": "takeoff"}, {"do": "land"}, {"do": "hover"}, {"do": "go_to", "position": [0, 0, 9]}, {"do": "path", "points": [0, 0, 9, 9, 0, 9]},
           {"do": "velocity", "velocity_m_s": [1, 0, 0]}, {"do": "turn", "heading_deg": 9}, {"do": "turn_rate", "yaw_rate_deg_s": 9}]
BOX = {"center": [0, 0, 0], "size": [1, 1, 1]}
DEGRADE = {"light": {}, "auto_exposure": {}, "exposure_steps": [{}], "white_electrons": 1000}
SENSORS = {"imu": {}, "gnss": {}, "attitude": {}, "barometer": {}, "magnetometer": {}, "range_finder": {}, "lidar": {"pattern": "raster"}}

# For each kind of file one or more documents that together hold every section.
BASES = {
    "experiment": [
        {"place": {"source": "stadium:twin"}, "truth": {}, "alignment": {"regions": [BOX], "held_out": [BOX]}, "evaluation": {}, "odometry": {},
         "simulated": {"render": {"flight": "waypoints.yaml", "degrade": DEGRADE}},
         "real": {"ingest": {"video": "video", "camera": "camera.yaml", "telemetry": "log.csv", "imu": "imu.csv"}},
         "variants": [{"name": "a", "place": {}, "odometry": {}, "degrade": DEGRADE}]},
        {"place": {"source": "stadium:twin"}, "simulated": {"ingest": {"video": "video", "camera": "camera.yaml", "telemetry": "log.csv", "imu": "imu.csv"}},
         "real": {"kind": "surrogate", "render": {"flight": "waypoints.yaml", "degrade": DEGRADE}}},
        {"place": {"source": "stadium:twin"}, "simulated": {"render": {"follow": "real"}}, "real": {"ingest": {"video": "video", "camera": "camera.yaml"}}},
    ],
    "degrade": [DEGRADE],
    "flight": [
        {"camera": "camera.yaml", "fps": 2, "vehicle": {}, "mission": MISSION, "sensors": SENSORS},
        {"camera": "camera.yaml", "fps": 2, "waypoints": [{"position": [0, 0, 9]}, {"position": [9, 0, 9]}]},
        {"camera": "camera.yaml", "fps": 2, "waypoints": [{"position": [0, 0, 9]}, {"position": [9, 0, 9]}],
         "actors": [{"path": [{"at": [0, 0]}, {"at": [9, 0]}]}, {"model": "person", "position": [1, 2]}], "weather": {}, "events": {}},
        {"camera": "camera.yaml", "fps": 2, "mission_file": {"file": "route.kml"}},
        {"camera": "camera.yaml", "trajectory": "path.txt"},
        {"camera": "camera.yaml", "fps": 2, "autopilot": {"kind": "px4", "vision": {}}},
        {"cameras": [{"name": "left", "camera": "camera.yaml"}, {"name": "right", "camera": "camera.yaml", "degrade": DEGRADE, "events": {}}], "trajectory": "path.txt"},
    ],
    "sensors": [SENSORS],
    "study": [{"places": {"a": "experiment.yaml", "b": {"experiment": "experiment.yaml"}}, "cameras": {"wide": "camera.yaml"}, "systems": {"dso": {"adapter": "system"}},
               "except": [{"place": "a"}], "alignment": {"regions": [BOX], "held_out": [BOX]}, "evaluation": {}},
              {"places": {"c": {"datasets": {"hall": "recorded"}}}, "systems": {"dso": {"adapter": "system"}}, "rank_by": "ate"}],
    "adapter": [{"name": "own", "takes": {"inputs": ["images"], "lenses": ["any"]}, "needs": {}, "leaves": {"trajectory": {}}}],
}
PATTERNS = {"spinning": ["columns", "elevations_deg", "channels", "elevation_range_deg", "channel_delay_s", "azimuth_range_deg"],
            "rosette": ["points_per_second", "fov_deg", "prism_rpm"], "raster": ["columns", "rows", "horizontal_fov_deg", "vertical_fov_deg"]}
for pattern, of_it in {"spinning": {"elevations_deg": [0]}, "rosette": {}}.items():
    BASES["sensors"].append({"lidar": {"pattern": pattern, **of_it}})
    BASES["flight"].append({**BASES["flight"][1], "sensors": {"lidar": {"pattern": pattern, **of_it}}})

# Keys whose value only has a meaning among others; (end of the path): why it is not probed.
NOT_PROBED = {
    "channels": "goes together with elevation_range_deg", "elevation_range_deg": "goes together with channels", "declination_deg": "goes with two others",
    "inclination_deg": "goes with two others", "strength_ut": "goes with two others", "find_regions": "excludes regions", "T_cam_lidar": "must be a rigid motion",
    "seed": "any whole number of 32 bits", "video_crf": "excludes video_bitrate", "smooth": "for a trajectory", "sensors_file": "names a file",
    "center": "goes together with size", "center_local": "goes together with size", "size": "goes together with center", "threshold": "one of evaluation.thresholds",
    "thresholds": "must hold threshold of a study", "backwards": "excludes command", "mode": "excludes command", "tight": "needs mode: inertial", "position": "of a waypoint", "version": "a command",
    "telemetry_offset": "needs telemetry", "pattern": "has a file of its own here", "kind": "of a rendered flight is never video", "max_frames": "checked by its own numbers below", "resolution": "of two keys",
    "azimuth_range_deg": "in order", "points": "multiples of three", "look_at": "excludes angles", "direction": "not zero", "wind_m_s": "limited in length",
    "camera_id": "names a camera of a file", "mission_file": "names a file", "takeoff": "a place on the earth", "T_body_camera": "must be a rigid motion",
}
# Numbers that the program limits by another key, or by the size of things, which a schema does not say.
LIMITED_BY_OTHERS = {"max_range_m", "min_gain", "max_gain", "max_keyframes", "columns", "rows", "points_per_second", "lidar.rate_hz"}
# Numbers of which only those near the limits are tried.
WITHOUT_FAR_NUMBERS = {"min_range_m", "min_keyframes", "rate_hz", "to", "from", "heading_deg", "yaw_rate_deg_s", "yaw_deg", "pitch_deg", "fov_deg", "white_electrons", "lookahead_m",
                     "height_m", "speed_m_s", "friction", "restitution", "channel_delay_s", "fps", "duration_s", "takeoff_height"}
FREE_TEXT = {"start", "outputs", "time"}


def documents(schema, document, path=()):
    """(path, schema) of each section of a document, by the schema."""
    def follow(part):
        while "$ref" in part:
            part = {**resolve(part["$ref"]), **{k: v for k, v in part.items() if k != "$ref"}}
        return part

    def resolve(reference):
        target = root
        for step in reference.removeprefix("#/").split("/"):
            target = target[step]
        return target

    root = schema

    def walk(part, value, at):
        part = follow(part)
        if isinstance(value, dict):
            for choice in part.get("oneOf", []):
                choice = follow(choice)
                word = choice.get("properties", {}).get("do", {}).get("const")
                if choice.get("type") != "string" and word == value.get("do"):
                    part = choice
            yield at, part
            for key, inner in value.items():
                inner_schema = part.get("properties", {}).get(key) or part.get("additionalProperties")
                if isinstance(inner_schema, dict):
                    yield from walk(inner_schema, inner, at + (key,))
        if isinstance(value, list) and "items" in part:
            for index, inner in enumerate(value):
                yield from walk(part["items"], inner, at + (index,))

    def properties(part):
        return {key: follow(inner) for key, inner in part.get("properties", {}).items()}

    for at, part in walk(schema, document, path):
        yield at, part, properties(part)


def changed(document, path, key, value):
    result = copy.deepcopy(document)
    section = result
    for step in path:
        section = section[step]
    section[key] = value
    return result


class Reader:
    """The program's readers, one process for all questions."""

    def __init__(self, program, folder):
        self.folder, self.count = folder, 0
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "video").mkdir(exist_ok=True)
        (folder / "system").mkdir(exist_ok=True)
        self.write("camera.yaml", CAMERA)
        self.write("waypoints.yaml", BASES["flight"][1])
        self.write("experiment.yaml", {"place": {"source": "stadium:twin"}, "simulated": {"render": {"flight": "waypoints.yaml"}}, "real": {"kind": "surrogate", "render": {"flight": "waypoints.yaml"}}})
        self.write("recorded/camera.yaml", CAMERA)
        (self.folder / "recorded/images").mkdir(exist_ok=True)
        Image.new("L", (128, 96)).save(self.folder / "recorded/images/000000.png")
        (self.folder / "recorded/times.txt").write_text("000000 0.0 0\n")
        (self.folder / "recorded/groundtruth.txt").write_text("0 0 0 9 0 0 0 1\n")
        self.write("system/adapter.yaml", {"name": "own", "takes": {"inputs": ["images"], "lenses": ["any"]}})
        (folder / "log.csv").write_text("t,lat,lon,height\n")
        (folder / "imu.csv").write_text("#timestamp [ns],w_x,w_y,w_z,a_x,a_y,a_z\n")
        (folder / "route.kml").write_text("<kml><LineString><coordinates>8,47 8,47.001</coordinates></LineString></kml>\n")
        (folder / "path.txt").write_text("0 0 0 9 0 0 0 1\n1 9 0 9 0 0 0 1\n")
        self.process = subprocess.Popen([program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def write(self, name, document):
        (self.folder / name).parent.mkdir(parents=True, exist_ok=True)
        (self.folder / name).write_text(json.dumps(document), encoding="utf-8")  # JSON is YAML

    def answer(self, kind, document):
        """"ok", or the program's message."""
        self.count += 1
        name = "probe/adapter.yaml" if kind == "adapter" else "sensors-probe.yaml" if kind == "sensors" else "probe.json" if kind == "metrics" else "probe.yaml"
        self.write(name, document)
        if kind == "sensors":
            self.write("with-sensors.yaml", {**BASES["flight"][1], "sensors_file": name})
            name = "with-sensors.yaml"
        self.process.stdin.write(f"{kind} {self.folder / name}\n")
        self.process.stdin.flush()
        return self.process.stdout.readline().strip()


def listed_keys(answer):
    """The keys that a message about an unknown one lists; None if it is another message."""
    match = re.search(re.escape(UNKNOWN) + r"' is not a key here; there are (.*)$", answer)
    return set(match.group(1).split(", ")) if match else None


def sections_of(part):
    """The properties of every section that a schema describes, as text."""
    if isinstance(part, dict):
        if part.get("additionalProperties") is False and "properties" in part:
            yield json.dumps(part["properties"])
        for inner in part.values():
            yield from sections_of(inner)
    elif isinstance(part, list):
        for inner in part:
            yield from sections_of(inner)


def key_faults(kind, schema, reader):
    """Sections whose keys differ, or that no document here has."""
    faults, expected, unseen = [], {}, set(sections_of(schema))
    for base in BASES[kind]:
        for path, part, inner in documents(schema, base):
            if part.get("additionalProperties") is not False:
                continue
            unseen.discard(json.dumps(part["properties"]))
            answer = reader.answer(kind, changed(base, path, UNKNOWN, 1))
            known = listed_keys(answer)
            where = kind + ":" + ".".join(map(str, path))
            if known is None:
                faults.append(f"{where}: a key that is not there is not refused: {answer}")
                continue
            given = set(inner)
            if path and path[-1] == "lidar":  # the keys of the other patterns
                pattern = base["sensors"]["lidar"]["pattern"] if kind == "flight" else base["lidar"]["pattern"]
                given -= {key for name, keys in PATTERNS.items() if name != pattern for key in keys if key not in PATTERNS[pattern]}
            given_, known_ = expected.setdefault(where, (set(), set()))
            given_.update(given)
            known_.update(known)
    faults += [f"{kind}: no document of the test has the section {text[:100]}" for text in unseen]
    for where, (given, known) in expected.items():
        for key in sorted(given - known):
            faults.append(f"{where}: the program has no key {key}")
        for key in sorted(known - given):
            faults.append(f"{where}: the schema has no key {key}")
    return faults


def probes(key, part):
    """Values to try for a property: those at its limits, of other types, and far out."""
    kinds = part.get("type", [])
    kinds = kinds if isinstance(kinds, list) else [kinds]
    if "default" in part:
        yield part["default"]
    if "enum" in part:
        yield from part["enum"]
        yield "qq"
        yield [1, 2]
    elif "boolean" in kinds:
        yield from (True, False, "qq", 3, [])
    elif "integer" in kinds or "number" in kinds:
        whole = "integer" in kinds
        step = 1 if whole else 1e-6
        limited = key in LIMITED_BY_OTHERS
        for limit in () if limited else ("minimum", "exclusiveMinimum", "maximum", "exclusiveMaximum"):
            if limit in part:
                yield from (part[limit], part[limit] - step, part[limit] + step)
        yield from ("qq", [], True)
        if whole:
            yield 1.5
        if not limited and key not in WITHOUT_FAR_NUMBERS:
            yield from (-100000, -1, 0, 1, 100000) if whole else (-1e7, -1.0, 0.0, 1.0, 1e7)
    elif "array" in kinds and part.get("items", {}).get("type") == "number":
        least, most = part.get("minItems", 0), part.get("maxItems", 4)
        item = part.get("default", [1])[0] if part.get("default") else 1
        yield from ([item] * least, [item] * (most + 1), "qq", ["qq"] * max(least, 1), 3)
        if most <= 16:
            yield [item] * most
        if least > 0:
            yield [item] * (least - 1)
        if "exclusiveMinimum" in part["items"]:
            yield [part["items"]["exclusiveMinimum"]] * max(least, 1)
    elif "string" in kinds:
        yield [1, 2]
    elif "object" in kinds:
        yield from (3, [1])


def value_faults(kind, schema, reader):
    """Values on which schema and program disagree."""
    faults = []
    validator = jsonschema.Draft202012Validator(schema)
    seen = set()
    for base in BASES[kind]:
        if (error := jsonschema.exceptions.best_match(validator.iter_errors(base))) is not None:
            faults.append(f"{kind}: a file that the test makes is refused by the schema: {error.json_path}: {error.message}")
        if (answer := reader.answer(kind, base)) != "ok":
            faults.append(f"{kind}: a file that the test makes is refused by the program: {answer}")
        for path, _, inner in documents(schema, base):
            where = tuple(step for step in path if not isinstance(step, int)) + ((base_step(base, path),) if "mission" in path else ())
            for key, part in inner.items():
                pattern = base.get("sensors", base).get("lidar", {}).get("pattern")
                foreign = path and path[-1] == "lidar" and key not in PATTERNS[pattern] and any(key in keys for keys in PATTERNS.values())
                if key in NOT_PROBED or key in FREE_TEXT or foreign or (where, key, pattern if path and path[-1] == "lidar" else None) in seen:
                    continue
                seen.add((where, key, pattern if path and path[-1] == "lidar" else None))
                for value in probes("lidar.rate_hz" if key == "rate_hz" and path[-1] == "lidar" else key, part):
                    document = changed(base, path, key, value)
                    answer = reader.answer(kind, document)
                    words = re.search(r"it must be one of: (.*)$", answer)
                    if "enum" in part and words and set(words.group(1).split(", ")) != set(map(str, part["enum"])):
                        faults.append(f"{kind}:{'.'.join(map(str, path))}.{key}: the program takes {words.group(1)}, the schema {part['enum']}")
                    if "does not go together" in answer or "goes together" in answer or "which does not exist" in answer:
                        continue
                    if (answer == "ok") != validator.is_valid(document):
                        faults.append(f"{kind}:{'.'.join(map(str, path))}.{key} = {value!r}: the program says {answer!r}, the schema the opposite")
    return faults


def camera_faults(schema, reader):
    """Lenses that both accept, and changes to one that both refuse."""
    lens = CAMERA["cam0"]
    four = [0.1, 0.0, 0.0, 0.0]
    good = [lens, {**lens, "distortion_model": "radtan", "distortion_coeffs": four}, {**lens, "distortion_model": "equidistant", "distortion_coeffs": four},
            {**lens, "distortion_model": "fov", "distortion_coeffs": [0.9]}, {**lens, "distortion_model": "rational", "distortion_coeffs": [0.1] + [0.0] * 7},
            {**lens, "camera_model": "omni", "intrinsics": [1.0, *lens["intrinsics"]]}, {**lens, "camera_model": "ds", "intrinsics": [0.1, 0.5, *lens["intrinsics"]]},
            {**lens, "camera_model": "eucm", "intrinsics": [0.5, 1.0, *lens["intrinsics"]]}, {**lens, "line_delay": 1e-5, "rostopic": "/cam0", "timeshift_cam_imu": 0.1}, {**lens, "line_delay": -1e-5}]
    bad = [{**lens, "camera_model": "qq"}, {**lens, "distortion_model": "qq"}, {**lens, "intrinsics": [1.0]}, {**lens, "intrinsics": "qq"}, {**lens, "resolution": [128]},
           {**lens, "resolution": [0, 96]}, {**lens, "line_delay": -0.2}, {**lens, "T_cam_imu": [1, 2, 3]}]
    bad += [{key: value for key, value in lens.items() if key != left_out} for left_out in ("camera_model", "intrinsics", "resolution")]
    validator = jsonschema.Draft202012Validator(schema)
    faults = []
    for cameras, accepted in ((good, True), (bad, False)):
        for camera in cameras:
            answer = reader.answer("camera", {"cam0": camera})
            if (answer == "ok") != accepted or validator.is_valid({"cam0": camera}) != accepted:
                faults.append(f"camera: {camera}: the program says {answer!r}, the schema {validator.is_valid({'cam0': camera})}")
    return faults


def base_step(base, path):
    return base["mission"][path[1]]["do"] if len(path) > 1 else ""


def schema_defaults(schema, document_bases):
    """{dotted path: default} of all keys, list entries as [], steps of a mission by their word."""
    result = {}
    for base in document_bases:
        for path, _, inner in documents(schema, base):
            if path[:1] == ("mission",):
                names = ["mission", base_step(base, path)]
            else:
                names = []
                for step in path:
                    if isinstance(step, int):
                        names[-1] += "[]"
                    else:
                        names.append(step)
            for key, part in inner.items():
                if "default" in part:
                    result[".".join(names + [key])] = part["default"]
    return result


def same(a, b):
    if isinstance(a, list):
        return isinstance(b, list) and len(a) == len(b) and all(same(x, y) for x, y in zip(a, b))
    if isinstance(a, (int, float)) and not isinstance(a, bool) and isinstance(b, (int, float)):
        return abs(a - b) <= 1e-6 * max(abs(a), abs(b))
    return a == b


# Defaults that no reader keeps as a value: words and texts that stand for an absent key, checked by their meaning elsewhere.
NOT_COMPARED = {"adapter", "study"}
WORDS_FOR_ABSENT = {"experiment": {"real.kind", "real.ingest.from", "real.ingest.every", "simulated.render.smooth", "alignment.preset"}}


def default_faults(schemas, program, folder):
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "cam.yaml").write_text(json.dumps(CAMERA))
    printed = json.loads(subprocess.run([program, "--defaults", folder], check=True, capture_output=True, text=True).stdout)
    flat = {}
    for section, values in printed.items():
        for key, value in values.items():
            kind, _, path = f"{section}.{key}".partition(".")
            flat.setdefault(kind, {})[path] = value
    flat["flight"].update({f"sensors.{key}": value for key, value in flat["sensors"].items()})
    flat["flight"].update({f"cameras[].degrade.{key}": value for key, value in flat["degrade"].items()})
    for at in ("simulated.render.degrade", "real.render.degrade", "variants[].degrade"):
        flat["experiment"].update({f"{at}.{key}": value for key, value in flat["degrade"].items()})
    for key, value in list(flat["experiment"].items()):
        if key.startswith("odometry."):
            flat["experiment"]["variants[]." + key] = value
    flat["experiment"]["real.render.samples_per_pixel"] = flat["experiment"]["simulated.render.samples_per_pixel"]
    faults = []
    for kind, values in flat.items():
        given = schema_defaults(schemas[kind], BASES[kind])
        ignored = {key for key in given if any(key == word or key.replace("real.", "simulated.") == word or key.replace("simulated.", "real.") == word
                                               for word in WORDS_FOR_ABSENT.get(kind, ()))}
        for key in sorted(set(given) - set(values) - ignored):
            faults.append(f"{kind}:{key}: the test does not know what the program takes")
        for key in sorted(set(values) & set(given)):
            if not same(values[key], given[key]):
                faults.append(f"{kind}:{key}: the program takes {values[key]}, the schema says {given[key]}")
        for key in sorted(set(values) - set(given)):
            faults.append(f"{kind}:{key}: the program takes {values[key]}, the schema has no default")
    return faults


def shape_faults(schemas):
    """What is wrong with the schemas themselves."""
    faults, shared = [], {}
    for kind, schema in schemas.items():
        try:
            jsonschema.Draft202012Validator.check_schema(schema)
        except jsonschema.SchemaError as error:
            faults.append(f"{kind}: no JSON Schema 2020-12: {error.message}")
        if schema.get("$id") != f"{kind}.schema.json" or not schema.get("title") or not schema.get("description"):
            faults.append(f"{kind}: needs $id, title and description")
        for name, part in schema.get("$defs", {}).items():
            if name in shared and shared[name][1] != part:
                faults.append(f"{name} of {kind} differs from that of {shared[name][0]}")
            shared.setdefault(name, (kind, part))
    degrade = shared.get("degrade", (None, {}))[1].get("properties")
    if degrade != schemas["degrade"]["properties"]:
        faults.append("degrade of experiment differs from degrade.schema.json")
    of_camera = schemas["flight"]["$defs"]["camera_degrade"]["properties"]
    if of_camera != {key: part for key, part in schemas["degrade"]["properties"].items() if not key.startswith("video_")}:
        faults.append("camera_degrade of flight differs from degrade.schema.json without its video")
    if schemas["flight"]["$defs"]["sensors"]["properties"] != schemas["sensors"]["properties"]:
        faults.append("sensors of flight differs from sensors.schema.json")
    return faults


class PlainTimes(yaml.SafeLoader):
    """Times stay text, as the program reads them; 1e-6 is a number."""


PlainTimes.yaml_implicit_resolvers = {letter: [(tag, rule) for tag, rule in rules if tag != "tag:yaml.org,2002:timestamp"]
                                      for letter, rules in yaml.SafeLoader.yaml_implicit_resolvers.items()}
PlainTimes.add_implicit_resolver("tag:yaml.org,2002:float", re.compile(r"^[-+]?[0-9][0-9.]*[eE][-+]?[0-9]+$"), list("-+0123456789."))


def example_faults(source, schemas):
    """Examples and adapters: the schema that their first line names, or an adapter's, accepts them."""
    faults, files = [], sorted((source / "examples").glob("*.yaml")) + sorted((source / "examples/benchmark").glob("*.yaml"))
    for file in files + sorted((source / "adapters").glob("*/adapter.yaml")):
        text = file.read_text(encoding="utf-8")
        named = re.match(r"# yaml-language-server: \$schema=(\S+)\n", text)
        if not named:
            faults.append(f"{file.relative_to(source)}: its first line names no schema")
            continue
        target = (file.parent / named.group(1)).resolve()
        if not target.is_file():
            faults.append(f"{file.relative_to(source)}: there is no {named.group(1)}")
            continue
        validator = jsonschema.Draft202012Validator(schemas[target.name.removesuffix(".schema.json")])
        for error in validator.iter_errors(yaml.load(text, PlainTimes)):
            faults.append(f"{file.relative_to(source)}: {error.json_path}: {error.message[:200]}")
    return faults


def load(source):
    return {file.name.removesuffix(".schema.json"): json.loads(file.read_text(encoding="utf-8")) for file in sorted((source / "schemas").glob("*.schema.json"))}


def faults_of_people_files(schemas, program, work):
    faults = shape_faults(schemas)
    reader = Reader(program, work)
    for kind in BASES:
        faults += key_faults(kind, schemas[kind], reader) + value_faults(kind, schemas[kind], reader)
    faults += camera_faults(schemas["camera"], reader)
    return faults + default_faults(schemas, program, work / "defaults"), reader


def main(source, program, work):
    source, work = pathlib.Path(source), pathlib.Path(work)
    schemas = load(source)
    faults, reader = faults_of_people_files(schemas, program, work)
    faults += example_faults(source, schemas)
    for fault in faults:
        print(fault)
    print(f"{reader.count} questions to the readers")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:4]))
