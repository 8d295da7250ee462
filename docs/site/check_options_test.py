"""check_options.py finds what is planted, and reads help as the program prints it."""

import unittest

import check_options
import command_pages

OPTIONS = {("render",): {"--out", "--help"}, ("scene", "stadium"): {"--seed", "--help"}}
HELP = """does something
Usage: tileflight render [OPTIONS] SOURCE

Options:
  -h,--help                   Print this help message and exit
  --size FLOAT x 3            EAST,NORTH,UP of the region, metres
  --region TEXT ... Excludes: --center
                              GeoJSON file
  --rectify{false} Excludes: --system
                              keep them
  --near FLOAT:POSITIVE=2     warn
  --samples INT:{1,4,9,16}    samples
  --out TEXT REQUIRED         folder

Example:
  tileflight render tiles
"""


class CheckOptionsTest(unittest.TestCase):
    def faults(self, text):
        return list(check_options.faults([("page.md", text)], OPTIONS))

    def test_what_exists_is_no_fault(self):
        self.assertEqual(self.faults("`tileflight render A --out B`\n```sh\nbuild/bin/tileflight scene stadium X --seed 2  # --gone\n```\n"), [])

    def test_planted_faults_are_found(self):
        self.assertEqual(len(self.faults("`tileflight render A --outt B`")), 1)
        self.assertEqual(len(self.faults("```sh\ntileflight rendr A --out B\n```\n")), 1)
        self.assertEqual(len(self.faults("```sh\ntileflight render A \\\n  --gone B\n```\n")), 1)

    def test_help_is_read(self):
        description, usage, groups, examples = command_pages.parse_help(HELP)
        entries = {tuple(names): (command_pages.value_in_words(value), notes) for names, value, notes in
                   (command_pages.parse_entry(left) for _, group in groups for left, _ in group)}
        self.assertEqual(description, "does something")
        self.assertEqual(entries[("--size",)][0], "3 of: number, separated by commas")
        self.assertEqual(entries[("--region",)], ("text, may be repeated", ["not with `--center`"]))
        self.assertEqual(entries[("--rectify",)], ("", ["not with `--system`"]))
        self.assertEqual(entries[("--near",)], ("number, positive", ["default 2"]))
        self.assertEqual(entries[("--samples",)][0], "one of `1`, `4`, `9`, `16`")
        self.assertEqual(entries[("--out",)], ("text", ["required"]))
        self.assertEqual(examples, ["  tileflight render tiles"])


if __name__ == "__main__":
    unittest.main()
