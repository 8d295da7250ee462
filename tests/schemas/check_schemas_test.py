"""check_schemas.py finds a key too few or too many, a wrong type, limit, word or default, and copies that differ.

    check_schemas_test.py SOURCE_DIR READ_FILE WORK_DIR
"""

import copy
import pathlib
import sys

import check_schemas


def main(source, program, work):
    right = check_schemas.load(pathlib.Path(source))
    work = pathlib.Path(work)

    def faults_with(kind, change):
        schemas = copy.deepcopy(right)
        change(schemas[kind])
        reader = check_schemas.Reader(program, work)
        schema = schemas[kind]
        if faults := check_schemas.shape_faults(schemas):
            return "\n".join(faults)
        faults = check_schemas.default_faults(schemas, program, work / "defaults")
        if kind in check_schemas.BASES:
            faults += check_schemas.key_faults(kind, schema, reader) + check_schemas.value_faults(kind, schema, reader)
        return "\n".join(faults)

    def expect(fault, kind, change):
        found = faults_with(kind, change)
        assert fault in found, f"not found: {fault}; but:\n{found}"

    study, vehicle = (lambda schema: schema["properties"]), (lambda schema: schema["properties"]["vehicle"]["properties"])
    assert faults_with("study", lambda schema: None) == ""
    expect("the schema has no key ate_limit", "study", lambda schema: study(schema).pop("ate_limit"))
    expect("the program has no key extra", "study", lambda schema: study(schema).update(extra={"type": "string"}))
    expect(".repetitions = 1.000001", "study", lambda schema: study(schema)["repetitions"].update(type="number"))
    expect(".repetitions = 0", "study", lambda schema: study(schema)["repetitions"].pop("minimum"))
    expect(".ate_limit = 0", "study", lambda schema: study(schema)["ate_limit"].pop("exclusiveMinimum"))
    expect(".rank_by = 'qq'", "study", lambda schema: study(schema)["rank_by"]["enum"].append("qq"))
    expect("the program takes f_score, ate, the schema ['f_score']", "study", lambda schema: study(schema)["rank_by"].update(enum=["f_score"]))
    expect("evaluation of study differs from that of experiment", "study", lambda schema: schema["$defs"]["evaluation"]["properties"]["cutoff"].update(default=2.0))
    expect("flight:vehicle.mass_kg: the program takes 1.0, the schema says 2.0", "flight", lambda schema: vehicle(schema)["mass_kg"].update(default=2.0))
    expect("no JSON Schema", "adapter", lambda schema: schema["properties"]["name"].update(type="words"))
    print("all planted faults were found")
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:4]))
