/* The driver model of xosc-lateral in C: see the header for its use. The profile's numbers are in DRIVER_profile.h,
 * which is written from the profile; here is what is done with them. */
#include "DRIVER.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "DRIVER_profile.h"

#define PI 3.14159265358979323846

typedef char size_is_as_stated[(sizeof(DRIVER_state) == DRIVER_MEMORY) ? 1 : -1];

/* ---- random numbers: numpy's SeedSequence, PCG64 and Generator ------------------------------------------------- */

/* 64 bits times 64 bits: the upper half. */
static uint64_t upper_product(uint64_t a, uint64_t b) {
    const uint64_t a0 = a & 0xffffffffU, a1 = a >> 32, b0 = b & 0xffffffffU, b1 = b >> 32;
    const uint64_t middle = a1 * b0 + ((a0 * b0) >> 32), other = a0 * b1 + (middle & 0xffffffffU);
    return a1 * b1 + (middle >> 32) + (other >> 32);
}

static void advance(DRIVER_random *random) {
    const uint64_t high = UINT64_C(2549297995355413924), low = UINT64_C(4865540595714422341);
    const uint64_t product = random->low * low;
    random->high = upper_product(random->low, low) + random->high * low + random->low * high;
    random->low = product + random->add_low;
    random->high += random->add_high + (random->low < product ? 1U : 0U);
}

static uint64_t draw(DRIVER_random *random) {
    uint64_t mixed;
    unsigned turn;
    advance(random);
    mixed = random->high ^ random->low;
    turn = (unsigned)(random->high >> 58);
    return (mixed >> turn) | (mixed << ((64U - turn) & 63U));
}

/* Whether a number that stands for yes or no says yes. */
static int is_set(double flag) {
    return flag > 0.0 || flag < 0.0;
}

static double uniform(DRIVER_random *random) {
    return (double)(draw(random) >> 11) * (1.0 / 9007199254740992.0);
}

static double normal(DRIVER_random *random) {
    for (;;) {
        const uint64_t bits = draw(random), size = (bits >> 9) & UINT64_C(0x000fffffffffffff);
        const unsigned layer = (unsigned)(bits & 0xffU);
        const double sign = ((bits >> 8) & 1U) != 0U ? -1.0 : 1.0, x = (double)size * normal_width[layer];
        if (size < normal_inside[layer]) {
            return sign * x;
        }
        if (layer == 0U) {
            double beyond, twice;
            do {
                beyond = -log1p(-uniform(random)) / NORMAL_TAIL;
                twice = -2.0 * log1p(-uniform(random));
            } while (twice <= beyond * beyond);
            return ((size >> 8) & 1U) != 0U ? -(NORMAL_TAIL + beyond) : NORMAL_TAIL + beyond;
        }
        if ((normal_height[layer - 1U] - normal_height[layer]) * uniform(random) + normal_height[layer]
            < exp(-0.5 * x * x)) {
            return sign * x;
        }
    }
}

static double exponential(DRIVER_random *random) {
    for (;;) {
        const uint64_t bits = draw(random) >> 3, size = bits >> 8;
        const unsigned layer = (unsigned)(bits & 0xffU);
        const double x = (double)size * exponential_width[layer];
        if (size < exponential_inside[layer]) {
            return x;
        }
        if (layer == 0U) {
            return EXPONENTIAL_TAIL - log1p(-uniform(random));
        }
        if ((exponential_height[layer - 1U] - exponential_height[layer]) * uniform(random) + exponential_height[layer]
            < exp(-x)) {
            return x;
        }
    }
}

static uint32_t hashed(uint32_t value, uint32_t *constant, uint32_t factor) {
    value ^= *constant;
    *constant *= factor;
    value *= *constant;
    return value ^ (value >> 16);
}

/* The stream below a seed with these keys. */
static void seed_random(DRIVER_random *random, uint64_t seed, const uint32_t *keys, unsigned depth) {
    uint32_t entropy[8] = {0}, pool[4], words[8], constant = 0x43b0d7e5U;
    unsigned i, k;
    entropy[0] = (uint32_t)seed;
    entropy[1] = (uint32_t)(seed >> 32);
    for (k = 0; k < depth; k++) {
        entropy[4U + k] = keys[k];
    }
    for (k = 0; k < 4U; k++) {
        pool[k] = hashed(entropy[k], &constant, 0x931e8875U);
    }
    for (i = 0; i < 4U + depth; i++) {
        for (k = 0; k < 4U; k++) {
            if (i != k) {
                const uint32_t value = i < 4U ? pool[i] : entropy[i];
                pool[k] = 0xca01f9ddU * pool[k] - 0x4973f715U * hashed(value, &constant, 0x931e8875U);
                pool[k] ^= pool[k] >> 16;
            }
        }
    }
    constant = 0x8b51f9ddU;
    for (k = 0; k < 8U; k++) {
        words[k] = hashed(pool[k & 3U], &constant, 0x58f38dedU);
    }
    memset(random, 0, sizeof *random);
    random->add_high = ((uint64_t)words[5] << 32) | words[4];
    random->add_low = ((uint64_t)words[7] << 32) | words[6];
    random->add_high = (random->add_high << 1) | (random->add_low >> 63);
    random->add_low = (random->add_low << 1) | 1U;
    advance(random);
    random->low += ((uint64_t)words[3] << 32) | words[2];
    random->high += (random->low < (((uint64_t)words[3] << 32) | words[2]) ? 1U : 0U);
    random->high += ((uint64_t)words[1] << 32) | words[0];
    advance(random);
}

static void child(DRIVER_random *random, uint64_t seed, uint32_t drive, uint32_t part, uint32_t index) {
    const uint32_t keys[3] = {drive, part, index};
    seed_random(random, seed, keys, 3U);
}

/* ---- core movement ---------------------------------------------------------------------------------------------- */

/* Values through a symmetric kernel of odd length. */
static double convolved(const double *values, const double *kernel, int taps) {
    const int half = taps / 2;
    double sum = kernel[half] * values[half];
    int k;
    for (k = 0; k < half; k++) {
        sum += kernel[k] * (values[k] + values[taps - 1 - k]);
    }
    return sum;
}

/* Forget the oldest of some values, and add one. */
static void push(double *values, int count, double value) {
    memmove(values, values + 1, (size_t)(count - 1) * sizeof *values);
    values[count - 1] = value;
}

static double next_noise(DRIVER_state *driver) {
    return uniform(&driver->fine_random) - 0.5;
}

#if DRIVER_TWO_LEVEL

static double next_level(DRIVER_state *driver) {
    const double scaled = uniform(&driver->coarse_random) * DRIVER_BINS;
    const int column = (int)scaled, cell = (int)(driver->bin % DRIVER_BINS) * DRIVER_BINS + column;
    driver->bin = scaled - column < chain_keep[cell] ? column : chain_other[cell];
    return bin_centre[driver->bin];
}

static void begin_core(DRIVER_state *driver, uint64_t seed, uint32_t drive) {
    DRIVER_random first;
    double place;
    int k;
    child(&driver->coarse_random, seed, drive, SEED_CORE, SEED_CHAIN);
    child(&driver->fine_random, seed, drive, SEED_CORE, SEED_NOISE);
    child(&first, seed, drive, SEED_CORE, SEED_FIRST_BIN);
    place = uniform(&first);
    driver->bin = 0;
    while (driver->bin < DRIVER_BINS - 1 && bin_reached[driver->bin] <= place) {
        driver->bin++;
    }
    driver->mean = DRIVER_MEAN;
    for (k = 0; k < DRIVER_TAPS; k++) {
        driver->noise[k] = k == 0 ? 0.0 : next_noise(driver);
    }
    for (k = 0; k < DRIVER_STEPS; k++) {
        driver->steps[k] = bin_centre[driver->bin];
    }
    for (k = 0; k < DRIVER_STEPS / 2 - 1; k++) {
        push(driver->steps, DRIVER_STEPS, next_level(driver));
    }
}

static double next_coarse(DRIVER_state *driver) {
    push(driver->steps, DRIVER_STEPS, next_level(driver));
    return convolved(driver->steps, smoothing, DRIVER_STEPS);
}

static double next_fine(DRIVER_state *driver) {
    push(driver->noise, DRIVER_TAPS, next_noise(driver));
    return convolved(driver->noise, fine_kernel, DRIVER_TAPS);
}

#else

static uint32_t draw_half(DRIVER_random *random) {
    uint64_t both;
    if (random->has_half != 0U) {
        random->has_half = 0U;
        return (uint32_t)random->half;
    }
    both = draw(random);
    random->has_half = 1U;
    random->half = both >> 32;
    return (uint32_t)both;
}

/* A whole number below `end`. */
static uint32_t draw_below(DRIVER_random *random, uint32_t end) {
    uint64_t scaled = (uint64_t)draw_half(random) * end;
    while ((uint32_t)scaled < (UINT32_MAX - (end - 1U)) % end) {
        scaled = (uint64_t)draw_half(random) * end;
    }
    return (uint32_t)(scaled >> 32);
}

static void correlated(DRIVER_random *random, double *pair) {
    const double first = normal(random), second = normal(random);
    pair[0] = first;
    pair[1] = CORRELATION * first + OTHER_SHARE * second;
}

/* Next factor on the coarse (0) or the fine part (1); each part draws both series for itself. */
static double next_factor(DRIVER_state *driver, int part) {
    DRIVER_factors *const factors = &driver->factors[part];
    double pair[2], logarithm;
    int k;
    correlated(&factors->quick, pair);
    for (k = 0; k < 2; k++) {
        factors->quick_logs[k] = pair[k] * quick_gain[k] + quick_keep[k] * factors->quick_logs[k];
    }
    logarithm = factors->quick_logs[part];
    if (VARIES_SLOWLY != 0) {
        correlated(&factors->slow, pair);
        for (k = 0; k < 2; k++) {
            factors->slow_logs[k] = pair[k] * slow_gain[k] + slow_keep[k] * factors->slow_logs[k];
        }
        logarithm += factors->slow_logs[part];
    }
    return exp(logarithm - factor_offset[part]);
}

static double next_noise_of_a_factor(DRIVER_state *driver) {
    const int64_t row = driver->fine_row % DRIVER_EVERY;
    const double share = (double)row / DRIVER_EVERY;
    if (row == 0) {
        driver->fine_factors[0] = driver->fine_factors[1];
        driver->fine_factors[1] = next_factor(driver, 1);
    }
    driver->fine_row++;
    return next_noise(driver) * (driver->fine_factors[0] * (1.0 - share) + driver->fine_factors[1] * share);
}

/* One more second of the coarse movement: a step of the autoregression, brought to the model's rate. */
static void next_block(DRIVER_state *driver) {
    double value = normal(&driver->coarse_random) * (COARSE_NOISE * next_factor(driver, 0));
    int k, p;
    for (k = 0; k < DRIVER_ORDER; k++) {
        value += coarse_coefficients[k] * driver->steps[DRIVER_STEPS - 1 - k];
    }
    push(driver->steps, DRIVER_STEPS, value);
    for (p = 0; p < DRIVER_EVERY; p++) {
        const double *const held = driver->steps + DRIVER_STEPS - PHASE_STEPS;
        driver->block[p] = held[0] * phases[0][p];
        for (k = 1; k < PHASE_STEPS; k++) {
            driver->block[p] += held[k] * phases[k][p];
        }
    }
    driver->left = DRIVER_EVERY;
}

static double next_coarse(DRIVER_state *driver) {
    double value;
    int side;
    if (driver->left <= 0 || driver->left > DRIVER_EVERY) {
        next_block(driver);
    }
    value = driver->block[DRIVER_EVERY - driver->left] * driver->coarse_scale + driver->mean;
    driver->left--;
    for (side = 0; side < 2; side++) {
        const double knee = driver->knees[side], room = driver->limits[side] - knee;
        if (side == 0 ? value < knee : value > knee) {
            value = knee + room * tanh((value - knee) / room);
        }
    }
    return value;
}

static double next_fine(DRIVER_state *driver) {
    push(driver->noise, DRIVER_TAPS, next_noise_of_a_factor(driver));
    return convolved(driver->noise, fine_kernel, DRIVER_TAPS) * driver->fine_scale;
}

static void begin_core(DRIVER_state *driver, uint64_t seed, uint32_t drive) {
    uint32_t keys[4] = {0U, SEED_CORE, SEED_DRIVER, 0U};
    DRIVER_random setup;
    double coarse = 0.0, fine = 0.0, white[DRIVER_ORDER + 1];
    int i, k, skip;
    keys[0] = drive;
    seed_random(&setup, seed, keys, 3U);
    for (k = 0; k < 2 * CANDIDATES; k++) {
        const double value = normal(&setup);
        coarse = k == 0 ? value : coarse;
        fine = k == CANDIDATES ? value : fine;
    }
    fine = CORRELATION * coarse + OTHER_SHARE * fine;
    driver->coarse_scale = exp(between_spread[0] * coarse - between[0]);
    driver->fine_scale = exp(between_spread[1] * fine - between[1]);
    driver->mean = DRIVER_MEAN + DRIVER_BETWEEN * normal(&setup);
    for (k = 0; k < 2; k++) { /* a driver whose mean is outside bends back from there on */
        const double side = k == 0 ? -1.0 : 1.0, knee = DRIVER_MEAN + KNEE * (limit[k] - DRIVER_MEAN);
        const int is_outside = side * (driver->mean - knee) > 0.0;
        driver->knees[k] = is_outside ? driver->mean : knee;
        driver->limits[k] = is_outside ? side * fmax(side * limit[k], side * driver->mean + HEADROOM) : limit[k];
    }
    (void)uniform(&setup);
    skip = (int)draw_below(&setup, DRIVER_EVERY);
    for (k = 0; k < DRIVER_ORDER; k++) {
        white[k] = normal(&setup);
    }
    for (i = 0; i < DRIVER_ORDER; i++) {
        double past = 0.0;
        for (k = 0; k <= i; k++) {
            past += start_factor[i * (i + 1) / 2 + k] * white[k];
        }
        driver->steps[DRIVER_STEPS - DRIVER_ORDER + i] = past;
    }
    child(&driver->coarse_random, seed, drive, SEED_CORE, SEED_COARSE);
    child(&driver->fine_random, seed, drive, SEED_CORE, SEED_FINE);
    for (i = 0; i < 2; i++) {
        DRIVER_factors *const factors = &driver->factors[i];
        keys[2] = SEED_VOLATILITY;
        keys[3] = 0U;
        seed_random(&factors->quick, seed, keys, 4U);
        keys[3] = 1U;
        seed_random(&factors->slow, seed, keys, 4U);
        correlated(&factors->quick, factors->quick_logs);
        correlated(&factors->slow, factors->slow_logs);
        for (k = 0; k < 2; k++) {
            factors->quick_logs[k] *= quick_spread[k];
            factors->slow_logs[k] *= slow_spread[k];
        }
    }
    driver->fine_factors[1] = next_factor(driver, 1);
    for (k = 0; k < PHASE_STEPS - 1; k++) {
        next_block(driver);
    }
    driver->left = 0;
    for (k = 0; k < DRIVER_TAPS - 1 + FINE_SKIPPED + skip; k++) {
        push(driver->noise, DRIVER_TAPS, next_noise_of_a_factor(driver));
    }
    for (k = 0; k < COARSE_SKIPPED + skip; k++) {
        (void)next_coarse(driver);
    }
}

#endif

/* Coarse movement whose own time passes at a rate, between its values on Catmull-Rom cubics. */
static double coarse_at_rate(DRIVER_state *driver, double rate) {
    const int64_t knot = (int64_t)floor(driver->own_time);
    const double fraction = driver->own_time - (double)knot;
    const double *const w = driver->window;
    double bend, twist;
    while (driver->drawn < knot + 3) {
        push(driver->window, 4, next_coarse(driver));
        if (driver->drawn == 0) { /* before the first value it is as there */
            driver->window[0] = driver->window[1] = driver->window[2] = driver->window[3];
        }
        driver->drawn++;
    }
    bend = 2.0 * w[0] - 5.0 * w[1] + 4.0 * w[2] - w[3];
    twist = 3.0 * (w[1] - w[2]) + w[3] - w[0];
    driver->own_time += rate;
    return w[1] + 0.5 * fraction * (w[2] - w[0] + fraction * (bend + fraction * twist));
}

/* ---- effects ---------------------------------------------------------------------------------------------------- */

/* What effects do: added to the offset [m], and factors. */
typedef struct {
    double location, spread, rate, fine;
} terms_t;

static const terms_t neutral = {0.0, 1.0, 1.0, 1.0};

static void act(terms_t *terms, int acts, double strength) {
    if (acts == ON_LOCATION) {
        terms->location += strength;
    } else {
        const double factor = exp(fmin(fmax(strength, -LOG_LIMIT), LOG_LIMIT));
        terms->spread *= acts == ON_SPREAD ? factor : 1.0;
        terms->rate *= acts == ON_RATE ? factor : 1.0;
        terms->fine *= acts == ON_FINE ? factor : 1.0;
    }
}

/* One factor of a component of an effect's quantity; NAN: there is none. */
static double shaped(const shape_t *shape, double x) {
    const double a = shape->a, b = shape->b;
    switch (shape->kind) {
    case MAGNITUDE: return fabs(x);
    case BEYOND: return x > a ? x - a : 0.0 * x;
    case SATURATING: return tanh((x - a) / b);
    case STEP_AT: return (x - a) * b > 0.0 ? 1.0 : 0.0;
    case HINGE_AT: return (x - a) * b > 0.0 ? (x - a) * b : 0.0;
    case EQUALS: return isnan(x) ? 0.0 : fmax(1.0 - fabs(x - a), 0.0);
    case PRESENCE: return isfinite(x) ? 1.0 : 0.0;
    case NEARNESS: return isnan(x) ? 0.0 : a / fmax(fabs(x), a);
    case PROXIMITY: return isnan(x) ? 0.0 : exp(-fabs(x) / a);
    case SINE: return sin(a * x);
    case COSINE: return cos(a * x);
    default: return x - a; /* VALUE */
    }
}

static double component_of(const component_t *component, const double *columns) {
    double product = 1.0;
    int k;
    for (k = 0; k < component->shapes; k++) {
        const double x = columns[component->shape[k].column];
        product *= shaped(&component->shape[k], isinf(x) && component->levels_off == 0 ? (double)NAN : x);
    }
    return isnan(product) ? component->reference : product;
}

/* A component as many rows ago, where the driver is: before the first row it is as there. */
static double seen(const DRIVER_state *driver, int64_t row, int component) {
    return driver->history[(row > 0 ? row : 0) % DRIVER_ROWS][component];
}

/* How strong each effect of columns acts at a row. */
static void respond(DRIVER_state *driver, int64_t row, double *strengths) {
    int e, i, k, n, lag = 0;
    for (e = 0; e < EFFECTS; e++) {
        const effect_t *const effect = &effects[e];
        double strength = 0.0;
        for (k = effect->first; k < effect->first + effect->components; k++) {
            double value = 0.0;
            for (i = effect->first_shift; i < effect->first_shift + effect->shifts; i++) {
                const int64_t at = row + shifts[i].whole;
                const double next = shifts[i].share > 0.0 && at >= 0 ? seen(driver, at + 1, k) : 0.0;
                const double share = at >= 0 ? shifts[i].share : 0.0;
                value += shifts[i].weight * (seen(driver, at, k) * (1.0 - share) + share * next);
            }
            for (n = 0; n < effect->order; n++, lag++) {
                const double before = row == 0 ? value : driver->settled[lag];
                value = (1.0 - effect->keep) * value + effect->keep * before;
                driver->settled[lag] = value;
            }
            value = fmin(fmax(value, components[k].low), components[k].high);
            strength += (value - components[k].reference) * driver->coefficients[k];
        }
        strengths[e] = (driver->known & effect->columns) == effect->columns ? strength : 0.0;
    }
}

static double half_cosines(const double *sizes, int count, double share) {
    double sum = 0.0;
    int k;
    for (k = 0; k < count; k++) {
        sum += sizes[k] * cos(PI * share * (k + 1));
    }
    return sum;
}

static double share_of(double time, double from, double to) {
    return fmin(fmax((time - from) / fmax(to - from, 1e-9), 0.0), 1.0);
}

static void begin_hidden(DRIVER_state *driver, uint64_t seed, uint32_t drive) {
    int k;
    for (k = 0; k < HIDDEN; k++) {
        const double *const p = hidden_numbers + hidden[k].first;
        DRIVER_hidden_state *const state = &driver->hidden[k];
        child(&state->random, seed, drive, SEED_HIDDEN, (uint32_t)k);
        if (hidden[k].kind == POPULATION) {
            state->numbers[0] = p[0] * normal(&state->random);
            state->numbers[1] = exp(p[1] * normal(&state->random));
            state->numbers[2] = exp(p[2] * normal(&state->random));
        } else if (hidden[k].kind == CYCLE) {
            state->numbers[0] = uniform(&state->random);
        } else if (hidden[k].kind == REGIMES) {
            state->numbers[0] = uniform(&state->random) < p[2] / (p[2] + p[3]) ? 1.0 : 0.0;
            state->numbers[1] = exponential(&state->random) * (state->numbers[0] > 0.0 ? p[2] : p[3]);
        }
    }
}

static void act_hidden(DRIVER_state *driver, int64_t row, terms_t *terms) {
    const double elapsed = DRIVER_STEP * (double)row, time = driver->begun_at + elapsed;
    int k;
    for (k = 0; k < HIDDEN; k++) {
        const double *const p = hidden_numbers + hidden[k].first;
        DRIVER_hidden_state *const state = &driver->hidden[k];
        double *const own = state->numbers;
        switch (hidden[k].kind) {
        case ADAPTED:
            terms->location += p[0];
            terms->spread *= p[1];
            terms->rate *= p[2];
            terms->fine *= p[3];
            break;
        case POPULATION:
            terms->location += own[0];
            terms->spread *= own[1];
            terms->fine *= own[2];
            break;
        case JUMP:
            terms->location += p[0] * ((time >= p[1] ? 1.0 : 0.0) - (1.0 - p[2]));
            break;
        case TREND:
            terms->spread *= pow(p[0], share_of(time, p[2], p[3]) - 0.5);
            terms->fine *= pow(p[1], share_of(time, p[2], p[3]) - 0.5);
            break;
        case SMOOTH: {
            const int locations = (int)p[2], spreads = (int)p[3], fines = (int)p[4];
            const double share = share_of(time, p[0], p[1]);
            terms->location += half_cosines(p + 5, locations, share);
            terms->spread *= exp(half_cosines(p + 5 + locations, spreads, share));
            terms->fine *= exp(half_cosines(p + 5 + locations + spreads, fines, share));
            break;
        }
        case DRIFT: {
            const double noise = normal(&state->random) * p[0];
            own[0] = row == 0 ? noise : noise * sqrt(1.0 - p[1] * p[1]) + p[1] * own[0];
            terms->location += own[0];
            break;
        }
        case CYCLE:
            own[1] += normal(&state->random);
            terms->location += p[0] * sin(2.0 * PI * (own[0] + elapsed / p[1]) + own[1] * p[2]);
            break;
        default: /* REGIMES */
            while (own[1] <= elapsed) {
                own[0] = 1.0 - own[0];
                own[1] += exponential(&state->random) * (own[0] > 0.0 ? p[2] : p[3]);
            }
            terms->spread *= own[0] > 0.0 ? p[0] : 1.0;
            terms->fine *= own[0] > 0.0 ? p[1] : 1.0;
            break;
        }
    }
}

/* ---- model steps ------------------------------------------------------------------------------------------------ */

/* The curve between the samples in the middle: value, slope and second derivative by central differences. */
static void bend_curve(DRIVER_state *driver) {
    const double *const s = driver->samples;
    const double rise = s[2] - s[1], slope = 0.5 * (s[2] - s[0]), next_slope = 0.5 * (s[3] - s[1]);
    const double bend = s[2] - 2.0 * s[1] + s[0], next_bend = s[3] - 2.0 * s[2] + s[1];
    driver->curve[0] = s[1];
    driver->curve[1] = slope;
    driver->curve[2] = 0.5 * bend;
    driver->curve[3] = 10.0 * rise - 6.0 * slope - 4.0 * next_slope - 1.5 * bend + 0.5 * next_bend;
    driver->curve[4] = -15.0 * rise + 8.0 * slope + 7.0 * next_slope + 1.5 * bend - next_bend;
    driver->curve[5] = 6.0 * rise - 3.0 * slope - 3.0 * next_slope - 0.5 * bend + 0.5 * next_bend;
}

/* ---- what is asked of a vehicle --------------------------------------------------------------------------------- */

/* What moves a driver at a row: chance, hidden effects, and the lane's width. */
typedef struct {
    double coarse, fine, width;
    terms_t own;
} moved_t;

enum { LOCATION, SPREAD, FINE, WIDTH, OWN, HEEDED };

static void heed(double *heeded, const terms_t *terms, double width) {
    heeded[LOCATION] = terms->location;
    heeded[SPREAD] = terms->spread;
    heeded[FINE] = terms->fine;
    heeded[WIDTH] = width;
    heeded[OWN] = 1.0;
}

/* Where a driver is under a context that he heeds. [m] */
static double offset_under(const DRIVER_state *driver, const moved_t *moved, const double *heeded) {
    const double by_lane = fmin(heeded[WIDTH], WIDEST_LANE), by_hand = FINE_WIDTH > 0.0 ? FINE_WIDTH : by_lane;
    const double coarse = driver->mean + moved->own.spread * heeded[SPREAD] * (moved->coarse - driver->mean);
    const double fine = moved->own.fine * heeded[FINE] * moved->fine;
    return heeded[OWN] > 0.0 ? coarse * by_lane + fine * by_hand + (moved->own.location + heeded[LOCATION]) : 0.0;
}

/* Who wants too much goes on as if there were no context; if that is too much, to the lane's centre. */
static void heed_less(DRIVER_state *driver, const moved_t *moved, const double *strengths, double reach, double *heeded) {
    double alone, worst = 0.0;
    int e;
    heed(heeded, &neutral, moved->width);
    alone = offset_under(driver, moved, heeded);
    driver->fault = DRIVER_MOVEMENT_FAULT;
    if (!(fabs(alone) <= reach)) {
        heeded[OWN] = 0.0;
        return;
    }
    for (e = 0; e < EFFECTS; e++) { /* which effect is it? */
        double one[HEEDED], shift;
        terms_t terms = neutral;
        act(&terms, effects[e].acts, strengths[e]);
        heed(one, &terms, moved->width);
        shift = fabs(offset_under(driver, moved, one) - alone);
        shift = isnan(shift) ? (double)INFINITY : shift;
        if (shift > worst) {
            worst = shift;
            driver->fault = effects[e].number;
        }
    }
}

/* The speed from which one stops after just a way. [m/s] */
static double stopping_speed(double way, double push) {
    const double left = fmax(way, 0.0), change = push * DRIVER_STEP;
    const double further = floor(sqrt(0.25 + 2.0 * left / (change * DRIVER_STEP)) - 0.5); /* steps after the first */
    return left / (DRIVER_STEP * (further + 1.0)) + 0.5 * change * further;
}

/* Pay off what is owed: at once where that is slow and soft enough, else as fast as one can and still stop there. */
static void pay_off(DRIVER_state *driver) {
    const double change = RESPONSE_ACCELERATION * DRIVER_STEP;
    double wanted = driver->owed / DRIVER_STEP;
    if (fabs(wanted - driver->pace) <= change && fabs(wanted) <= RESPONSE_SPEED) {
        driver->owed = 0.0;
        driver->pace = wanted;
        return;
    }
    if (fabs(driver->owed) > change * DRIVER_STEP) {
        wanted = fmin(RESPONSE_SPEED, stopping_speed(fabs(driver->owed), RESPONSE_ACCELERATION));
        wanted = copysign(wanted, driver->owed);
    }
    driver->pace += fmin(fmax(wanted - driver->pace, -change), change);
    driver->owed -= driver->pace * DRIVER_STEP;
}

/* The next offset as near to the wanted one as can be driven. [m] */
static double drivable_step(const DRIVER_state *driver, double wanted, double reach) {
    const double last = driver->samples[3], speed = (last - driver->samples[2]) / DRIVER_STEP;
    const double change = LARGEST_ACCELERATION * DRIVER_STEP;
    const double out = fmin(LARGEST_SPEED, stopping_speed(reach - last, LARGEST_ACCELERATION));
    const double back = fmin(LARGEST_SPEED, stopping_speed(reach + last, LARGEST_ACCELERATION));
    const double aim = fmin(fmax((wanted - last) / DRIVER_STEP, -back), out);
    return last + DRIVER_STEP * fmin(fmax(aim, speed - change), speed + change);
}

/* The offset at a row, by all that acts on the driver. [m] */
static double sample_at(DRIVER_state *driver, int64_t row) {
    const double *const s = driver->samples;
    moved_t moved;
    terms_t terms = neutral;
    double strengths[EFFECTS + 1], heeded[HEEDED], wanted, reach;
    int e, is_wild, foresees = driver->foresees != 0;
    moved.own = neutral;
    moved.width = seen(driver, row, DRIVER_COMPONENTS);
    act_hidden(driver, row, &moved.own);
    respond(driver, row, strengths);
    for (e = 0; e < EFFECTS; e++) {
        act(&terms, effects[e].acts, strengths[e]);
    }
    moved.coarse = RATED != 0 ? coarse_at_rate(driver, moved.own.rate * terms.rate) : next_coarse(driver);
    moved.fine = next_fine(driver);
    heed(heeded, &terms, moved.width);
    wanted = offset_under(driver, &moved, heeded);
    reach = OFFSET_LANES * fmax(moved.width, MINIMUM_LANE_WIDTH);
    is_wild = !(fabs(wanted) <= reach);
    if (is_wild != 0) {
        heed_less(driver, &moved, strengths, reach, heeded);
        wanted = offset_under(driver, &moved, heeded);
    }
    if (foresees == 0 || is_wild != 0 || fabs(driver->owed) > 0.0) {
        const int first = foresees != 0 ? OWN : LOCATION; /* who knows what comes responds as he does */
        if (driver->heeded[WIDTH] > 0.0 && memcmp(heeded + first, driver->heeded + first, (size_t)(HEEDED - first) * sizeof *heeded) != 0) {
            const double was = offset_under(driver, &moved, driver->heeded);
            driver->owed += wanted - (isnan(was) ? 0.0 : fmin(fmax(was, -reach), reach));
        }
        memcpy(driver->heeded, heeded, sizeof heeded);
        pay_off(driver);
    }
    wanted -= driver->owed;
    if (foresees == 0 && is_wild == 0 && row >= 2
        && (fabs(wanted - 2.0 * s[3] + s[2]) > IMPOSSIBLE_ACCELERATION * (DRIVER_STEP * DRIVER_STEP)
            || fabs(wanted - s[3]) > LARGEST_SPEED * DRIVER_STEP)) {
        driver->fault = DRIVER_MOVEMENT_FAULT;
    }
    if (driver->fault != 0) {
        wanted = row >= 2 ? drivable_step(driver, wanted, reach) : fmin(fmax(wanted, -reach), reach);
    }
    return wanted;
}

/* One more row of context, and the sample that it completes. */
static void take_row(DRIVER_state *driver, const double *columns) {
    double *const latest = driver->history[driver->rows % DRIVER_ROWS];
    int64_t row;
    int k;
    for (k = 0; k < COMPONENTS; k++) {
        latest[k] = component_of(&components[k], columns);
    }
    latest[DRIVER_COMPONENTS] = columns[LANE_WIDTH];
    row = driver->rows - AHEAD;
    driver->rows++;
    if (row >= 0) {
        push(driver->samples, 4, sample_at(driver, row));
        if (row == 2) { /* what came before lies on a straight line */
            driver->samples[0] = 2.0 * driver->samples[1] - driver->samples[2];
        }
        if (row >= 2) {
            bend_curve(driver);
        }
    }
}

/* ---- from the curve to where the vehicle is --------------------------------------------------------------------- */

/* Begin to lead over from a gap that changes at a rate, within what is no corner of the path. */
static void lead_over(DRIVER_state *driver, double gap, double rate, double speed) {
    const double bound = LARGEST_TURN * fmax(fabs(speed), MINIMUM_SPEED);
    driver->from = gap;
    driver->from_rate = rate;
    driver->share = 0.0;
    driver->over = fmax(SETTLING_TIME, fmax(sqrt(STEP_PEAK * fabs(gap) / bound), 4.0 * fabs(rate) / bound));
}

/* On with leading over; how fast what is left changes. */
static double settle(DRIVER_state *driver, double passed) {
    const double over = driver->over;
    double u, fall;
    driver->rest = 0.0;
    if (over <= 0.0) {
        return 0.0;
    }
    driver->share += passed / over;
    if (driver->share >= 1.0) {
        driver->over = 0.0;
        return 0.0;
    }
    u = driver->share;
    fall = 1.0 - u;
    driver->rest = driver->from * (1.0 - u * u * u * (10.0 - 15.0 * u + 6.0 * u * u))
        + over * driver->from_rate * (u - 6.0 * pow(u, 3.0) + 8.0 * pow(u, 4.0) - 3.0 * pow(u, 5.0));
    return driver->from * (-30.0 * u * u * fall * fall / over)
        + driver->from_rate * (1.0 - 18.0 * u * u + 32.0 * pow(u, 3.0) - 15.0 * pow(u, 4.0));
}

static int is_slow(double speed) {
    return fabs(speed) < MINIMUM_SPEED * (1.0 - SPEED_SLACK);
}

/* Seconds of the driver's clock in one, by the speed alone: a straight line between two knots. */
static double clock_rate(double speed) {
    const double pace = fabs(speed);
    int k = 0;
    if (!is_slow(speed)) {
        return 1.0;
    }
    while (k < CLOCK_KNOTS - 2 && pace > clock_speeds[k + 1]) {
        k++;
    }
    return clock_rates[k] + (pace - clock_speeds[k]) * (clock_rates[k + 1] - clock_rates[k])
        / (clock_speeds[k + 1] - clock_speeds[k]);
}

/* Distance driven in a second of the driver's clock; below the first knot the rate is in proportion to the speed. */
static double way_of(double speed) {
    const double pace = fmax(fabs(speed), clock_speeds[1]);
    return pace / clock_rate(pace);
}

/* Seconds of the driver's clock in one: below 40 km/h fewer, and none at rest. */
static double pace_of(double speed, double own_rate) {
    const double turning = LARGEST_SINE * fabs(speed) / fmax(fabs(own_rate), NEGLIGIBLE_REST);
    return is_slow(speed) ? fmin(clock_rate(speed), turning) : 1.0;
}

/* On to the next curve, at the end of one, where it is known. */
static void turn_over(DRIVER_state *driver) {
    if (is_set(driver->ahead) && driver->clock >= 1.0 - CLOCK_TOLERANCE) {
        memcpy(driver->curve, driver->next, sizeof driver->curve);
        driver->ahead = 0.0;
        driver->clock = fmax(driver->clock - 1.0, 0.0);
    }
}

/* Curves for all until the next model step, `u` into this one. */
static void draw_ahead(DRIVER_state *driver, double u, const double *columns) {
    double now[6];
    turn_over(driver);
    while (!is_set(driver->ahead) && driver->clock > u + CLOCK_TOLERANCE) {
        memcpy(now, driver->curve, sizeof now);
        take_row(driver, columns);
        memcpy(driver->next, driver->curve, sizeof now);
        memcpy(driver->curve, now, sizeof now);
        driver->ahead = 1.0;
        turn_over(driver);
    }
}

static void move(DRIVER_state *driver, double passed, const DRIVER_inputs *in, DRIVER_outputs *out) {
    const double *const c = driver->curve;
    const double u = fmin(fmax(driver->clock, 0.0), 1.0);
    const double own = c[0] + u * (c[1] + u * (c[2] + u * (c[3] + u * (c[4] + u * c[5]))));
    const double slope = c[1] + u * (2.0 * c[2] + u * (3.0 * c[3] + u * (4.0 * c[4] + u * 5.0 * c[5])));
    const int follows = is_set(in->following), followed = is_set(driver->was_following);
    const double pace = pace_of(in->speed, driver->own_rate), rate = slope / DRIVER_STEP * pace;
    double own_rate, most;
    if (driver->stepped == 0 || is_set(driver->paused)) {
        driver->place = in->position;
    }
    /* who drives, began so; who is slow or stands stays where it is, and is led over as it drives off */
    if (follows && driver->stepped == 0 && pace < 1.0) {
        lead_over(driver, driver->place - own, 0.0, in->speed);
    } else if (follows && !followed && driver->stepped != 0) {
        lead_over(driver, driver->place - own + rate * passed, -rate, in->speed);
    }
    driver->paused = 0.0;
    if (in->speed > STANDSTILL) {
        driver->moved = 1.0;
    }
    own_rate = slope / DRIVER_STEP + settle(driver, passed * pace);
    out->offset = follows ? own + driver->rest : in->position;
    out->rate = follows ? own_rate * pace_of(in->speed, own_rate) : 0.0;
    most = is_slow(in->speed) ? LARGEST_SINE : 1.0;
    out->heading = follows && is_set(driver->moved) ? asin(fmin(fmax(own_rate / way_of(in->speed), -most), most)) : 0.0;
    driver->own_rate = follows ? own_rate : 0.0;
    driver->was_following = follows ? 1.0 : 0.0;
    driver->place = out->offset;
}

/* ---- what others call ------------------------------------------------------------------------------------------- */

static DRIVER_status refused(DRIVER_state *driver, unsigned message) {
    driver->message = message;
    return message == 0U ? DRIVER_OK : DRIVER_REFUSED;
}

/* What is wrong with inputs, 0 if nothing is; `columns` are theirs. */
static unsigned fault_of(const DRIVER_inputs *inputs, double *columns) {
    unsigned fault = 0U;
    int k;
    memcpy(columns, inputs, COLUMNS * sizeof *columns);
    columns[LANE_WIDTH] = isnan(inputs->lane_width) ? OWN_LANE_WIDTH : inputs->lane_width;
    if (!(columns[LANE_WIDTH] > 0.0)) {
        fault = FAULT_LANE_WIDTH;
    }
    if (!(inputs->speed >= 0.0)) {
        fault = FAULT_SPEED;
    }
    if (isnan(inputs->following)) {
        fault = FAULT_FOLLOWING;
    }
    if (!(fabs(inputs->position) <= FARTHEST_POSITION)) {
        fault = FAULT_POSITION;
    }
    for (k = 0; k < COLUMNS; k++) {
        const int is_nobody = ranges[k].may_be_infinite != 0 && isinf(columns[k]) && columns[k] > 0.0;
        if (columns[k] < ranges[k].low || (columns[k] > ranges[k].high && !is_nobody)) {
            fault = FAULT_COLUMNS + (unsigned)k;
        }
    }
    return fault;
}

void DRIVER_defaults(DRIVER_inputs *inputs) {
    *inputs = usual_inputs;
}

DRIVER_status DRIVER_start(DRIVER_state *driver, uint64_t seed, uint32_t drive, double time, uint64_t known) {
    int e, k;
    memset(driver, 0, sizeof *driver);
    if (!(fabs(time) <= LATEST_TIME)) {
        return refused(driver, FAULT_TIME);
    }
    driver->profile = PROFILE;
    driver->known = known;
    driver->begun_at = driver->time = time;
    for (e = 0; e < EFFECTS; e++) {
        DRIVER_random random;
        child(&random, seed, drive, SEED_SLOPES, (uint32_t)e);
        for (k = effects[e].first; k < effects[e].first + effects[e].components; k++) {
            const double slope = effects[e].differs != 0 ? components[k].between * normal(&random) : 0.0;
            driver->coefficients[k] = components[k].coefficient + slope;
        }
    }
    begin_hidden(driver, seed, drive);
    begin_core(driver, seed, drive);
    return DRIVER_OK;
}

DRIVER_status DRIVER_look(DRIVER_state *driver, const DRIVER_inputs *inputs) {
    double columns[COLUMNS];
    unsigned fault = driver->profile == PROFILE ? fault_of(inputs, columns) : (unsigned)FAULT_START;
    if (fault == 0U && (driver->looked >= DRIVER_LOOKS || driver->stepped != 0)) {
        fault = FAULT_LOOKS;
    }
    if (fault == 0U) {
        driver->looked++;
        driver->foresees = 1;
        take_row(driver, columns);
    }
    return refused(driver, fault);
}

DRIVER_status DRIVER_restart(DRIVER_state *driver, double time) {
    double u;
    unsigned fault = driver->profile == PROFILE ? 0U : (unsigned)FAULT_START;
    if (fault == 0U && !(time >= driver->begun_at && fabs(time) <= LATEST_TIME)) {
        fault = FAULT_TIME;
    }
    if (fault == 0U && driver->stepped != 0) {
        u = (time - driver->begun_at) / DRIVER_STEP;
        driver->knots = (int64_t)floor(u + 1e-9);
        driver->clock = fmin(driver->clock, fmax(u - (double)driver->knots, 0.0));
        driver->time = time;
        driver->was_following = 0.0;
        driver->paused = 1.0;
    }
    return refused(driver, fault);
}

DRIVER_status DRIVER_step(DRIVER_state *driver, double time, const DRIVER_inputs *inputs, DRIVER_outputs *outputs) {
    double columns[COLUMNS], passed, u;
    int64_t due;
    unsigned fault = driver->profile == PROFILE ? fault_of(inputs, columns) : (unsigned)FAULT_START;
    if (fault == 0U && driver->looked != 0 && driver->looked != DRIVER_LOOKS) {
        fault = FAULT_LOOKS;
    }
    passed = time - driver->time;
    if (fault == 0U && !(passed >= 0.0 && passed <= LONGEST_PAUSE && fabs(time) <= LATEST_TIME)) {
        fault = FAULT_TIME;
    }
    if (fault != 0U) {
        return refused(driver, fault);
    }
    due = (int64_t)floor((time - driver->begun_at) / DRIVER_STEP + 1e-9) + 1;
    while (driver->looked < DRIVER_LOOKS) {
        driver->looked++;
        take_row(driver, columns);
    }
    passed = driver->stepped != 0 ? passed : 0.0;
    u = (time - driver->begun_at) / DRIVER_STEP - (double)(due - 1);
    driver->clock += passed * pace_of(inputs->speed, driver->own_rate) / DRIVER_STEP;
    if (driver->stepped == 0) { /* as if it had driven since its start */
        driver->clock = (double)due + u;
    }
    if (driver->knots < due) {
        driver->knots = due;
        draw_ahead(driver, u, columns);
    }
    turn_over(driver);
    move(driver, passed, inputs, outputs);
    driver->time = time;
    driver->stepped = 1;
    return refused(driver, 0U);
}

const char *DRIVER_message(const DRIVER_state *driver) {
    return driver->message < FAULTS ? faults[driver->message] : faults[FAULT_START];
}

unsigned DRIVER_fault(const DRIVER_state *driver) {
    return driver->fault > 0 && driver->fault <= DRIVER_MOVEMENT_FAULT ? (unsigned)driver->fault : 0U;
}

const char *DRIVER_fault_message(const DRIVER_state *driver) {
    return impossible[DRIVER_fault(driver)];
}

static uint64_t checksum(const unsigned char *bytes) {
    uint64_t sum = UINT64_C(14695981039346656037);
    size_t k;
    for (k = 0; k < DRIVER_MEMORY; k++) { /* FNV-1a */
        sum = (sum ^ bytes[k]) * UINT64_C(1099511628211);
    }
    return sum;
}

void DRIVER_save(const DRIVER_state *driver, unsigned char *bytes) {
    const uint64_t profile = PROFILE;
    uint64_t sum;
    memcpy(bytes, driver, DRIVER_MEMORY);
    sum = checksum(bytes);
    memcpy(bytes + DRIVER_MEMORY, &profile, 8U);
    memcpy(bytes + DRIVER_MEMORY + 8U, &sum, 8U);
}

DRIVER_status DRIVER_restore(DRIVER_state *driver, const unsigned char *bytes, size_t size) {
    const uint64_t profile = PROFILE;
    uint64_t sum = 0U;
    if (size == DRIVER_SAVED) {
        sum = checksum(bytes);
    }
    if (size != DRIVER_SAVED || memcmp(bytes + DRIVER_MEMORY, &profile, 8U) != 0
        || memcmp(bytes + DRIVER_MEMORY + 8U, &sum, 8U) != 0) {
        return refused(driver, FAULT_STATE);
    }
    memcpy(driver, bytes, DRIVER_MEMORY);
    return DRIVER_OK;
}
