/* Ten thousand odd inputs, times and saved states for a driver, good ones in between: what is refused changes nothing,
 * what is taken gives finite numbers. For sanitizers. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "DRIVER.h"

#define COUNT (sizeof odd / sizeof *odd)

static const double odd[] = {NAN, INFINITY, -INFINITY, -0.0, 0.0, 1e308, -1e308, 5e-324, 1e9, -1e9, 1e5, 500.0, -1.0, 1.0, 2.5, 1e-9};

static unsigned long long last = 88172645463325252ULL;

static unsigned below(unsigned end)
{
    last ^= last << 13;
    last ^= last >> 7;
    last ^= last << 17;
    return (unsigned)((last >> 33) % end);
}

int main(void)
{
    static DRIVER_state driver, before;
    static unsigned char saved[DRIVER_SAVED], copy[DRIVER_SAVED];
    DRIVER_inputs inputs;
    DRIVER_outputs out;
    double time = 0.0;
    unsigned k, taken = 0, refused = 0;
    memset(&driver, 255, sizeof driver);
    DRIVER_defaults(&inputs);
    if (DRIVER_step(&driver, 0.0, &inputs, &out) == DRIVER_OK || DRIVER_message(&driver)[0] == 0) {
        return 1;
    }
    DRIVER_start(&driver, ~0ULL, ~0U, 0.0, DRIVER_ALL_KNOWN);
    DRIVER_save(&driver, saved);
    for (k = 0; k < 10000; k++) {
        double fields[sizeof inputs / sizeof(double)], to = time + 0.001 * (1 + below(1000));
        DRIVER_status status;
        DRIVER_defaults(&inputs);
        memcpy(fields, &inputs, sizeof inputs);
        if (below(2)) {
            fields[below((unsigned)(sizeof fields / sizeof *fields))] = odd[below(COUNT)];
        }
        to = below(5) ? to : odd[below(COUNT)];
        memcpy(&inputs, fields, sizeof inputs);
        before = driver;
        if (below(10) == 0) {
            memcpy(copy, saved, sizeof copy);
            copy[below(DRIVER_SAVED)] ^= (unsigned char)(1U << below(8));
            status = DRIVER_restore(&driver, copy, below(4) ? DRIVER_SAVED : below(DRIVER_SAVED + 9) % DRIVER_SAVED);
        } else if (below(20) == 0) {
            status = DRIVER_look(&driver, &inputs);
        } else if (below(40) == 0) {
            DRIVER_save(&driver, saved);
            status = DRIVER_restore(&driver, saved, DRIVER_SAVED);
        } else {
            status = DRIVER_step(&driver, to, &inputs, &out);
            time = status == DRIVER_OK ? to : time;
            if (status == DRIVER_OK && !(isfinite(out.offset) && isfinite(out.rate) && isfinite(out.heading))) {
                return 2;
            }
        }
        taken += status == DRIVER_OK;
        refused += status != DRIVER_OK;
        if (status != DRIVER_OK) {
            if (DRIVER_message(&driver)[0] == 0) {
                return 3;
            }
            driver.message = before.message;
            if (memcmp(&driver, &before, sizeof driver) != 0) {
                return 4;
            }
        }
    }
    printf("%u %u\n", taken, refused);
    return 0;
}
