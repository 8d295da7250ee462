#!/usr/bin/env python3
"""check_duplicates.py finds what is planted, and nothing else."""
import unittest

import check_duplicates

BODY = """double {name}(const std::vector<double>& {values}, double {limit}) {{
  if ({values}.empty()) throw std::invalid_argument("no values");
  double sum = 0.0;{comment}
  for (const double value : {values}) {{
    if (value < {limit}) sum += value * value;
  }}
  return std::sqrt(sum / static_cast<double>({values}.size()));
}}
"""


def function(name="rms", values="values", limit="limit", comment="", body=BODY):
    return "namespace a {\n\n" + body.format(name=name, values=values, limit=limit, comment=comment) + "\n}  // namespace a\n"


class Duplicates(unittest.TestCase):
    def test_other_names_and_comments_are_the_same_function(self):
        found = check_duplicates.faults({"a.cpp": function(), "b.cpp": function("root", "all", "most", "  // of squares")})
        self.assertEqual(found, ["a.cpp:3 and b.cpp:3: the same function, written more than once"])

    def test_another_operator_is_another_function(self):
        self.assertEqual(check_duplicates.faults({"a.cpp": function(), "b.cpp": function(body=BODY.replace("value < ", "value > "))}), [])

    def test_exchanged_parameters_are_another_function(self):
        swapped = BODY.replace("value < {limit}", "{limit} < value")
        self.assertEqual(check_duplicates.faults({"a.cpp": function(), "b.cpp": function(body=swapped)}), [])

    def test_twice_in_a_file_is_not_looked_for(self):
        self.assertEqual(check_duplicates.faults({"a.cpp": function() + function("other")}), [])

    def test_short_functions_may_be_alike(self):
        short = "double twice(double x) {\n  return 2.0 * x;\n}\n"
        self.assertEqual(check_duplicates.faults({"a.cpp": short, "b.cpp": short}), [])


if __name__ == "__main__":
    unittest.main()
