// The floor of a 100 Hz loop: clock_nanosleep to absolute times, and how late each wake-up was, in ns, one a line.
// Arguments: number of cycles, period in ns, real-time priority.
#define _GNU_SOURCE
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

int main(int argc, char **argv) {
    if (argc != 4) return 2;
    const long cycles = atol(argv[1]), period_ns = atol(argv[2]);
    const struct sched_param priority = {.sched_priority = atoi(argv[3])};
    if (sched_setscheduler(0, SCHED_FIFO, &priority) != 0) perror("no real-time priority");
    long *late_ns = malloc(sizeof(long) * cycles);
    if (late_ns == NULL) return 1;
    struct timespec due, now;
    clock_gettime(CLOCK_MONOTONIC, &due);
    for (long i = 0; i < cycles; i++) {
        due.tv_nsec += period_ns;
        while (due.tv_nsec >= 1000000000L) {
            due.tv_nsec -= 1000000000L;
            due.tv_sec++;
        }
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &due, NULL);
        clock_gettime(CLOCK_MONOTONIC, &now);
        late_ns[i] = (now.tv_sec - due.tv_sec) * 1000000000L + now.tv_nsec - due.tv_nsec;
    }
    for (long i = 0; i < cycles; i++) printf("%ld\n", late_ns[i]);
    return 0;
}
