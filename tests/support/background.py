"""Plays a script in the background of another program's terminal, kills it, and prints whether the
terminal's modes are unchanged.

usage: background.py PROGRAM ARGUMENT...
The other program is this one. Like an editor, it reads single keys.
"""
import fcntl, os, signal, subprocess, sys, termios, time, tty

terminal, far = os.openpty()
if os.fork() == 0:
    os.setsid()
    fcntl.ioctl(far, termios.TIOCSCTTY, 0)
    for ignored in signal.SIGHUP, signal.SIGINT, signal.SIGQUIT:
        signal.signal(ignored, signal.SIG_DFL)
    os.close(terminal)
    player = subprocess.Popen(sys.argv[1:], stdin=far, stderr=subprocess.PIPE, preexec_fn=os.setpgrp)
    # Its first message says that it plays.
    player.stderr.readline()
    time.sleep(0.3)
    modes = termios.tcgetattr(far)
    modes[3] &= ~(termios.ICANON | termios.ECHO)
    termios.tcsetattr(far, termios.TCSANOW, modes)
    player.send_signal(signal.SIGKILL)
    # Until the guard has ended, too.
    player.stderr.read()
    left = termios.tcgetattr(far)[3] & (termios.ICANON | termios.ECHO)
    print("the other program's modes are", "gone" if left else "there", flush=True)
    os._exit(0)
os.close(far)
os.wait()
