/* A driver for a minute at 100 Hz: time, offset, rate and heading, a line each tenth of a second. */
#include <stdio.h>

#include "DRIVER.h"

int main(void) {
    static DRIVER_state driver;
    DRIVER_inputs inputs;
    DRIVER_outputs outputs;
    int k, failed = DRIVER_start(&driver, 1U, 0U, 0.0, DRIVER_ALL_KNOWN) != DRIVER_OK;
    DRIVER_defaults(&inputs);
    for (k = 0; k <= 6000 && !failed; k++) {
        inputs.speed = 30.0; /* here: what your simulation knows of the vehicle at this time */
        failed = DRIVER_step(&driver, 0.01 * k, &inputs, &outputs) != DRIVER_OK;
        if (!failed && k % 10 == 0) {
            printf("%.2f %.6f %.6f %.7f\n", 0.01 * k, outputs.offset, outputs.rate, outputs.heading);
        }
    }
    if (failed) {
        fprintf(stderr, "%s\n", DRIVER_message(&driver));
    }
    return failed;
}
