"""What `tile` writes, read by loaders.gl and judged by Khronos's glTF validator: a textured mesh of several materials, with the tiles
listed and implicit, compressed and not, at once and out of core.

Usage: check_tiles.py TILEFLIGHT FOLDER_OF_THIS_TEST WORK_FOLDER
Exits with 77 (skipped) where there is no node, or npm cannot fetch the packages.
"""
import json
import pathlib
import shutil
import subprocess
import sys

TESTS = pathlib.Path(__file__).resolve().parents[1]
sys.path.insert(0, str(TESTS))
from npm_packages import install  # noqa: E402

VARIANTS = {
    "listed": [],
    "implicit": ["--implicit"],
    "compressed": ["--compression", "meshopt"],
    "implicit-compressed": ["--implicit", "--compression", "meshopt"],
    "untextured": ["--no-textures"],
    "out-of-core": ["--out-of-core"],
    "out-of-core-implicit": ["--out-of-core", "--implicit", "--compression", "meshopt"],
}


def run(command, **options):
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, timeout=300, check=False, **options)
    assert done.returncode == 0, f"{command}: {done.stderr[-2000:]}"
    return done.stdout


def check(tiles, written, read, textured):
    """`written`: what `tile --json` said of the folder `tiles`; `read`: what check_tiles.mjs found."""
    assert not read["errors"], read["errors"][:5]
    assert not read["warnings"], read["warnings"][:5]
    on_disk = sorted(str(file.relative_to(tiles)) for file in tiles.rglob("*.glb"))
    assert len(on_disk) > 20 and sorted(read["contents"]) == on_disk, (len(read["contents"]), len(on_disk))
    assert read["triangles"] == sum(level["triangles"] for level in written["levels"]), read["triangles"]
    assert len(on_disk) == sum(level["tiles"] for level in written["levels"])
    # Without pictures, a tile of several materials has a texture of their colours.
    assert (read["textures"] == len(on_disk)) == textured, read["textures"]


def main():
    tileflight, source, work = sys.argv[1], pathlib.Path(sys.argv[2]), pathlib.Path(sys.argv[3])
    install(source, work, "check_tiles.mjs")
    run([sys.executable, TESTS.parent / "benchmarks" / "make_large_obj.py", work / "mesh", "--cells", "32", "--image", "128"])
    for name, options in VARIANTS.items():
        tiles = work / name
        shutil.rmtree(tiles, ignore_errors=True)
        written = run([tileflight, "tile", work / "mesh" / "large.obj", "--out", tiles, "--tile-triangles", "1000", "--json", *options])
        read = json.loads(run(["node", "check_tiles.mjs", tiles], cwd=work))
        check(tiles, json.loads(written), read, textured="--no-textures" not in options)
        print(f"{name}: {len(read['contents'])} tiles, {read['triangles']:.0f} triangles")


main()
