/* @WHAT@
 *
 * C99 with the standard library's math.h, float.h, stdint.h and string.h alone. All that a driver knows is in one
 * structure of constant size (DRIVER_MEMORY bytes, which the caller provides): no allocation, file, lock, thread or
 * global variable. Habits after MISRA C: no recursion, no function with a variable number of arguments, no
 * goto, arrays of fixed length. Each call takes microseconds; DRIVER_start, which draws the driver, some tens.
 *
 * Same profile, seed, drive and context: the offsets of `xosc-lateral sample`. Copying the structure is saving it.
 */
#ifndef DRIVER_H
#define DRIVER_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Sizes that the profile has. */
@SIZES@

/* Columns. */
@KNOWN@

/* Bytes of a driver, on every platform. */
#define DRIVER_MEMORY @MEMORY@

/* Bytes of a saved driver. */
#define DRIVER_SAVED (DRIVER_MEMORY + 16)

/* How far ahead of its time the driver has to be told the context, to respond when `sample` does. [s] A driver who is
 * not told responds so much later, and to what is sudden over seconds; what is random is the same. It is DRIVER_LOOKS
 * calls of DRIVER_look, 0.2 s each. */
#define DRIVER_PREVIEW @PREVIEW@

/* Fault of a driver whose movement, without any context, can't be driven. */
#define DRIVER_MOVEMENT_FAULT @MOVEMENT_FAULT@

/* Every column that the profile reads is known. */
#define DRIVER_ALL_KNOWN UINT64_C(@ALL_KNOWN@)

typedef enum { DRIVER_OK = 0, DRIVER_REFUSED = 1 } DRIVER_status;

/* What a driver sees. NAN: there is none (of speed, position and following there has to be one); INFINITY in a
 * distance: nobody within reach. */
typedef struct {
@INPUTS@
    double position;  /* Where the vehicle is while it does not follow, at its first step and after a restart. [m] */
    double following; /* Not 0: it follows the road, and is where its driver says. */
} DRIVER_inputs;

/* Positive to the LEFT of travel. */
typedef struct {
    double offset;  /* From the lane's centre. [m] */
    double rate;    /* Its change per time. [m/s] */
    double heading; /* Relative to the lane. [rad] */
} DRIVER_outputs;

/* A stream of random numbers: 128 bits of state and of increment, and half a draw that is left. */
typedef struct {
    uint64_t high, low, add_high, add_low, has_half, half;
} DRIVER_random;

/* Logarithms of the factors on coarse and fine movement, of what varies within seconds and within minutes. */
typedef struct {
    DRIVER_random quick, slow;
    double quick_logs[2], slow_logs[2];
} DRIVER_factors;

/* A hidden effect's numbers. */
typedef struct {
    DRIVER_random random;
    double numbers[4];
} DRIVER_hidden_state;

/* A driver: fields are the library's alone. */
typedef struct {
    uint64_t profile, known, message;
    int64_t rows, knots, drawn, left, fine_row, looked, stepped, bin, foresees, fault;
    double begun_at, time, own_time;
    DRIVER_random coarse_random, fine_random;
    DRIVER_factors factors[2];
    double mean, coarse_scale, fine_scale, fine_factors[2], knees[2], limits[2];
    double steps[DRIVER_STEPS], block[DRIVER_EVERY], noise[DRIVER_TAPS], window[4];
    DRIVER_hidden_state hidden[DRIVER_HIDDEN];
    double coefficients[DRIVER_COMPONENTS], history[DRIVER_ROWS][DRIVER_COMPONENTS + 1], settled[DRIVER_LAGS];
    double samples[4], curve[6], next[6];
    double was_following, place, clock, ahead, own_rate, rest, from, from_rate, share, over, heeded[5], owed, pace, moved, paused;
} DRIVER_state;

/* A lane of the profile's own width, at 30 m/s, and nobody around. */
void DRIVER_defaults(DRIVER_inputs *inputs);

/* Begin: the drive number `drive` of `sample --seed seed` (0: the first), at a time of the simulation [s]; `known`: the
 * columns that inputs say something of, a sum of DRIVER_KNOWS_... or DRIVER_ALL_KNOWN; an effect whose column is not known does not act. */
DRIVER_status DRIVER_start(DRIVER_state *driver, uint64_t seed, uint32_t drive, double time, uint64_t known);

/* Context of the time to come: DRIVER_LOOKS calls before the first step, or none. Each step is then given the inputs
 * of DRIVER_PREVIEW seconds later. */
DRIVER_status DRIVER_look(DRIVER_state *driver, const DRIVER_inputs *inputs);

/* Where the driver is at a time, not before the last one and at most 60 s after it; the first is where it began. The
 * model goes on every 0.2 s, on the inputs of the call that reaches its time. Refused: nothing has changed. */
DRIVER_status DRIVER_step(DRIVER_state *driver, double time, const DRIVER_inputs *inputs, DRIVER_outputs *outputs);

/* After a pause, a leap of time or in another player: the same driver goes on at a time not before he began, from the
 * `position` of the next step. */
DRIVER_status DRIVER_restart(DRIVER_state *driver, double time);

/* Why the last call was refused; "" if it was not. */
const char *DRIVER_message(const DRIVER_state *driver);

/* What wanted what can't be driven, so that the driver is held back: the number of an effect in the profile, from 1, or
 * DRIVER_MOVEMENT_FAULT; 0: nothing. The same in words. */
unsigned DRIVER_fault(const DRIVER_state *driver);
const char *DRIVER_fault_message(const DRIVER_state *driver);

/* To DRIVER_SAVED bytes, and back on a machine of the same byte order. */
void DRIVER_save(const DRIVER_state *driver, unsigned char *bytes);
DRIVER_status DRIVER_restore(DRIVER_state *driver, const unsigned char *bytes, size_t size);

#ifdef __cplusplus
}
#endif

#endif
