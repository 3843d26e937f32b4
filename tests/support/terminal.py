"""Plays a script in the foreground of a new terminal, presses keys, and prints the result.

usage: terminal.py COLUMNS STEP... -- PROGRAM ARGUMENT...
A step is `wait:TEXT` (until the terminal shows TEXT), `key:CHARACTERS`, `resize:COLUMNS`, `run:COMMAND` (of the shell), `kill` (the program, not its group).
Prints `exit CODE`, `icanon BOOL`, `echo BOOL`, and then what the terminal showed.
"""
import fcntl, os, select, signal, struct, sys, termios, time

at = sys.argv.index("--")
columns, steps, program = int(sys.argv[1]), sys.argv[2:at], sys.argv[at + 1 :]
LIMIT = 20


def resize(descriptor, columns):
    fcntl.ioctl(descriptor, termios.TIOCSWINSZ, struct.pack("HHHH", 24, columns, 0, 0))


# The far end stays open here, so that its state can be read after the program has ended.
terminal, far = os.openpty()
pid = os.fork()
if pid == 0:
    os.setsid()
    fcntl.ioctl(far, termios.TIOCSCTTY, 0)
    for ignored in signal.SIGHUP, signal.SIGINT, signal.SIGQUIT:
        signal.signal(ignored, signal.SIG_DFL)
    for descriptor in range(3):
        os.dup2(far, descriptor)
    os.close(terminal)
    os.execv(program[0], program)
resize(terminal, columns)
shown = ""
code = None


def read(seconds):
    global shown
    if select.select([terminal], [], [], seconds)[0]:
        try:
            shown += os.read(terminal, 65536).decode(errors="replace")
        except OSError:
            pass


def ended():
    global code
    if code is None:
        found, status = os.waitpid(pid, os.WNOHANG)
        if found:
            code = os.waitstatus_to_exitcode(status)
    return code is not None


seen = 0
for step in steps:
    what, _, text = step.partition(":")
    if what == "wait":
        end = time.monotonic() + LIMIT
        while text not in shown[seen:] and time.monotonic() < end:
            read(0.05)
        found = shown.find(text, seen)
        if found < 0:
            print(f"never showed {text!r}")
            break
        seen = found + len(text)
    elif what == "key":
        os.write(terminal, text.encode())
    elif what == "resize":
        resize(terminal, int(text))
    elif what == "run":
        os.system(text)
    elif what == "kill":
        os.kill(pid, signal.SIGKILL)
end = time.monotonic() + LIMIT
while not ended() and time.monotonic() < end:
    read(0.05)
if not ended():
    os.kill(pid, signal.SIGKILL)
# The guard's output and actions come a moment later.
end = time.monotonic() + 3
modes = termios.tcgetattr(far)[3]
while time.monotonic() < end and not modes & termios.ICANON:
    read(0.05)
    modes = termios.tcgetattr(far)[3]
quiet = time.monotonic() + 0.7
while time.monotonic() < quiet:
    read(0.05)
print("exit", code)
print("icanon", bool(modes & termios.ICANON))
print("echo", bool(modes & termios.ECHO))
print(shown)
