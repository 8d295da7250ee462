"""`tileflight serve` on the tiny place, on any free port, for as long as a with block. Without settings: time goes on by
itself, as for AirSim's scripts."""
import json
import os
import pathlib
import signal
import subprocess
import tempfile

import tiny_place
import tileflight_airsim as airsim


class RunningServer:
    def __init__(self, settings=None, *options, token=None):
        self.settings, self.options, self.token = settings, options, token

    def __enter__(self):
        self._folder = tempfile.TemporaryDirectory()
        folder = pathlib.Path(self._folder.name)
        self.files = folder / "files"
        self.files.mkdir()
        tileset = tiny_place.write(folder / "place")
        settings = []
        if self.settings is not None:
            settings = ["--settings", str(folder / "settings.json")]
            (folder / "settings.json").write_text(
                json.dumps({"SettingsVersion": 1.2, "StepOnDemand": True, **self.settings}))
        token = ["--token", self.token] if self.token else []
        self.process = subprocess.Popen(
            [os.environ["TILEFLIGHT_BINARY"], "serve", str(tileset), *settings, "--port", "0", "--json",
             "--threads", "2", "--files", str(self.files), *token, *self.options],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.listening = json.loads(self._first_object())
        self.port = self.listening["port"]
        return self

    def __exit__(self, *_):
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()
        self.process.stdout.close()
        self.process.stderr.close()
        self._folder.cleanup()

    def _first_object(self):
        lines = []
        for line in self.process.stdout:
            lines.append(line)
            if line.startswith("}"):
                return "".join(lines)
        raise RuntimeError("the server did not start: " + self.process.stderr.read())

    def client(self, **options):
        return airsim.MultirotorClient(port=self.port, timeout_value=60, token=self.token, **options)

    def stop(self, with_signal=signal.SIGTERM):
        """(exit code, what it still wrote to stdout, to stderr)"""
        self.process.send_signal(with_signal)
        out, err = self.process.communicate(timeout=30)
        return self.process.returncode, out, err
