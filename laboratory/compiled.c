/* Time of drivers in C, in one thread: so many, at so many steps a second, for so long. Inputs change all the time. */
#define _POSIX_C_SOURCE 199309L
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "DRIVER.h"

static double seconds(clockid_t clock)
{
    struct timespec now;
    clock_gettime(clock, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static int rising(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

int main(int count, char **words)
{
    const int drivers = count > 1 ? atoi(words[1]) : 1, rate = 100, steps = (count > 2 ? atoi(words[2]) : 60) * rate;
    const size_t all = (size_t)drivers * (size_t)steps;
    DRIVER_state *const driver = malloc((size_t)drivers * sizeof *driver);
    double *const took = malloc(all * sizeof *took), begun = seconds(CLOCK_THREAD_CPUTIME_ID), sum = 0.0, whole;
    DRIVER_inputs inputs;
    DRIVER_outputs outputs;
    size_t at = 0;
    int i, k, with;
    for (i = 0; i < drivers; i++) {
        DRIVER_start(&driver[i], 1U, (uint32_t)i, 0.0, DRIVER_ALL_KNOWN);
    }
    printf("%d bytes and %.1f us to begin each\n", (int)sizeof *driver, 1e6 * (seconds(CLOCK_THREAD_CPUTIME_ID) - begun) / drivers);
    DRIVER_defaults(&inputs);
    begun = seconds(CLOCK_THREAD_CPUTIME_ID);
    for (k = 0; k < steps; k++) {
        inputs.speed = 30.0 + 5.0 * sin(0.001 * k);
        for (i = 0; i < drivers; i++) {
            if (DRIVER_step(&driver[i], (double)k / rate, &inputs, &outputs) != DRIVER_OK) {
                return 1;
            }
            sum += outputs.offset;
        }
    }
    whole = seconds(CLOCK_THREAD_CPUTIME_ID) - begun;
    printf("%.2f %% of a core for %d drivers at %d Hz (mean offset %.3f m)\n", 100.0 * whole / steps * rate, drivers, rate, sum / (double)all);
    for (with = 0; with < 2; with++) { /* once more, the clock alone and with the call: an interrupted thread shows in both */
        for (at = 0; at < all; at++) {
            const double before = seconds(CLOCK_THREAD_CPUTIME_ID);
            if (with) {
                DRIVER_step(&driver[at % (size_t)drivers], (double)(steps + (int)(at / (size_t)drivers)) / rate, &inputs, &outputs);
            }
            took[at] = seconds(CLOCK_THREAD_CPUTIME_ID) - before;
        }
        qsort(took, all, sizeof *took, rising);
        printf("%s: median %.2f, 99 %% %.2f, 99.99 %% %.2f, worst %.2f us of %lu\n", with ? "a call" : "the clock alone",
               1e6 * took[all / 2], 1e6 * took[all - 1 - all / 100], 1e6 * took[all - 1 - all / 10000],
               1e6 * took[all - 1], (unsigned long)all);
    }
    free(driver);
    free(took);
    return 0;
}
