"""npm's packages for tests that ask other people's programs."""
import fcntl
import pathlib
import shutil
import subprocess
import sys

SKIPPED = 77  # exit code that ctest takes for a test that was skipped


def skip(why):
    print(f"skipped: {why}")
    sys.exit(SKIPPED)


def install(source: pathlib.Path, work: pathlib.Path, script: str):
    """Copies `script` from `source` into `work`, and fetches the packages of the package-lock.json beside it, once for as long as
    that is the same; tests that run at once wait for each other. Skips the test without node, npm or a registry."""
    if not shutil.which("node") or not shutil.which("npm"):
        skip("node and npm are not installed")
    work.mkdir(parents=True, exist_ok=True)
    with open(work / "lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        wanted = (source / "package-lock.json").read_text()
        fetched = work / "fetched"
        shutil.copy(source / script, work)
        if fetched.exists() and fetched.read_text() == wanted:
            return
        for name in ("package.json", "package-lock.json"):
            shutil.copy(source / name, work)
        command = ["npm", "ci", "--prefer-offline", "--ignore-scripts", "--no-audit", "--no-fund"]
        done = subprocess.run(command, cwd=work, capture_output=True, text=True, timeout=200)
        if done.returncode != 0:
            skip("npm ci failed: " + (done.stderr.strip().splitlines() or ["without a word"])[-1])
        fetched.write_text(wanted)
