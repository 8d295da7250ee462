"""check_site.py finds what is planted, and nothing in a sound site."""

import pathlib
import tempfile
import unittest

import check_site

SOUND = """<!doctype html><html><head><link rel="stylesheet" href="s.css"><link rel="canonical" href="https://example.org/a.html"></head>
<body><h1 id="top">A</h1><a href="b.html#there">b</a> <a href="https://example.org">outside</a> <a href="#top">up</a>
<img src="data:image/png;base64,AA=="></body></html>"""
OTHER = '<html><body><p id="there">B</p></body></html>'


class CheckSiteTest(unittest.TestCase):
    def faults(self, page=SOUND, css="p { color: red }"):
        with tempfile.TemporaryDirectory() as folder:
            root = pathlib.Path(folder)
            (root / "a.html").write_text(page)
            (root / "b.html").write_text(OTHER)
            (root / "s.css").write_text(css)
            return check_site.faults(root)

    def test_a_sound_site_has_no_faults(self):
        self.assertEqual(self.faults(), [])

    def test_planted_faults_are_found(self):
        for old, new, words in [
            ("b.html#there", "c.html", "leads nowhere"),
            ("b.html#there", "b.html#gone", "no such anchor"),
            ('"#top"', '"#gone"', "no such anchor"),
            ("b.html#there", "../outside.html", "leads out of the site"),
            ("b.html#there", "/b.html", "leads out of the site"),
            ('"s.css"', '"https://example.org/s.css"', "loaded from elsewhere"),
            ('"s.css"', '"//example.org/s.css"', "loaded from elsewhere"),
            ("data:image/png;base64,AA==", "gone.png", "leads nowhere"),
            ("</body>", "<script src='https://example.org/x.js'></script></body>", "loaded from elsewhere"),
            ("</body>", "<p id='top'></p></body>", "two elements"),
        ]:
            with self.subTest(new=new):
                found = self.faults(SOUND.replace(old, new))
                self.assertEqual(len(found), 1, found)
                self.assertIn(words, found[0])

    def test_fonts_from_elsewhere_are_found(self):
        self.assertIn("loaded from elsewhere", self.faults(css="@font-face { src: url('https://example.org/f.woff2') }")[0])
        self.assertIn("loaded from elsewhere", self.faults(css="@import 'https://example.org/f.css';")[0])


if __name__ == "__main__":
    unittest.main()
