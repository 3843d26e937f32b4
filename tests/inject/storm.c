/* Preloaded library: a signal every STORM_US microseconds, whose handler does not restart system calls. */
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/time.h>

static volatile sig_atomic_t count;

static void handle(int signal) {
    (void)signal;
    count++;
}

__attribute__((constructor)) static void begin(void) {
    long every = atol(getenv("STORM_US"));
    struct itimerval timer = {{0, every}, {0, every}};
    struct sigaction action = {.sa_handler = handle};
    sigaction(SIGALRM, &action, NULL);
    setitimer(ITIMER_REAL, &timer, NULL);
}

/* Shows the test that signals were sent. */
__attribute__((destructor)) static void end(void) {
    FILE *log = fopen(getenv("STORM_LOG"), "a");
    if (log != NULL) {
        fprintf(log, "%d\n", (int)count);
        fclose(log);
    }
}
