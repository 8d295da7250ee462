"""setuptools' build backend, with Debian's setuptools and scikit-build where the build environment has none.

pip builds in an environment that holds only what `requires` names, and fetches that from a registry. Nothing is named, so
that a build needs no network; Debian's packages python3-setuptools, python3-wheel, python3-skbuild and pybind11-dev serve
instead.
"""

import sys

sys.path.append("/usr/lib/python3/dist-packages")

from setuptools.build_meta import *  # noqa: E402, F403


def get_requires_for_build_wheel(config_settings=None):
    """Nothing that pip would have to fetch."""
    return []


get_requires_for_build_sdist = get_requires_for_build_editable = get_requires_for_build_wheel
