"""schema_pages.py lists every key of a schema: nested, in lists, by reference, of alternatives, and a kind that holds itself once."""

import unittest

import schema_pages

SCHEMA = {
    "title": "Things",
    "$defs": {
        "point": {"type": "array", "items": {"type": "number"}, "minItems": 3, "maxItems": 3, "description": "A point."},
        "node": {"type": "object", "description": "A node.", "properties": {"children": {"type": "array", "items": {"$ref": "#/$defs/node"}}}},
    },
    "required": ["name"],
    "properties": {
        "name": {"type": "string", "description": "What it is called."},
        "speed": {"type": "number", "exclusiveMinimum": 0, "x-unit": "m/s", "default": 2.5},
        "at": {"$ref": "#/$defs/point", "description": "Where."},
        "mode": {"enum": ["a", "b"], "default": "a"},
        "either": {"oneOf": [{"type": "string"}, {"type": "object", "properties": {"file": {"type": "string"}}}]},
        "stops": {"type": "array", "items": {"type": "object", "required": ["to"], "properties": {"to": {"$ref": "#/$defs/point"}}}},
        "by_name": {"type": "object", "additionalProperties": {"type": "object", "properties": {"limit": {"type": "integer", "minimum": 1}}}},
        "tree": {"$ref": "#/$defs/node"},
    },
}


class SchemaPagesTest(unittest.TestCase):
    def setUp(self):
        self.rows = {row[0]: row[1:] for row in schema_pages.rows_of(SCHEMA, SCHEMA)}

    def test_every_key_is_listed(self):
        self.assertEqual(list(self.rows), ["name", "speed", "at", "mode", "either", "either.file", "stops", "stops[].to", "by_name",
                                           "by_name.NAME", "by_name.NAME.limit", "tree", "tree.children"])

    def test_rows_say_type_unit_default_and_meaning(self):
        self.assertEqual(self.rows["name"], ("text", "", "required", "What it is called."))
        self.assertEqual(self.rows["speed"][:3], ("number, > 0", "m/s", "`2.5`"))
        self.assertEqual(self.rows["at"], ("list of 3× number", "", "", "Where."))
        self.assertEqual(self.rows["mode"][:3], ("`a` or `b`", "", "`a`"))
        self.assertEqual(self.rows["either"][0], "text, or mapping")
        self.assertEqual(self.rows["stops[].to"][2:], ("required", "A point."))
        self.assertEqual(self.rows["by_name.NAME.limit"][0], "whole number, ≥ 1")

    def test_a_page_is_made(self):
        text = schema_pages.page("Things", SCHEMA, "thing.schema.json")
        for key in self.rows:
            section, _, name = key.rpartition(".")
            self.assertIn(f"``{name}``", text)
            self.assertIn(f"``{section}``" if section else "Top level", text)


if __name__ == "__main__":
    unittest.main()
