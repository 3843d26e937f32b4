"""`python -m motionseq` runs the program."""

import os
import sys

from . import path

program = path()
os.execv(program, [program, *sys.argv[1:]])
