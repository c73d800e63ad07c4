# SPDX-License-Identifier: Apache-2.0
"""What pyproject.toml cannot say: the library inside makes a wheel for one platform, and for every Python 3 there. The version is
the project's, from the build (TAKT_VERSION).
"""
import os

from setuptools import Distribution, setup
from wheel.bdist_wheel import bdist_wheel


class WithLibrary(Distribution):
    def has_ext_modules(self):
        return True


class PlatformWheel(bdist_wheel):
    def get_tag(self):
        return "py3", "none", super().get_tag()[2]


setup(version=os.environ["TAKT_VERSION"], distclass=WithLibrary, cmdclass={"bdist_wheel": PlatformWheel})
