"""The motionseq program, as a Python package."""

import os
import sys
import sysconfig

__all__ = ["path"]


def path():
    """Returns the path of the motionseq program that was installed with this package.

    Raises FileNotFoundError if it is missing.
    """
    folders = [sysconfig.get_path("scripts")]
    # `pip install --user`
    user_scheme = f"{os.name}_user"
    if user_scheme in sysconfig.get_scheme_names():
        folders.append(sysconfig.get_path("scripts", scheme=user_scheme))
    # `pip install --target FOLDER` and `--prefix FOLDER`
    package = os.path.dirname(os.path.abspath(__file__))
    folders.append(os.path.join(os.path.dirname(package), "bin"))
    folders.append(os.path.normpath(os.path.join(package, *[os.pardir] * 4, "bin")))
    for folder in folders:
        program = os.path.join(folder, "motionseq")
        if os.path.isfile(program):
            return program
    raise FileNotFoundError(f"motionseq is in none of {', '.join(folders)}; for Python {sys.version.split()[0]}")
